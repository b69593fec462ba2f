"""Small files of other programs, made at random: scenes of Lipschitz Pruning, three-js-blobtree, archives."""

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from blobtree.foreign.programs import ORDERED

Rng = np.random.Generator
Values = dict[str, Any]


def lipschitz_scene(rng: Rng, primitives: int, blend: float = 0.1) -> Values:
    """A scene of primitives that operators join, each with a rotation and a way."""
    node = _primitive(rng)
    for _ in range(primitives - 1):
        pair = [node, _primitive(rng)]
        node = {
            "nodeType": "binaryOperator",
            "blendMode": str(rng.choice(["union", "union", "sub", "inter"])),
            "blendRadius": float(rng.choice([0.0, blend])),
            "matrix": _matrix(rng, 0.1),
            **dict(zip(("leftChild", "rightChild"), pair, strict=True)),
        }
    return {"aabb_min": [-2, -2, -2], "aabb_max": [2, 2, 2], **node}


def _matrix(rng: Rng, way: float) -> list[float]:
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return [float(x) for x in np.column_stack([turn, rng.uniform(-way, way, 3)]).ravel()]


def _primitive(rng: Rng) -> Values:
    kind = str(rng.choice(["sphere", "box", "cylinder", "cone"]))
    lengths: Values = {"radius": float(rng.uniform(0.3, 0.6)), "height": float(rng.uniform(0.6, 1.2))}
    edge = float(rng.choice([0.0, 0.1]))
    if kind == "box":
        bevel = rng.uniform(0.1, 0.25, 4) if edge or rng.random() < 0.5 else np.zeros(4)
        lengths = {"sides": rng.uniform(0.6, 1.2, 3).tolist(), "bevel": bevel.tolist()}
    shape = {"nodeType": "primitive", "primitiveType": kind, "matrix": _matrix(rng, 0.5)}
    rounds = {"round_x": edge, "round_y": edge, "color": rng.random(3).tolist()}
    return {**shape, **lengths, **rounds}


def scalis(rng: Rng, kind: str, volume: str = "dist", *, even: bool = False) -> Values:
    """A Scalis primitive of three-js-blobtree."""
    count = {"ScalisPoint": 1, "ScalisSegment": 2, "ScalisTriangle": 3}[kind]
    sizes = np.full(count, rng.uniform(0.3, 0.6)) if even else rng.uniform(0.3, 0.6, count)
    places = rng.uniform(-1.0, 1.0, (count, 3))
    vertices = [
        {"position": dict(zip("xyz", place.tolist(), strict=True)), "thickness": float(size)}
        for place, size in zip(places, sizes, strict=True)
    ]
    material = {"color": "#8040c0", "roughness": 0, "metalness": 0}
    return {"type": kind, "v": vertices, "volType": volume, "density": 1.0, "materials": [material] * count}


def distance_root(rng: Rng, r1: float, r2: float) -> Values:
    """A capsule by its signed distance, a ball if both radii are equal."""
    p1, p2 = (dict(zip("xyz", place.tolist(), strict=True)) for place in rng.uniform(-0.8, 0.8, (2, 3)))
    capsule: Values = {"type": "SDFCapsule", "p1": p1, "p2": p2, "r1": r1, "r2": r2}
    shape: Values = {"type": "SDFSphere", "p": p1, "r": r1} if r1 == r2 else capsule
    functor = {"type": "Poly6DistanceFunctor", "scale": 0.4}
    materials = [{"color": "#aaaaaa"}]
    return {"type": "SDFRootNode", "f": functor, "sdfRoot": shape, "materials": materials}


def root(*children: Values, **fields: Any) -> Values:
    """The root of a tree of three-js-blobtree."""
    return {"type": "RootNode", "iso": 1.0, "children": list(children), **fields}


def archive(lines: Sequence[str], operations: Sequence[str] = ORDERED) -> bytes:
    """An archive of libfive with one shape."""
    codes, content = {name: code for code, name in enumerate(operations, 1)}, b'T"a \\" name"""'
    places: dict[str, int] = {}
    for line in lines:
        name, operation, *operands = line.split()
        content += bytes([codes[operation]])
        if operation == "const":
            content += struct.pack("<f", float(operands[0]))
        else:
            content += struct.pack(f"<{len(operands)}I", *(places[operand] for operand in reversed(operands)))
        places[name] = len(places)
    return content + b"\xff\xff"
