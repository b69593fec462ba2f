"""Fields of Lipschitz Pruning and of three-js-blobtree in float64, from what their files hold."""

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DEPTH = 20_000
"""Recursion that scenes of a thousand nested operators take."""


def lipschitz(scene: Any, points: Floats) -> Floats:
    """The distances (n,) of a scene of Lipschitz Pruning."""
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(max(DEPTH, before))
    try:
        return _distance(scene, points, np.eye(4))
    finally:
        sys.setrecursionlimit(before)


def _distance(node: Any, points: Floats, above: Floats) -> Floats:
    matrix = above @ np.array([*node["matrix"], 0, 0, 0, 1], np.float64).reshape(4, 4)
    if node["nodeType"] == "binaryOperator":
        a, b = (_distance(node[side], points, matrix) for side in ("leftChild", "rightChild"))
        sign, b = (1.0 if node["blendMode"] == "union" else -1.0), (-b if node["blendMode"] == "sub" else b)
        k = node["blendRadius"]
        round_off = np.maximum(k - np.abs(a - b), 0.0) ** 2 / (4.0 * k) if k else 0.0
        return np.asarray(sign * (np.minimum(sign * a, sign * b) - round_off))
    q = points @ matrix[:3, :3].T + matrix[:3, 3]
    across = np.hypot(q[:, 0], q[:, 2])
    match node["primitiveType"]:
        case "sphere":
            return np.asarray(np.linalg.norm(q, axis=1) - node["radius"])
        case "cylinder":
            return _corner(across - node["radius"], np.abs(q[:, 1]) - 0.5 * node["height"])
        case "cone":
            return _cone(across, q[:, 1], node["radius"], 0.5 * node["height"])
    x, height, z = np.array(node["sides"]) / 2.0
    right, front = q[:, 0] > 0.0, q[:, 2] > 0.0
    r = np.array(node["bevel"])[np.where(right, np.where(front, 0, 1), np.where(front, 2, 3))]
    flat = _corner(np.abs(q[:, 0]) - x + r, np.abs(q[:, 2]) - z + r) - r
    edge = np.where(q[:, 1] > 0.0, node["round_x"], node["round_y"])
    return np.asarray(_corner(flat + edge, np.abs(q[:, 1]) - height + edge) - edge)


def _corner(x: Floats, y: Floats) -> Floats:
    """The distance (n,) from a quadrant x ≤ 0, y ≤ 0."""
    return np.asarray(np.minimum(np.maximum(x, y), 0.0) + np.hypot(np.maximum(x, 0.0), np.maximum(y, 0.0)))


def _cone(across: Floats, along: Floats, radius: float, half: float) -> Floats:
    """The distance (n,) from a cone whose point is at the top."""
    p, e = np.stack([across - radius, along + half], axis=1), np.array([-radius, 2.0 * half])
    foot = p - e * np.clip(p @ e / (e @ e), 0.0, 1.0)[:, None]
    side = np.linalg.norm(foot, axis=1)
    outside = np.maximum(foot[:, 0], foot[:, 1]) > 0.0
    base = np.where(across <= radius, np.abs(p[:, 1]), np.inf)
    return np.asarray(np.where(outside, np.minimum(side, base), -np.minimum(side, p[:, 1])))


def three_js(node: Any, points: Floats) -> Floats:
    """The values (n,) of a tree of three-js-blobtree, 1 on the surface."""
    below = [three_js(child, points) for child in node.get("children", [])]
    match node["type"]:
        case "RootNode" | "RicciNode":
            n = node.get("ricci_n", 64.0)
            largest = np.max(below, axis=0)
            shares = np.divide(below, largest, out=np.zeros_like(below), where=largest > 0.0)
            return np.asarray(largest * (shares**n).sum(axis=0) ** (1.0 / n))
        case "MaxNode":
            return np.asarray(np.max(below, axis=0))
        case "MinNode":
            return np.asarray(np.min(below, axis=0))
        case "DifferenceNode":
            return np.maximum(below[0] - below[1], 0.0)
        case "ScaleNode":
            factors = np.array([node[f"scale_{axis}"] for axis in "xyz"])
            middle = np.mean(box(node["children"][0]), axis=0)
            return three_js(node["children"][-1], (points - middle) / factors + middle)
        case "TwistNode":
            return three_js(node["children"][-1], _untwisted(node, points))
        case "SDFRootNode":
            distance, scale = _signed(node["sdfRoot"], points), node["f"]["scale"]
            u = np.clip(distance / (2.0 * scale) + 0.5, 0.0, 1.0)
            return np.asarray((1.0 - u * u) ** 3 / 0.75**3)
    places = np.array([[vertex["position"][axis] for axis in "xyz"] for vertex in node["v"]])
    sizes = np.array([vertex["thickness"] for vertex in node["v"]])
    return np.asarray(node["density"] * _scalis(node, points, places, sizes))


def _scalis(node: Any, points: Floats, places: Floats, sizes: Floats) -> Floats:
    if node["type"] == "ScalisPoint":
        return _kernel(np.linalg.norm(points - places[0], axis=1) / sizes[0]) * (4.0 / 3.0) ** 3
    nearest = node["volType"] == "dist"
    if node["type"] == "ScalisTriangle":
        shares = _triangle_nodes(200) if nearest else _triangle_rule(200)
    else:
        t = np.linspace(0.0, 1.0, 4001) if nearest else (np.arange(4000) + 0.5) / 4000
        shares = np.column_stack([1.0 - t, t])
    found = []
    for q in points:
        skeleton, thick = shares @ places, shares @ sizes
        kernel = _kernel(np.linalg.norm(q - skeleton, axis=1) / thick)
        if nearest:
            found.append(kernel.max() * (4.0 / 3.0) ** 3)
        elif node["type"] == "ScalisSegment":
            length = np.linalg.norm(places[1] - places[0])
            line = 2.0 * 16.0 / 35.0 * 2.0 * 0.75**3.5  # the kernel along a line at the thickness
            found.append((kernel / thick).mean() * length / line)
        else:
            area = 0.5 * np.linalg.norm(np.cross(places[1] - places[0], places[2] - places[0]))
            sheet = 0.25 * np.pi * 4.0 * 0.75**4
            found.append((kernel / thick**2).mean() * area / sheet)
    return np.array(found)


def _kernel(r: Floats) -> Floats:
    return np.asarray(np.maximum(1.0 - r * r / 4.0, 0.0) ** 3)


def _triangle_nodes(count: int) -> Floats:
    """Barycentric coordinates (n, 3) of the corners of equal parts of a triangle."""
    i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
    a, b = i[i + j <= count] / count, j[i + j <= count] / count
    return np.column_stack([1.0 - a - b, a, b])


def _triangle_rule(count: int) -> Floats:
    """Barycentric coordinates (n, 3) of the middles of equal parts of a triangle."""
    i, j = np.meshgrid(np.arange(count), np.arange(count), indexing="ij")
    up, down = i + j < count, i + j < count - 1
    a = np.concatenate([(i[up] + 1.0 / 3.0), (i[down] + 2.0 / 3.0)]) / count
    b = np.concatenate([(j[up] + 1.0 / 3.0), (j[down] + 2.0 / 3.0)]) / count
    return np.column_stack([1.0 - a - b, a, b])


def _untwisted(node: Any, points: Floats) -> Floats:
    """The points at which the child of a twist is read: turned around the y axis of its frame."""
    axis = np.array([node[f"axis_{name}"] for name in "xyz"])
    turn = _turn(np.cross(axis, (0.0, 1.0, 0.0)), np.arccos(np.clip(axis[1], -1.0, 1.0)))
    middle = np.mean(box(node["children"][0]), axis=0)
    x, y, z = ((points - middle) @ turn.T).T
    c, s = np.cos(node["twist_amout"] * y), np.sin(node["twist_amout"] * y)
    return np.asarray(np.stack([c * x - s * z, y, s * x + c * z], axis=1) @ turn + middle)


def _turn(axis: Floats, angle: float) -> Floats:
    """The rotation (3, 3) around an axis of any length."""
    if not np.linalg.norm(axis) > 1e-9:
        return np.eye(3)
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


def _signed(node: Any, points: Floats) -> Floats:
    if node["type"] == "SDFNode":
        return _signed(node["children"][0], points)
    if node["type"] == "SDFSphere":
        return np.asarray(np.linalg.norm(points - [node["p"][axis] for axis in "xyz"], axis=1) - node["r"])
    start, end = (np.array([node[name][axis] for axis in "xyz"]) for name in ("p1", "p2"))
    t = np.linspace(0.0, 1.0, 4001)[:, None]
    centers, radii = start + t * (end - start), node["r1"] + t[:, 0] * (node["r2"] - node["r1"])
    return np.array([(np.linalg.norm(q - centers, axis=1) - radii).min() for q in points])


def box(node: Any) -> Floats:
    """The corners (2, 3) of the box of a Scalis primitive."""
    places = np.array([[vertex["position"][axis] for axis in "xyz"] for vertex in node["v"]])
    reach = 2.0 * np.array([[vertex["thickness"]] for vertex in node["v"]])
    return np.array([(places - reach).min(axis=0), (places + reach).max(axis=0)])
