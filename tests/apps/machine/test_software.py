"""Python, packages and Warp, as they are and as they may be."""

from importlib import metadata

from implicit_decals.apps.machine import software
from implicit_decals.apps.machine.finding import Finding, Status


def test_an_old_python_is_missing() -> None:
    assert software.python_finding((3, 11, 0)).status is Status.GOOD
    old = software.python_finding((3, 10, 12))
    assert old.status is Status.MISSING
    assert old.value == "3.10.12"
    assert "3.11" in old.advice


def test_every_package_is_looked_for_and_an_absent_one_comes_with_its_command() -> None:
    def version(name: str) -> str:
        if name == "vtk":
            raise metadata.PackageNotFoundError(name)
        return "1.2"

    found = {finding.name: finding for finding in software.package_findings(version)}
    assert set(found) == set(software.PACKAGES)
    assert found["vtk"].status is Status.MISSING
    assert found["vtk"].advice.endswith("-m pip install vtk")
    assert found["numpy"] == Finding("numpy", "1.2")


def test_warp_that_does_not_start_is_a_finding() -> None:
    def broken() -> list[str]:
        raise RuntimeError("first\nno such library")

    finding = software.warp_finding(broken)
    assert finding.status is Status.MISSING
    assert finding.value == "none: no such library"
    assert software.warp_finding(lambda: ["cpu (CPU)"]) == Finding("Warp devices", "cpu (CPU)")
