"""USDZ files, written by OpenUSD: a mesh for each part, with one preview surface.

OpenUSD works in a process of its own, which runs this module: while it is loaded, NumPy in another thread can
wait for the loader, which waits for it.
"""

import json
import pickle
import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from decals.baking.materials import ROUGHNESS, Maps
from decals.baking.parts import METRES, Baked, Part
from decals.baking.pictures import png_bytes
from decals.child_process import answer_of, answer_once, can_isolate, start_child
from decals.errors import InvalidScene
from decals.validation import optional_package

MODULES = tuple(f"pxr.{name}" for name in ("Gf", "Sdf", "Tf", "Usd", "UsdGeom", "UsdShade", "Vt"))
"""Modules of OpenUSD that write a file."""
MODULE = "decals.baking.usd"

STAGE = "scene.usdc"
"""First file of the package, as the format demands."""


def usdz_bytes(baked: Baked) -> bytes:
    """Return a USDZ file.

    Raises
    ------
    MissingPackage
        If usd-core is not installed.
    InvalidScene
        If OpenUSD cannot write the scene.
    """
    optional_package("pxr", "usd")
    if not can_isolate():
        return written(baked)
    fresh = [replace(part) for part in baked.parts]  # without checks, which another thread adds
    request = pickle.dumps(replace(baked, parts=fresh))
    child = start_child(MODULE, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
    content, errors = answer_of(child, "writing the file", request)
    if child.returncode:
        reason = (errors.decode(errors="replace").strip() or "it crashed").splitlines()[-1]
        raise InvalidScene(f"OpenUSD could not write the scene ({reason:.200}); write a .glb file")
    return content


def written(baked: Baked) -> bytes:
    """Return a USDZ file that OpenUSD writes in this process."""
    pxr = SimpleNamespace(**{name.rpartition(".")[2]: optional_package(name, "usd") for name in MODULES})
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        pictures = {} if baked.maps is None else _pictures(baked.maps)
        for file, content in pictures.items():
            (folder / file).write_bytes(content)
        stage = pxr.Usd.Stage.CreateNew(str(folder / STAGE))
        _fill(pxr, stage, baked)
        stage.GetRootLayer().Save()
        writer = pxr.Sdf.ZipFileWriter.CreateNew(str(folder / "scene.usdz"))
        for file in (STAGE, *pictures):
            writer.AddFile(str(folder / file), file)
        writer.Save()
        return (folder / "scene.usdz").read_bytes()


def _pictures(maps: Maps) -> dict[str, bytes]:
    """Return the textures by their names."""
    levels = {"color": maps.color, "normal": maps.normal, "surface": maps.surface, "emission": maps.emission}
    return {f"{name}.png": png_bytes(of) for name, of in levels.items() if of is not None}


def _fill(pxr: Any, stage: Any, baked: Baked) -> None:
    """Add all parts to a stage, with its unit and its upward axis."""
    pxr.UsdGeom.SetStageUpAxis(stage, (baked.up or "y").upper())
    pxr.UsdGeom.SetStageMetersPerUnit(stage, METRES[baked.unit or "meter"])
    root = pxr.UsdGeom.Xform.Define(stage, "/scene")
    stage.SetDefaultPrim(root.GetPrim())
    root.AddTransformOp().Set(pxr.Gf.Matrix4d().SetTranslate(pxr.Gf.Vec3d(*baked.origin)))
    if baked.recipe is not None:
        stage.GetRootLayer().customLayerData = {"recipe": json.dumps(baked.recipe.record)}
    material = _material(pxr, stage, baked)
    for number, part in enumerate(baked.parts):
        name = f"{pxr.Tf.MakeValidIdentifier(part.name)}_{number}"
        mesh = _mesh(pxr, pxr.UsdGeom.Mesh.Define(stage, f"/scene/{name}"), part)
        pxr.UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def _mesh(pxr: Any, mesh: Any, part: Part) -> Any:
    """Fill a mesh with a part."""
    arrays, types = pxr.Vt, pxr.Sdf.ValueTypeNames
    mesh.GetPrim().SetDisplayName(part.name)
    mesh.CreatePointsAttr(arrays.Vec3fArray.FromNumpy(part.vertices))
    mesh.CreateFaceVertexCountsAttr([3] * len(part.faces))
    mesh.CreateFaceVertexIndicesAttr(arrays.IntArray.FromNumpy(part.faces.reshape(-1)))
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreateDoubleSidedAttr(True)
    mesh.CreateExtentAttr(
        arrays.Vec3fArray([tuple(map(float, f(axis=0))) for f in (part.vertices.min, part.vertices.max)])
    )
    mesh.CreateNormalsAttr(arrays.Vec3fArray.FromNumpy(part.normals))
    mesh.SetNormalsInterpolation("vertex")
    values: list[tuple[str, Any, Any]] = []
    if part.uv is not None:
        values.append(("st", types.TexCoord2fArray, arrays.Vec2fArray.FromNumpy(part.uv)))
    if part.colors is not None:
        linear = arrays.Vec3fArray.FromNumpy(part.colors.astype("f4"))
        values.append(("displayColor", types.Color3fArray, linear))
    kinds = {
        ("i", 1): (types.IntArray, arrays.IntArray),
        ("f", 1): (types.FloatArray, arrays.FloatArray),
        ("f", 2): (types.Float2Array, arrays.Vec2fArray),
    }
    for name, column in part.attributes.items():
        kind, make = kinds[column.dtype.kind, column.ndim]
        values.append((name, kind, make.FromNumpy(column)))
    primvars = pxr.UsdGeom.PrimvarsAPI(mesh)
    for name, kind, column in values:
        primvars.CreatePrimvar(name, kind, "vertex").Set(column)
    return mesh


def _material(pxr: Any, stage: Any, baked: Baked) -> Any:
    """Return the preview surface of all parts."""
    types = pxr.Sdf.ValueTypeNames
    material = pxr.UsdShade.Material.Define(stage, "/scene/baked")
    surface = pxr.UsdShade.Shader.Define(stage, "/scene/baked/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    surface.CreateInput("metallic", types.Float).Set(0.0)
    surface.CreateInput("roughness", types.Float).Set(ROUGHNESS)
    places = pxr.UsdShade.Shader.Define(stage, "/scene/baked/places")
    colored = baked.parts[0].colors is not None
    places.CreateIdAttr(f"UsdPrimvarReader_{'float3' if colored else 'float2'}")
    places.CreateInput("varname", types.String).Set("displayColor" if colored else "st")
    color = surface.CreateInput("diffuseColor", types.Color3f)
    if colored:
        color.ConnectToSource(places.ConnectableAPI(), "result")
    maps = baked.maps
    if maps is None:
        return material
    uses = [("color", maps.color, [("diffuseColor", types.Color3f, "rgb")])]
    if maps.normal is not None:
        uses.append(("normal", maps.normal, [("normal", types.Normal3f, "rgb")]))
    if maps.surface is not None:
        names = ("occlusion", "roughness", "metallic")
        channels = [(name, types.Float, channel) for name, channel in zip(names, "rgb", strict=True)]
        uses.append(("surface", maps.surface, channels))
    if maps.emission is not None:
        uses.append(("emission", maps.emission, [("emissiveColor", types.Color3f, "rgb")]))
    for name, _, inputs in uses:
        texture = pxr.UsdShade.Shader.Define(stage, f"/scene/baked/{name}")
        texture.CreateIdAttr("UsdUVTexture")
        texture.CreateInput("file", types.Asset).Set(f"{name}.png")
        texture.CreateInput("st", types.Float2).ConnectToSource(places.ConnectableAPI(), "result")
        space = "sRGB" if name in ("color", "emission") else "raw"
        texture.CreateInput("sourceColorSpace", types.Token).Set(space)
        for wrap in ("wrapS", "wrapT"):
            texture.CreateInput(wrap, types.Token).Set("clamp")
        if name == "normal":
            texture.CreateInput("scale", types.Float4).Set((2.0, 2.0, 2.0, 1.0))
            texture.CreateInput("bias", types.Float4).Set((-1.0, -1.0, -1.0, 0.0))
        for key, kind, channel in inputs:
            surface.CreateInput(key, kind).ConnectToSource(texture.ConnectableAPI(), channel)
    return material


if __name__ == "__main__":
    answer_once(lambda request: written(pickle.loads(request)))
