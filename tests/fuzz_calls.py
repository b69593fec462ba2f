"""Public functions by name, each with arguments that it accepts: what the fuzzer of calls starts from."""

from collections.abc import Callable
from contextlib import nullcontext, suppress
from enum import Enum
from functools import partial
from typing import Any

import numpy as np
import pyvista as pv

import blobtree
import decals
from blobtree import Node, Point, custom, sampling, tracing
from blobtree.declare.parameters import fields_of
from blobtree.nodes.kinds import NODE_KINDS
from blobtree.nodes.paths import primitive_paths
from blobtree.progress import reporting
from decals import editing, rendering, scattering
from decals.editing import EditSession
from decals.images import image_pixels
from decals.index import DecalIndex
from decals.rendering import RenderOptions
from decals.scenes.objects import bounds_of
from decals.surfaces import as_surface
from tests.conformance import sample
from tests.decals.editing.scenes import scene

Calls = dict[str, tuple[Callable[..., object], dict[str, Any]]]


def _report(progress: Any, cancel: Any) -> None:
    """Report once; an exception of the caller's own function is the caller's."""
    odd_function = callable(progress) or callable(cancel)
    with suppress(TypeError) if odd_function else nullcontext(), reporting(progress, cancel) as report:
        report("finding", 0.0)


UNCALLED = {
    "Actions", "AreaGradient", "BatchHits", "BoxedField", "Cancel", "ContactLaw", "ContactSurface",
    "Curvatures", "CustomCombination", "CustomField", "CustomPrimitive", "CustomWarp", "Document",
    "EditSession", "Falloff", "FieldGrid", "FieldPrimitive", "Fit", "Hits", "Node", "NumericParameter",
    "Operator", "ParameterGradient", "PointerTools", "Primitive", "Progress", "SignedDistances",
    "SurfaceLine", "Tape", "UndoEntry", "Warp", "edit", "show",
}  # fmt: skip
"""Types that users only get from functions, extend, or start for a whole session; and windows."""


def not_called() -> list[str]:
    """Return the public functions and classes for which the table has no arguments."""
    called = {name.split()[0] for name in call_table()} | UNCALLED
    missing = []
    for module in (blobtree, custom, sampling, tracing, decals, editing):
        for name in set(module.__all__) - called:
            value = getattr(module, name)
            if callable(value) and not (isinstance(value, type) and issubclass(value, Exception | Enum)):
                missing.append(name)
    return sorted(missing)


def _allowing_os_errors(function: Callable[..., object]) -> Callable[..., object]:
    """Return a function without the errors of the system that it documents."""

    def call(**arguments: Any) -> None:
        with suppress(OSError):
            function(**arguments)

    return call


def call_table() -> Calls:
    """Return functions by name, each with arguments that it accepts."""
    tree = Point((0, 0, 0), radius=1.0)
    whole = scene(8)
    spots = whole.decals
    number, path = next(
        (number, primitive_paths(item.tree)[0])
        for number, item in enumerate(whole.objects)
        if isinstance(item, decals.TreeObject)
    )
    triangle = ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    mesh, implicit = as_surface(triangle), as_surface(tree)
    item = decals.TreeObject("ball", tree)
    camera = decals.Camera((0, 0, 4), (0, 0, 0))
    origin, axis = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    points, directions = [[0.0, 0.0, 2.0]], [[0.0, 0.0, -1.0]]
    pixels = np.zeros((2, 2, 4), np.uint8)
    stud = decals.DecalMaterial("stud", pixels, height=pixels, relief=0.5)
    raised = whole.replace(images=[stud] * len(whole.images))
    poses = {one.name: one.vertices for one in whole.objects if isinstance(one, decals.MeshObject)}
    document, numbers = EditSession(whole).document, blobtree.numeric_parameters(tree)
    rated = Point((0, 0, 0), radius=1.0, attributes={"wetness": 1.0})
    ball = pv.Sphere(theta_resolution=6, phi_resolution=6)
    covered = decals.cover(tree, count=3, images=["scale"])
    table: Calls = {
        "scale": (tree.scale, {"factor": 2.0}),
        "rotate": (tree.rotate, {"axis": axis, "degrees": 30.0}),
        "translate": (tree.translate, {"offset": axis}),
        "transform": (tree.transform, {"matrix": np.eye(4)}),
        "from_json": (blobtree.from_json, {"text": blobtree.to_json(tree)}),
        "to_json": (blobtree.to_json, {"root": tree}),
        "polygonize": (blobtree.polygonize, {"tree": tree, "resolution": 8, "device": "cpu"}),
        "polygonize_batch": (
            blobtree.polygonize_batch,
            {"trees": [tree, tree], "resolution": 8, "cell_size": None, "device": "cpu"},
        ),
        "raycast_batch": (
            blobtree.raycast_batch,
            {"trees": [tree, tree], "origins": points, "directions": directions, "device": "cpu"},
        ),
        "polygonize by size": (blobtree.polygonize, {"tree": tree, "cell_size": 0.5}),
        "Decals": (
            decals.Decals,
            {
                "positions": spots.positions,
                "normals": spots.normals,
                "tangents": spots.tangents,
                "radii": spots.radii,
                "images": spots.images,
                "tints": spots.tints,
                "opacities": spots.opacities,
                "layers": spots.layers,
                "interactions": spots.interactions,
                "spill": spots.spill,
                "receivers": "ball",
                "fade_angles": 90.0,
                "fade_depths": 0.5,
            },
        ),
        "rows": (lambda rows: spots[rows], {"rows": [0, 1]}),
        "index": (DecalIndex.build, {"positions": spots.positions, "influence": spots.influence}),
        "index of": (DecalIndex.of, {"decals": spots}),
        "evaluate": (decals.evaluate, {"decals": spots, "points": points, "normals": directions}),
        "evaluate_batch": (
            decals.evaluate_batch,
            {"sets": [spots, spots[:1]], "points": points, "normals": directions},
        ),
        "bounds_of": (bounds_of, {"objects": [item]}),
        "Camera": (decals.Camera, {"position": (0, 0, 4), "target": origin, "up": (0, 1, 0), "fov": 30}),
        "framing": (decals.Camera.framing, {"bounds": item.bounds, "direction": axis, "aspect": 1.0}),
        "fitting": (decals.Camera.fitting, {"points": points, "direction": axis, "margin": 1.0}),
        "MeshObject": (
            decals.MeshObject,
            {
                "name": "a",
                "vertices": triangle[0],
                "faces": triangle[1],
                "color": (1, 1, 1),
                "source": "a",
                "origin": axis,
            },
        ),
        "TreeObject": (decals.TreeObject, {"name": "a", "tree": tree}),
        "DecalImage": (decals.DecalImage, {"source": "a", "pixels": pixels}),
        "DecalMaterial": (
            decals.DecalMaterial,
            {
                "source": "a",
                "pixels": pixels,
                "normal": pixels,
                "roughness": 0.5,
                "metallic": pixels,
                "occlusion": 1.0,
                "emission": pixels,
                "height": pixels,
                "relief": 0.5,
            },
        ),
        "Scene": (
            decals.Scene,
            {"objects": (item,), "camera": camera, "decals": spots[:0], "images": ()},
        ),
        "as_surface": (as_surface, {"model": triangle}),
        "cover": (
            lambda models, **rest: decals.cover(models, **rest),
            {"models": tree, "count": 3, "images": ["scale"], "seed": 0},
        ),
        "scatter": (decals.scatter, {"surfaces": [mesh], "count": 3, "factor": 1.0, "seed": 0}),
        "load_image": (decals.load_image, {"reference": "scale"}),
        "load_model": (decals.load_model, {"path": "x.ply"}),
        "load_scene": (decals.load_scene, {"path": "x.json"}),
        "polygonize adaptively": (
            blobtree.polygonize,
            {"tree": tree, "resolution": 8, "adaptive": True, "creases": False, "max_triangles": 100_000},
        ),
        "polygonize to an error": (
            blobtree.polygonize,
            {"tree": tree, "chord_error": 0.1, "adaptive": True},
        ),
        "reporting": (_report, {"progress": None, "cancel": None}),
        "gradient of a blend": (
            blobtree.GradientBlend((tree, tree.rotate(axis, 9)), start_angle=30.0, full_angle=90.0).gradient,
            {"points": points},
        ),
        "sample": (blobtree.sample, {"tree": tree, "spacing": 0.25, "width": None, "color": (1, 1, 1)}),
        "to_sdf": (blobtree.to_sdf, {"tree": tree, "points": points}),
        "hessian": (tree.hessian, {"points": points}),
        "elastic": (
            decals.evaluate,
            {
                "decals": spots,
                "points": points,
                "normals": directions,
                "contact": "elastic",
                "stiffness": 4.0,
            },
        ),
        "RenderOptions": (
            RenderOptions,
            {"size": (8, 8), "samples": 1, "contact": "elastic", "stiffness": 4.0, "mapping": "chord"},
        ),
        "measure": (
            decals.measure,
            {
                "scene": whole,
                "contact": "elastic",
                "stiffness": 4.0,
                "mapping": "chord",
                "samples": 20,
                "seed": 0,
            },
        ),
        "pose": (
            decals.pose,
            {"scene": whole, "poses": poses, "rigid": True, "camera": None},
        ),
        "skin": (
            decals.skin,
            {"vertices": [origin, axis], "weights": [[1, 0], [0.5, 0.5]], "transforms": [np.eye(4)] * 2},
        ),
        "define_contact": (
            decals.define_contact,
            {"field": "wyvill", "law": None, "combine": "product", "name": None},
        ),
        "render": (
            decals.render,
            {
                "scene": whole,
                "size": (8, 6),
                "samples": 1,
                "contact": "elastic",
                "stiffness": 4.0,
                "mapping": "chord",
                "background": rendering.STUDIO,
                "lights": None,
                "viewpoint": None,
            },
        ),
        "turntable": (decals.turntable, {"scene": whole, "count": 3, "turns": 1.0}),
        "animate": (
            decals.animate,
            {"frames": [whole], "path": "a.gif", "size": (8, 6), "rate": 25.0, "samples": 1, "count": 1},
        ),
        "bake": (
            decals.bake,
            {
                "scene": triangle,
                "path": "a.glb",
                "size": 16,
                "samples": 1,
                "vertex_colors": True,
                "creases": False,
            },
        ),
        "export": (
            decals.export,
            {
                "scene": triangle,
                "path": "a.ply",
                "colors": "vertices",
                "attributes": ["owner", "uv"],
                "instances": False,
                "unit": "inch",
                "up": "z",
                "size": 16,
                "samples": 1,
                "creases": False,
            },
        ),
        "content_hash": (blobtree.content_hash, {"value": tree}),
        "Outline": (blobtree.Outline, {"path": "M0 0H4V3H0Z"}),
        "Outline.polygon": (blobtree.Outline.polygon, {"points": [(0, 0), (2, 0), (0, 1)]}),
        "Outline.arcs": (blobtree.Outline.arcs, {"points": [(0, 0), (2, 0)], "bulges": 1.0}),
        "Outline.spline": (blobtree.Outline.spline, {"points": [(1, 0), (0, 1), (-1, 0)]}),
        "Outline.svg": (
            blobtree.Outline.svg,
            {"drawing": '<svg><rect width="2" height="1"/></svg>', "rule": "evenodd"},
        ),
        "Outline.__or__": (
            lambda one, other: blobtree.Outline(one) | blobtree.Outline(other),
            {"one": "M0 0H2V2H0Z", "other": "M1 1H3V3H1Z"},
        ),
        "Outline.text": (blobtree.Outline.text, {"text": "ab", "size": 2.0}),
        "reproduce": (decals.reproduce, {"scene": covered}),
        "save_html": (
            decals.save_html,
            {
                "scene": whole,
                "path": "a.html",
                "title": "a",
                "alt": "b",
                "controls": True,
                "background": "white",
                "surface": "mesh",
                "resolution": 8,
                "contact": "elastic",
                "stiffness": 4.0,
                "mapping": "chord",
            },
        ),
        "shader": (
            decals.shader,
            {
                "scene": whole,
                "version": "330 core",
                "stage": "fragment",
                "prefix": "decal_",
                "contact": "elastic",
                "stiffness": 4.0,
                "mapping": "chord",
                "editable": False,
            },
        ),
        "field_grid": (
            blobtree.field_grid,
            {"tree": tree, "resolution": 6, "spacing": None, "distance": True},
        ),
        "area_gradient": (
            decals.area_gradient,
            {"scene": whole, "weights": None, "contact": "elastic", "step": 0.2},
        ),
        "outlines": (
            lambda **arguments: list(decals.outlines(**arguments)),
            {"scene": whole, "contact": "elastic", "stiffness": 4.0, "mapping": "chord", "step": 0.2},
        ),
        "save_figure": (
            decals.save_figure,
            {
                "scene": whole,
                "path": "a.svg",
                "size": (90.0, 60.0),
                "widths": None,
                "picture": False,
                "camera": camera,
                "contact": "elastic",
                "stiffness": 4.0,
                "mapping": "chord",
                "step": 0.2,
            },
        ),
        "render_batch": (
            lambda **arguments: list(decals.render_batch(**arguments)),
            {
                "scenes": [whole],
                "viewpoints": None,
                "size": (8, 6),
                "samples": 1,
                "contact": "elastic",
                "stiffness": 4.0,
                "mapping": "chord",
                "background": "white",
                "lights": None,
                "filtered": None,
                "environment": None,
            },
        ),
        "save_table": (
            decals.save_table,
            {"decals": spots, "path": "a.csv", "images": whole.images, "origin": origin},
        ),
        "load_table": (decals.load_table, {"path": "a.csv", "origin": origin, "trust": False}),
        "from_table": (decals.from_table, {"table": decals.to_pandas(spots)}),
        "to_arrow": (decals.to_arrow, {"decals": spots}),
        "to_pandas": (decals.to_pandas, {"decals": spots}),
        "check_kind": (
            partial(blobtree.check_kind, show=None),
            {"kind": Point, "oracle": None, "samples": 1, "seed": 0, "compiled": False},
        ),
        "formula": (blobtree.formula, {"function": None}),
        "displace": (
            decals.displace,
            {
                "scene": raised,
                "edge_length": 0.2,
                "contact": "elastic",
                "stiffness": 4.0,
                "mapping": "chord",
                "resolution": 8,
                "creases": False,
            },
        ),
        "save_scene": (decals.save_scene, {"scene": whole, "path": "a.json"}),
        "save": (_allowing_os_errors(blobtree.save), {"root": tree, "path": "b.json"}),
        "load": (_allowing_os_errors(blobtree.load), {"path": "b.json"}),
        "replace": (
            whole.replace,
            {"objects": (item,), "camera": camera, "decals": spots[:0], "images": ()},
        ),
        "replace decals": (
            spots.replace,
            {"radii": spots.radii, "layers": spots.layers, "tints": spots.tints, "images": spots.images},
        ),
        "concatenate": (lambda parts: decals.Decals.concatenate(parts), {"parts": [spots, spots]}),
        "image_pixels": (lambda image: image_pixels(image), {"image": pixels}),
        "scatter by spacing": (
            decals.scatter,
            {
                "surfaces": tree,
                "spacing": 1.0,
                "density": None,
                "mask": None,
                "fixed": points,
                "regularity": 0.5,
                "sizing": "covering",
                "direction": axis,
                "images": 2,
                "weights": [1.0, 2.0],
                "choice": "random",
                "jitter": None,
                "device": "cpu",
            },
        ),
        "Jitter": (scattering.Jitter, {"position": 0.1, "size": 0.1, "angle": 10.0}),
        "Planar": (scattering.Planar, {"origin": origin, "right": (1, 0, 0), "up": (0, 1, 0)}),
        "Cylindrical": (scattering.Cylindrical, {"base": origin, "top": axis, "front": (1, 0, 0)}),
        "Spherical": (scattering.Spherical, {"center": origin, "up": axis, "front": (1, 0, 0)}),
        "TextureCoordinates": (
            scattering.TextureCoordinates,
            {"surface": mesh, "uv": [[0, 0], [1, 0], [0, 1]]},
        ),
        "PaintedImage": (
            scattering.PaintedImage,
            {"image": pixels, "projection": scattering.Planar(origin, (1, 0, 0), (0, 1, 0)), "repeat": False},
        ),
        "Creases": (scattering.Creases, {"surface": mesh, "angle": 30.0, "boundary": True}),
        "Zone": (
            scattering.Zone,
            {
                "where": [True],
                "density": 2.0,
                "factor": 1.0,
                "direction": axis,
                "images": [1, 2],
                "weights": [1.0, 2.0],
                "choice": "random",
            },
        ),
        "scatter in zones": (
            lambda where, width: decals.scatter(
                mesh, count=3, zones=scattering.Zones(scattering.Zone(where), border_width=width)
            ),
            {"where": [True], "width": 0.1},
        ),
        "region_mask": (scattering.region_mask, {"surface": mesh, "flags": [True]}),
        "vertex_density": (
            scattering.vertex_density,
            {"vertices": triangle[0], "values": [1.0, 2.0, 3.0]},
        ),
        "Relaxation": (
            lambda surfaces, **rest: decals.Relaxation(surfaces, **rest).step(),
            {"surfaces": mesh, "count": 3, "seed": 0, "iterations": 2, "fixed": points},
        ),
        "insert": (
            lambda **rest: decals.Relaxation(mesh, count=3, iterations=1).insert(**rest),
            {"point": origin, "fixed": True},
        ),
        "remove": (
            lambda **rest: decals.Relaxation(mesh, count=3, iterations=1).remove(**rest),
            {"number": 0},
        ),
        "polish": (
            lambda **rest: decals.Relaxation(mesh, count=3, iterations=1).polish(**rest),
            {"rounds": 1, "close": 0.8},
        ),
        "to_decals": (
            lambda **rest: decals.Relaxation(mesh, count=3, iterations=1).to_decals(**rest),
            {
                "seed": 0,
                "sizing": "covering",
                "factor": 1.0,
                "direction": axis,
                "images": 2,
                "weights": [1.0, 2.0],
            },
        ),
        "Light": (
            rendering.Light,
            {
                "color": (1, 1, 1),
                "direction": axis,
                "position": axis,
                "attenuation": (1, 0, 0),
                "cone": 30.0,
                "exponent": 1.0,
            },
        ),
        "Lighting": (rendering.Lighting, {"lights": ()}),
        "Environment": (
            rendering.Environment,
            {"picture": np.ones((2, 4, 3)), "rotation": 5.0, "strength": 1.0, "visible": True, "up": axis},
        ),
        "Background": (rendering.Background, {"top": (1, 1, 1), "bottom": (0, 0, 0, 1)}),
        "pick": (
            editing.pick,
            {"document": document, "origin": (0, 0, 9), "direction": (0, 0, -1), "contact": "elastic"},
        ),
        "outline": (
            editing.outline,
            {"document": document, "number": 0, "contact": "elastic", "mapping": "chord"},
        ),
        "nearest_points": (editing.nearest_points, {"objects": whole.objects, "points": points}),
        "first_hit": (
            editing.first_hit,
            {"objects": whole.objects, "origin": (0, 0, 9), "direction": (0, 0, -1)},
        ),
        "recovery_path": (lambda path: editing.recovery_path(path), {"path": "a.json"}),
        "fit": (
            blobtree.fit,
            {
                "tree": tree,
                "points": points * 4,
                "values": [0.5] * 4,
                "normals": directions * 4,
                "fixed": None,
                "normal_weight": 0.1,
                "max_evaluations": 2,
            },
        ),
        "from_mesh": (
            blobtree.from_mesh,
            {"mesh": ball, "cell_size": 0.3, "radius": 0.3, "width": 0.3, "color": (1, 1, 1)},
        ),
        "from_sdf": (
            blobtree.from_sdf,
            {
                "distances": np.arange(-5.0, 22.0).reshape(3, 3, 3),
                "lower": origin,
                "spacing": 0.5,
                "width": 0.5,
                "color": (1, 1, 1),
            },
        ),
        "Mesh": (
            blobtree.Mesh,
            {"vertices": triangle[0], "faces": triangle[1], "normals": triangle[0], "colors": triangle[0]},
        ),
        "numeric_parameters": (blobtree.numeric_parameters, {"tree": tree}),
        "numeric_values": (blobtree.numeric_values, {"tree": tree, "parameters": numbers}),
        "with_numeric_values": (
            blobtree.with_numeric_values,
            {"tree": tree, "parameters": numbers, "values": [0.0, 0.0, 0.0, 2.0]},
        ),
        "split_creases": (
            blobtree.split_creases,
            {"tree": tree, "mesh": blobtree.polygonize(tree, resolution=8)},
        ),
        "Polygonizer": (
            blobtree.Polygonizer,
            {"tree": tree, "resolution": 8, "cell_size": None, "creases": False, "device": "cpu"},
        ),
        "define_falloff": (custom.define_falloff, {"value": None, "slope": None, "name": "odd"}),
        "define_skeleton": (
            custom.define_skeleton,
            {"function": None, "convex": False, "name": "odd", "limits": None},
        ),
        "define_operator": (
            custom.define_operator,
            {"function": None, "like": "blend", "name": "odd", "limits": None},
        ),
        "define_warp": (
            custom.define_warp,
            {"forward": None, "stretch": None, "box": None, "extent": 1.0, "name": "odd"},
        ),
        "define_field": (
            custom.define_field,
            {"function": None, "steepest": None, "extent": 1.0, "name": "odd"},
        ),
        "field": (lambda points: tree(points), {"points": points}),
        "gradient": (tree.gradient, {"points": points}),
        "curvatures": (tree.curvatures, {"points": points}),
        "colors": (tree.colors, {"points": points}),
        "rest_coordinates": (tree.rest_coordinates, {"points": points}),
        "attribute": (rated.attribute, {"name": "wetness", "points": points, "default": 0.0}),
        "interval": (tree.interval, {"lower": origin, "upper": axis}),
        "raycast": (tree.raycast, {"origins": points, "directions": directions, "device": "cpu"}),
        "parameter_gradient": (tree.parameter_gradient, {"points": points, "parameters": numbers}),
        "slice": (tree.slice, {"origin": origin, "normal": axis, "resolution": 8, "values": (0.5,)}),
        "to_pyvista": (
            rated.to_pyvista,
            {
                "resolution": 8,
                "adaptive": False,
                "creases": False,
                "split_normals": False,
                "attributes": ("wetness",),
                "rest_coordinates": True,
            },
        ),
        "offset": (tree.offset, {"distance": 0.1}),
        "twist": (tree.twist, {"degrees": 9.0, "limits": (0.0, 1.0)}),
        "bend": (tree.bend, {"degrees": 9.0, "limits": (0.0, 1.0)}),
        "taper": (tree.taper, {"factor": 0.9, "limits": (0.0, 1.0)}),
        "stretch": (tree.stretch, {"factor": 0.9, "limits": (0.0, 1.0)}),
        "shear": (tree.shear, {"slope_x": 0.1, "slope_y": 0.1, "limits": (0.0, 1.0)}),
        "noise_warp": (tree.noise_warp, {"amplitude": 0.1, "wavelength": 1.0, "seed": 0}),
        "curve_warp": (
            tree.curve_warp,
            {"source": [origin, axis], "target": [origin, (0.1, 0.0, 1.0)], "reach": 1.0},
        ),
    }
    for name, surface in (("mesh", mesh), ("tree", implicit)):
        table |= {
            f"{name} project": (surface.project, {"points": points}),
            f"{name} normal": (surface.normal, {"points": points}),
            f"{name} contains": (surface.contains, {"points": points}),
            f"{name} raycast": (surface.raycast, {"origins": points, "directions": directions}),
            f"{name} sample": (surface.sample, {"count": 3, "seed": 0}),
            f"{name} on": (getattr(surface, "on"), {"device": "cpu"}),  # noqa: B009 - not of the protocol
        }
    return table | _classes(tree) | _commands(whole, number, path)


def _classes(tree: Node) -> Calls:
    """Return all classes of nodes, each with the values of a sample; the tape follows from them."""
    rng = np.random.default_rng(0)

    def maker(kind: Any) -> Callable[..., object]:
        def make(**values: Any) -> object:
            node = kind(**values)
            return node.tape, node.support, repr(node)

        return make

    table: Calls = {}
    for kind in NODE_KINDS.values():
        node = sample(kind, rng)
        values = {field.name: getattr(node, field.name) for field in fields_of(kind)}
        table[kind.__name__] = maker(kind), values
    table["BlendGraph"] = (
        lambda operands, **rest: blobtree.BlendGraph(operands, **rest).tape,
        {"operands": (tree, tree), "names": ("a", "b"), "pairs": (("a", "b"),)},
    )
    return table


def _commands(whole: decals.Scene, number: int, path: tuple[int, ...]) -> Calls:
    """Return all commands of the editor."""
    point, normal = whole.decals.positions[0], whole.decals.normals[0]
    tree = Point((0, 0, 0), radius=1.0)
    node = {"object": number, "path": path}
    arguments: dict[str, dict[str, Any]] = {
        "AddDecals": {"decals": whole.decals[:1]},
        "AddImage": {"image": whole.images[0]},
        "AddObject": {"object": decals.TreeObject("more", tree)},
        "AddPrimitive": {**node, "node": tree, "join": "union"},
        "BrushDecals": {
            "point": point,
            "normal": normal,
            "radius": 0.2,
            "decal_radius": 0.1,
            "density": 1.0,
            "images": (0,),
            "seed": 0,
        },
        "DeleteDecals": {"numbers": [0]},
        "DuplicateDecals": {"numbers": [0]},
        "DuplicatePrimitive": {**node, "offset": (1.0, 0.0, 0.0)},
        "JoinPrimitive": {**node, "join": "union"},
        "DragSurface": {**node, "start": (1.0, 0.0, 0.0), "end": (1.1, 0.0, 0.0), "quick": False},
        "TransformPrimitive": {**node, "matrix": np.eye(4), "quick": False},
        "MirrorPrimitive": {**node, "axis": 0},
        "FlagNodes": {"hidden": {0: ((1,),)}, "locked": {}, "label": "hide"},
        "HideDecals": {"numbers": [0]},
        "ShowDecals": {"layers": None},
        "LockLayers": {"layers": (0,)},
        "GroupOperands": {"object": 0, "path": (), "steps": (0, 1)},
        "MapValues": {"numbers": [0], "name": "opacities", "function": lambda spots: spots.opacities},
        "MoveBranch": {**node, "target": ()},
        "MoveDecals": {"numbers": [0], "position": point, "normal": normal},
        "MovePrimitive": {**node, "offset": (0.1, 0.0, 0.0), "quick": False},
        "MoveToObject": {**node, "into": 1, "target": (), "label": "move"},
        "OrderDecals": {"numbers": [0], "front": True},
        "PaintPrimitive": {**node, "color": (1, 1, 1)},
        "PushDecals": {"point": point, "offset": (0.1, 0.0, 0.0), "radius": 0.3},
        "FillBarePlaces": {"objects": (0,), "seed": 0},
        "RelaxDecals": {"point": point, "radius": 0.3},
        "RemoveImage": {"number": 0},
        "RemoveObject": {"number": 0},
        "RemovePrimitive": node,
        "RenameLayer": {"layer": 0, "name": "other"},
        "RenameNode": {**node, "name": "other"},
        "RenameObject": {"number": 0, "name": "other"},
        "ReplaceDecals": {"objects": (0,), "decals": whole.decals[:2]},
        "ReplaceImage": {"number": 0, "image": whole.images[0]},
        "ReplaceNode": {**node, "node": tree},
        "ReplaceScene": {"scene": whole, "label": "other"},
        "ResizePrimitive": {**node, "factor": 1.1},
        "ScaleDecals": {"numbers": [0], "factor": 1.1},
        "ScatterDecals": {"objects": (0,), "count": 3, "seed": 0, "options": {"factor": 0.5}},
        "SetCamera": {"camera": whole.camera},
        "SetDrawing": {"drawing": whole.drawing, "label": "other"},
        "SetParameter": {**node, "name": "radius", "value": 0.9, "quick": False},
        "SetValues": {"numbers": [0], "values": {"layers": 1}},
        "TurnDecals": {"numbers": [0], "degrees": 10.0},
    }

    def doer(name: str, scene: decals.Scene) -> Callable[..., object]:
        return lambda **values: EditSession(scene).do(getattr(editing, name)(**values))

    row = decals.cover(blobtree.Repeat(tree, (4, 0, 0), 2), count=2, images=["eye"])
    on_row = {"ScatterOnCopies": (doer("ScatterOnCopies", row), arguments["ScatterDecals"])}
    return {name: (doer(name, whole), values) for name, values in arguments.items()} | on_row
