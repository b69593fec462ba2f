"""Python, packages and Warp, as they are and as they may be."""

from importlib import metadata

from decals.apps.doctor import software
from decals.apps.doctor.finding import Finding, Status


def test_an_old_python_is_missing() -> None:
    assert software.python_finding((3, 11, 0)).status is Status.GOOD
    old = software.python_finding((3, 10, 12))
    assert old.status is Status.MISSING
    assert old.value == "3.10.12"
    assert "3.11" in old.advice


def test_all_packages_are_checked_and_a_missing_one_has_advice() -> None:
    def version(name: str) -> str:
        if name == "vtk":
            raise metadata.PackageNotFoundError(name)
        return "1.2"

    found = {finding.name: finding for finding in software.package_findings(version)}
    assert set(found) == set(software.PACKAGES)
    assert found["vtk"].status is Status.MISSING
    assert found["vtk"].advice.endswith("-m pip install vtk")
    assert found["numpy"] == Finding("numpy", "1.2")


def test_a_broken_warp_is_a_finding() -> None:
    def broken() -> list[str]:
        raise RuntimeError("first\nno such library")

    finding = software.warp_finding(broken)
    assert finding.status is Status.MISSING
    assert finding.value == "none: no such library"
    assert software.warp_finding(lambda: ["cpu (CPU)"]) == Finding("Warp devices", "cpu (CPU)")
