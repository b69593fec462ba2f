"""``implicit-decals doctor``: check the software and hardware of this machine, and give advice."""

from rich.console import Console
from rich.table import Table
from rich.text import Text

from decals.apps.doctor.finding import Finding, Status
from decals.apps.doctor.graphics import context_findings, library_finding
from decals.apps.doctor.sample_meshes import sample_finding
from decals.apps.doctor.software import package_findings, platform_finding, python_finding, warp_finding
from decals.rendering.gl_libraries import missing_gl_libraries


def examine() -> list[Finding]:
    """Run all checks."""
    missing = missing_gl_libraries()
    return [
        python_finding(),
        platform_finding(),
        *package_findings(),
        warp_finding(),
        library_finding(missing),
        *([] if missing else context_findings()),
        sample_finding(),
    ]


def report(findings: list[Finding], console: Console) -> int:
    """Print the findings, then the advice.

    Parameters
    ----------
    findings
        The result of `examine`.
    console
        The console to print on.

    Returns
    -------
    int
        The exit code: 0 if nothing that drawing needs is missing, else 1.
    """
    styles = {Status.GOOD: "green", Status.NOTE: "yellow", Status.MISSING: "bold red"}
    table = Table("", "", "", show_header=False, box=None, padding=(0, 2, 0, 0))
    for finding in findings:
        style = styles[finding.status]
        table.add_row(Text(finding.name), Text(finding.value), Text(finding.status.value, style))
    console.print(table)
    for finding in findings:
        if finding.advice:
            console.print(
                f"\n{finding.name}: {finding.advice}", markup=False, highlight=False, soft_wrap=True
            )
    missing = [finding.name for finding in findings if finding.status is Status.MISSING]
    verdict = f"Missing: {', '.join(missing)}." if missing else "Everything that drawing needs is installed."
    console.print(f"\n{verdict}", markup=False, highlight=False)
    return 1 if missing else 0


def doctor() -> int:
    """Check the software and hardware of this machine, and print advice.

    Returns
    -------
    int
        The exit code: 0 if nothing that drawing needs is missing, else 1.
    """
    return report(examine(), Console())
