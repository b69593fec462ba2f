"""``implicit-decals doctor``: what this machine has of what the project needs, and what to do about it."""

from rich.console import Console
from rich.table import Table
from rich.text import Text

from decals.render.libraries import missing_gl_libraries

from ..machine.finding import Finding, Status
from ..machine.graphics import context_findings, library_finding
from ..machine.sample_meshes import sample_finding
from ..machine.software import package_findings, platform_finding, python_finding, warp_finding


def examine() -> list[Finding]:
    """Look at everything."""
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
    """Print the findings, then what to do.

    Parameters
    ----------
    findings
        What `examine` returned.
    console
        Where to print.

    Returns
    -------
    int
        The exit code: 0 if everything that drawing needs is here, else 1.
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
    lacking = [finding.name for finding in findings if finding.status is Status.MISSING]
    verdict = f"Missing: {', '.join(lacking)}." if lacking else "Everything that drawing needs is here."
    console.print(f"\n{verdict}", markup=False, highlight=False)
    return 1 if lacking else 0


def doctor() -> int:
    """Say what is here of what the project needs, and what to do about the rest.

    Returns
    -------
    int
        The exit code: 0 if everything that drawing needs is here, else 1.
    """
    return report(examine(), Console())
