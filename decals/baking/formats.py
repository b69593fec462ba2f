"""The formats of `export`: what each holds, and its writer."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from decals.baking.glb import glb_bytes, gltf_bytes
from decals.baking.obj import obj_files
from decals.baking.parts import Baked
from decals.baking.plain_files import ply_files, stl_bytes, vtp_file
from decals.baking.threemf import threemf_bytes
from decals.baking.usd import usdz_bytes

Files = Mapping[str, bytes]
"""Contents by names; the main file has the name ""."""


@dataclass(frozen=True)
class Format:
    """What a format holds.

    Attributes
    ----------
    write : callable
        Returns the files of a baked scene, given also the name of the main one without its suffix.
    colors : tuple of str
        Places of colours, the usual one first.
    attributes : bool
        True if vertices may have values besides their colours.
    instances : bool
        True if decals may be copies of a square.
    tiles : bool
        True if there may be several textures, as UDIM tiles.
    recipe : bool
        True if a file keeps how it was made.
    packages : tuple of (str, str)
        Packages that the writer needs, and the extras that install them.
    """

    write: Callable[[Baked, str], Files]
    colors: tuple[str, ...] = ()
    attributes: bool = False
    instances: bool = False
    tiles: bool = False
    recipe: bool = False
    packages: tuple[tuple[str, str], ...] = ()


def _alone(encode: Callable[[Baked], bytes]) -> Callable[[Baked, str], Files]:
    """Return the writer of a format of one file."""
    return lambda baked, _: {"": encode(baked)}


_TRIMESH = (("trimesh", "bake"),)

FORMATS: dict[str, Format] = {
    ".glb": Format(_alone(glb_bytes), ("texture", "vertices"), True, True, True, True, _TRIMESH),
    ".gltf": Format(_alone(gltf_bytes), ("texture", "vertices"), True, True, True, True, _TRIMESH),
    ".obj": Format(obj_files, ("texture", "vertices"), tiles=True),
    ".ply": Format(ply_files, ("vertices", "texture"), True),
    ".stl": Format(_alone(stl_bytes)),
    ".3mf": Format(_alone(threemf_bytes), ("vertices", "texture")),
    ".usdz": Format(_alone(usdz_bytes), ("texture", "vertices"), True, packages=(("pxr", "usd"),)),
    ".vtp": Format(_alone(vtp_file), ("vertices",), True),
}
"""Formats by suffix."""
