"""Check of the sample meshes that pyvista has downloaded."""

import os
from collections.abc import Mapping
from pathlib import Path

from decals.apps.doctor.finding import Finding, Status

SAMPLES = ("dragon.ply", "horse.vtp")


def sample_finding(environment: Mapping[str, str] = os.environ) -> Finding:
    """Look for the sample meshes in the folder ``PYVISTA_DATA`` and in pyvista's cache.

    Parameters
    ----------
    environment
        The environment variables of the process.
    """
    folders = [*_data_folder(environment), *_download_folder()]
    absent = [name for name in SAMPLES if not any((folder / name).is_file() for folder in folders)]
    if not absent:
        return Finding("Sample meshes", ", ".join(SAMPLES))
    if "PYVISTA_DATA" in environment:
        value = f"PYVISTA_DATA is {environment['PYVISTA_DATA']}, which lacks {', '.join(absent)}"
        advice = "Set PYVISTA_DATA to a folder that has these files in Data/, or unset it to download them."
        return Finding("Sample meshes", value, Status.NOTE, advice)
    advice = (
        "pyvista downloads them on first use. Without a network, set PYVISTA_DATA to a folder that has these "
        "files in Data/."
    )
    return Finding("Sample meshes", f"not downloaded yet: {', '.join(absent)}", Status.NOTE, advice)


def _data_folder(environment: Mapping[str, str]) -> list[Path]:
    if "PYVISTA_DATA" not in environment:
        return []
    folder = Path(environment["PYVISTA_DATA"])
    return [folder if folder.name == "Data" else folder / "Data"]


def _download_folder() -> list[Path]:
    try:
        from pyvista.examples import downloads
    except Exception:  # `package_findings` reports a pyvista that fails to import
        return []
    return [Path(downloads.USER_DATA_PATH)]
