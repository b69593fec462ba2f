"""Decals in VTK's own shaders: the same owners and places in images as our renderer finds, VTK's light."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import pyvista as pv

from decals import Camera, Contact, Decals, ImageMapping, Scene
from decals.editing import Document
from decals.errors import InvalidScene
from decals.rendering import Buffers, Drawing, RenderOptions
from decals.surfaces.normals import CREASE_ANGLE
from decals.vtk import injection
from tests.decals.rendering.pictures import in_layers, scattered
from tests.decals.vtk.conftest import Factory, Plotter
from tests.decals.vtk.scenes import mesh_object, shot
from tests.oracles.raster import edges

SIZE = (160, 120)
UV_STEPS = 4096.0

OWNER = f"""
  vec3 n = normalize({injection.NORMAL});
  float field;
  vec2 uv;
  int number = decal_owner({injection.POSITION}, n, field, uv) + 1;
  ambientColor = vec3(0.0);
  diffuseColor = vec3(float(number & 255), float((number >> 8) & 255), 128.0) / 255.0;
"""
UV = f"""
  vec3 n = normalize({injection.NORMAL});
  float field;
  vec2 uv;
  decal_owner({injection.POSITION}, n, field, uv);
  int u = int(round(uv.x * {UV_STEPS - 1})), v = int(round(uv.y * {UV_STEPS - 1}));
  ambientColor = vec3(0.0);
  diffuseColor = vec3(float(u & 255), float((u >> 8) + 16 * (v >> 8)), float(v & 255)) / 255.0;
"""


def torus() -> pv.PolyData:
    ring = pv.ParametricTorus(ringradius=1.0, crosssectionradius=0.4, u_res=40, v_res=20, w_res=5).clean()
    assert isinstance(ring, pv.PolyData)
    return ring


def decals_over(mesh: pv.PolyData, count: int = 90, *, seed: int = 4) -> Decals:
    return scattered(mesh_object("mesh", mesh), count, seed, radii=(0.08, 0.4))


def subplot_with(
    plotter: Factory,
    mesh: pv.DataSet,
    decals: Decals,
    *,
    paint: str = injection.PAINT,
    crease_angle: float = CREASE_ANGLE,
    **look: Any,
) -> tuple[Plotter, pv.Actor]:
    pl = plotter(window_size=SIZE)
    pl.disable_anti_aliasing()
    actor = pl.add_mesh(mesh, **look)
    pl.decals.add(decals, images=["scale"])
    subplot = pl.decals.subplot
    subplot.applied.injections.append(
        injection.Injection(subplot, actor, crease_angle=crease_angle, paint=paint)
    )
    pl.camera_position = [(2.0, -2.6, 2.4), (0, 0, 0), (0, 0, 1)]
    pl.reset_camera_clipping_range()
    return pl, actor


def found_by_us(pl: Plotter, mesh: pv.DataSet, crease_angle: float = CREASE_ANGLE) -> Buffers:
    """The batch renderer's, of the same mesh from the same camera."""
    subplot = pl.decals.subplot
    scene = Scene(
        objects=(replace(mesh_object("mesh", mesh), crease_angle=crease_angle),),
        camera=Camera((0, 0, 1)),
        decals=pl.decals.scene.decals,
        images=pl.decals.scene.images,
    )
    with subplot.current():
        buffers: Buffers = subplot.renderer.buffers(
            scene, RenderOptions(size=SIZE, contact=subplot.contact), viewpoint=subplot.viewpoint()
        )
    return buffers


LOOKS: dict[str, dict[str, Any]] = {
    "flat": {},
    "smooth": {"smooth_shading": True},
    "scalars": {"scalars": "height"},
    "cell scalars": {"scalars": "number"},
    "culled": {"culling": "back"},
}


CASES = [(look, Contact.PRODUCT) for look in LOOKS] + [
    ("flat", Contact.MIN),
    ("flat", Contact.RADIAL),
    ("flat", Contact.ELASTIC),
]


@pytest.mark.ordinary_cases("culled-0", "cell scalars-0")
@pytest.mark.parametrize(("look", "contact"), CASES)
def test_owner_and_uv_are_those_of_the_renderer(plotter: Factory, look: str, contact: Contact) -> None:
    mesh = torus()
    mesh["height"] = mesh.points[:, 2]
    mesh.cell_data["number"] = np.arange(mesh.n_cells)
    decals = decals_over(mesh)
    options: dict[str, Any] = {"lighting": False, "show_scalar_bar": False, **LOOKS[look]}
    for paint, layered in ((OWNER, False), (OWNER, True), (UV, False)):
        pl, _ = subplot_with(
            plotter, mesh, in_layers(decals, 1) if layered else decals, paint=paint, **options
        )
        pl.decals.subplot.contact = contact
        seen = shot(pl)
        ours = found_by_us(pl, mesh)
        sure = (ours.object_id == 0) & ~edges(ours.object_id)
        assert sure.mean() > 0.2
        if paint is OWNER:
            owner = seen[..., 0] + 256 * seen[..., 1] - 1
            same = owner == ours.owner
            assert (ours.owner[sure] >= 0).mean() > 0.2
            assert same[sure].mean() > 0.998
            continue
        u, v = seen[..., 0] + 256 * (seen[..., 1] % 16), seen[..., 2] + 256 * (seen[..., 1] // 16)
        error = np.abs(np.stack([u, v], -1) / (UV_STEPS - 1) - ours.uv)[sure & (ours.owner >= 0)]
        assert np.quantile(error, 0.98) < 1.5 / UV_STEPS
        assert np.quantile(error, 0.995) < 0.01


@pytest.mark.parametrize("angle", [35.0, 120.0])
def test_creases_are_those_of_the_renderer(plotter: Factory, angle: float) -> None:
    cube = pv.Cube(x_length=1.6, y_length=1.6, z_length=1.6)
    look: dict[str, Any] = {"paint": OWNER, "crease_angle": angle, "lighting": False}
    pl, _ = subplot_with(plotter, cube, decals_over(cube), **look)
    seen, ours = shot(pl), found_by_us(pl, cube, angle)
    sure = (ours.object_id == 0) & ~edges(ours.object_id)
    owner = seen[..., 0] + 256 * seen[..., 1] - 1
    assert (owner == ours.owner)[sure].mean() > 0.998
    assert cube.n_points == 8  # the plotter's own mesh stays
    assert "Normals" in cube.point_data


@pytest.mark.parametrize(("angle", "points"), [(35.0, 24), (120.0, 8)])
def test_apply_takes_a_crease_angle(plotter: Factory, angle: float, points: int) -> None:
    pl = plotter(window_size=SIZE)
    cube = pv.Cube()
    actor = pl.add_mesh(cube)
    pl.decals.add(decals_over(cube))
    pl.decals.apply(actor, crease_angle=angle)
    shot(pl)
    assert actor.GetMapper().GetInput().GetNumberOfPoints() == points
    with pytest.raises(InvalidScene, match="crease_angle: expected degrees from 0 to 180"):
        pl.decals.apply(actor, crease_angle=200.0)


def test_light_is_vtks(plotter: Factory) -> None:
    """Under an opaque decal of one colour an actor looks as if it were of it, elsewhere as without us."""
    mesh = torus()
    decals = decals_over(mesh).replace(images=np.full(90, -1), tints=np.full((90, 3), [0.8, 0.35, 0.2]))
    pl, actor = subplot_with(plotter, mesh, decals, color="lightblue", specular=0.4, ambient=0.2)
    seen = shot(pl)
    ours = found_by_us(pl, mesh)
    pl.decals.remove(actor)
    plain = shot(pl)
    actor.prop.diffuse_color = actor.prop.ambient_color = (0.8, 0.35, 0.2)  # highlights keep theirs
    painted = shot(pl)
    covered = (ours.field > 0.53) & (ours.object_id == 0)
    free = (ours.owner < 0) & ~edges(ours.owner >= 0)
    assert covered.sum() > 500
    assert (ours.object_id == 0)[free].sum() > 300
    assert (np.abs(seen - painted)[covered].max(axis=-1) <= 1).mean() > 0.99  # but for inner silhouettes
    np.testing.assert_array_equal(seen[free & ~edges(ours.object_id)], plain[free & ~edges(ours.object_id)])


def test_scalars_edges_and_opacity_stay(plotter: Factory) -> None:
    mesh = pv.Sphere(theta_resolution=16, phi_resolution=16)
    mesh["height"] = mesh.points[:, 2]
    looks: list[dict[str, Any]] = [
        {"show_edges": True},
        {"opacity": 0.5},
        {"pbr": True},
        {"scalars": "height", "show_edges": True},
    ]
    decals = decals_over(mesh, 30).replace(radii=np.full(30, 0.1))
    for look in looks:
        pl, actor = subplot_with(plotter, mesh, decals, show_scalar_bar=False, **look)
        seen = shot(pl)
        ours = found_by_us(pl, mesh)
        pl.decals.remove(actor)
        plain = shot(pl)
        free = (ours.owner < 0) & ~edges(ours.owner >= 0) & ~edges(ours.object_id)
        if "opacity" not in look:  # where decals of the back shine through
            np.testing.assert_array_equal(seen[free], plain[free])
        assert (seen != plain).any(axis=-1)[ours.field > 0.6].mean() > 0.6
        if "show_edges" in look:
            black = (plain < 12).all(axis=-1) & (ours.field > 0.55)
            assert black.sum() > 30
            assert (seen[black] < 12).mean() > 0.95


def test_decals_over_stock_actors_and_our_objects(plotter: Factory) -> None:
    """Every actor shows its part of a decal that lies on both, owner for owner."""
    ball, box = pv.Sphere(radius=0.6), pv.Cube(center=(0.6, 0, 0)).triangulate().subdivide(3)
    decals = scattered(mesh_object("ball", ball), 60, 2, radii=(0.1, 0.3))
    pl, _ = subplot_with(plotter, box, decals, paint=OWNER, lighting=False)
    pl.decals.add_mesh(ball)
    seen = shot(pl)
    ours = found_by_us(pl, box)
    shown = seen[..., 2] == 128
    owner = seen[..., 0] + 256 * seen[..., 1] - 1
    assert (shown & (owner >= 0)).sum() > 100
    assert (owner == ours.owner)[shown].mean() > 0.99
    hit = pl.decals.subplot.at(80, 60)
    assert hit is None or hit.object_id == 0


def test_decals_that_follow_and_decals_that_stay(plotter: Factory) -> None:
    mesh = torus()
    decals = decals_over(mesh)

    def picture(*, follow: bool, moved: bool, **options: Any) -> np.ndarray:
        pl = plotter(window_size=SIZE)
        pl.disable_anti_aliasing()
        actor = pl.add_mesh(mesh, lighting=False, color="white")
        pl.decals.add(decals, images=["tile"])
        pl.decals.apply(actor, follow=follow)
        if moved:
            actor.position = (0.0, 5.0, 0.0)
        y = 5.0 if moved else 0.0
        pl.camera_position = [(2.0, y - 2.6, 2.4), (0, y, 0), (0, 0, 1)]
        pl.reset_camera_clipping_range()
        return shot(pl)

    first = picture(follow=True, moved=False)
    assert (np.abs(picture(follow=True, moved=True) - first).max(axis=-1) > 3).mean() < 0.005
    np.testing.assert_array_equal(picture(follow=False, moved=False), first)
    moved = picture(follow=False, moved=True)
    assert (moved == 255).all()  # they are where the actor was


def test_actors_take_decals_by_their_labels(plotter: Factory) -> None:
    mesh = torus()
    some = decals_over(mesh)
    named = some.replace(receivers=np.where(np.arange(len(some)) % 2, "ring", "cup"))
    pictures = []
    for decals, labels in ((some[::2], None), (named, "cup"), (named, None), (some, None), (named, ["none"])):
        pl = plotter(window_size=SIZE)
        pl.disable_anti_aliasing()
        actor = pl.add_mesh(mesh, lighting=False, color="white")
        pl.decals.add(decals, images=["tile"])
        pl.decals.apply(actor, labels=labels)
        pictures.append(shot(pl))
    first, by_label, unlabelled, whole, none = pictures
    assert (np.abs(by_label - first).max(axis=-1) > 3).mean() < 0.001
    assert (np.abs(unlabelled - whole).max(axis=-1) > 3).mean() < 0.001
    assert (by_label != whole).any()
    assert (none == 255).all()
    with pytest.raises(InvalidScene, match="expected labels"):
        pl.decals.apply(actor, labels=7)


def test_changes_show_with_the_next_frame(plotter: Factory) -> None:
    mesh = torus()
    pl, actor = subplot_with(plotter, mesh, decals_over(mesh), color="white")
    first = shot(pl)
    pl.decals.scene = pl.decals.scene.replace(decals=decals_over(mesh, seed=5))
    assert (shot(pl) != first).any()
    pl.decals.scene = pl.decals.scene.replace(decals=in_layers(decals_over(mesh, seed=5), 2))
    layered = shot(pl)
    assert (layered != first).any()
    pl.decals.clear()
    bare = shot(pl)
    pl.decals.remove(actor)
    np.testing.assert_array_equal(shot(pl), bare)


def test_what_others_put_into_the_shader_stays(plotter: Factory) -> None:
    """Under decals, where it changes while they are there, and once they are taken off."""
    mesh = torus()
    decals = decals_over(mesh).replace(images=np.full(90, -1), tints=np.full((90, 3), [0.2, 0.3, 0.9]))
    tag = "//VTK::Color::Impl"
    pl, actor = subplot_with(plotter, mesh, decals, lighting=False)
    shot(pl)
    sure = ~edges(found_by_us(pl, mesh).object_id)
    shader = actor.GetShaderProperty()
    for color, seen_as in (("0.0, 1.0, 0.0", [0, 255, 0]), ("1.0, 0.0, 0.0", [255, 0, 0])):
        text = f"{tag}\n  diffuseColor = ambientColor = vec3({color});\n"
        shader.AddFragmentShaderReplacement(tag, True, text, False)
        theirs = (shot(pl)[sure] == seen_as).all(axis=-1)
        assert 0.1 < theirs.mean() < 0.9  # and elsewhere decals
    pl.decals.remove(actor)
    assert ((shot(pl)[sure] == [255, 0, 0]).all(axis=-1)).sum() > theirs.sum() + 200
    assert shader.GetNumberOfShaderReplacements() == 1
    assert shader.GetNthShaderReplacementTypeAsString(0) == "Fragment"


def test_a_mesh_that_changes_keeps_true_normals(plotter: Factory) -> None:
    mesh = torus()
    pl, actor = subplot_with(plotter, mesh, decals_over(mesh), color="white")
    shot(pl)
    points: Any = mesh.points
    points[:] = np.asarray(points) * (1.0, 1.0, 0.6)
    changed = shot(pl)
    fresh, _ = subplot_with(plotter, mesh.copy(), pl.decals.scene.decals, color="white")
    np.testing.assert_array_equal(shot(fresh), changed)
    actor.mapper.dataset = torus()
    again, _ = subplot_with(plotter, torus(), pl.decals.scene.decals, color="white")
    np.testing.assert_array_equal(shot(pl), shot(again))


@pytest.mark.ordinary_cases("before-near", "after-far_away")
@pytest.mark.parametrize("center", [(0.0, 0.0, 0.0), (500.0, 0.0, 0.0)], ids=["near", "far_away"])
@pytest.mark.parametrize("first", [True, False], ids=["before", "after"])
def test_decals_stay_if_another_actor_shows_the_same_mesh(
    plotter: Factory, center: tuple[float, float, float], first: bool
) -> None:
    """VTK shares the points of a mesh between actors, and shifts and scales those of a large or far one."""
    mesh = pv.Sphere(radius=16, center=center)
    decals = decals_over(pv.Sphere(radius=1.0), 60)
    decals = decals.replace(
        positions=16 * decals.positions + np.array(center, np.float32), radii=16 * decals.radii
    )

    def owners(*, others: int) -> np.ndarray:
        pl = plotter(window_size=SIZE)
        pl.disable_anti_aliasing()
        for _ in range(others if first else 0):
            pl.add_mesh(mesh, style="wireframe", color="red", lighting=False)
        actor = pl.add_mesh(mesh, lighting=False)
        for _ in range(0 if first else others):
            pl.add_mesh(mesh, style="wireframe", color="red", lighting=False)
        pl.decals.add(decals, images=["scale"])
        subplot = pl.decals.subplot
        subplot.applied.injections.append(injection.Injection(subplot, actor, paint=OWNER))
        x, y, z = center
        pl.camera_position = [(x + 40.0, y - 50.0, z + 30.0), center, (0, 0, 1)]
        pl.reset_camera_clipping_range()
        return shot(pl)

    alone = owners(others=0)
    assert ((alone[..., 2] == 128) & (alone[..., 0] > 0)).sum() > 3000
    both = owners(others=1)
    same = (both == alone).all(axis=-1)
    assert (same | (both == (255, 0, 0)).all(axis=-1)).mean() > 0.98


def test_pyvistas_pickers_return_pyvistas_mesh(plotter: Factory) -> None:
    """The picked mesh of an actor with decals has pyvista's type and the arrays of the user."""
    mesh = torus()
    mesh["height"] = mesh.points[:, 2]
    pl, actor = subplot_with(plotter, mesh, decals_over(mesh))
    picked: list[pv.DataSet] = []
    pl.enable_mesh_picking(picked.append, show=False, show_message=False)
    row, column = np.argwhere((shot(pl) != 255).any(axis=-1))[500]
    assert pl.iren is not None
    pl.iren.picker.Pick(int(column), SIZE[1] - 1 - int(row), 0, pl.renderer)
    assert pl.picked_actor is actor
    assert [type(one) for one in picked] == [pv.PolyData]
    np.testing.assert_array_equal(picked[0].points, mesh.points)
    np.testing.assert_array_equal(picked[0]["height"], mesh["height"])
    picked[0].points[:] += 1.0
    assert actor.mapper.dataset is mesh
    np.testing.assert_allclose(mesh["height"], mesh.points[:, 2])


def test_removing_decals_that_are_not_there_is_an_error(plotter: Factory) -> None:
    mesh = torus()
    pl = plotter(shape=(1, 2))
    actor, bare = pl.add_mesh(mesh), pl.add_mesh(pv.Sphere())
    pl.decals.add(decals_over(mesh), images=["scale"])
    pl.decals.apply(actor)
    for wrong in (bare, mesh, None):
        with pytest.raises(InvalidScene, match="expected an actor with decals of this subplot, got"):
            pl.decals.remove(wrong)
    with pytest.raises(InvalidScene, match="mapping: expected 'corrected' or 'chord'"):
        pl.decals.mapping = "walked"
    pl.subplot(0, 1)
    pl.decals.mapping = "walked"
    with pytest.raises(InvalidScene, match="mapping: expected 'corrected' or 'chord'"):
        pl.decals.apply(bare)
    with pytest.raises(InvalidScene, match="in the active subplot"):
        pl.decals.remove(actor)
    pl.subplot(0, 0)
    pl.decals.remove(actor)
    with pytest.raises(InvalidScene, match="expected an actor with decals"):
        pl.decals.remove(actor)


def test_solids_take_decals_on_their_surface(plotter: Factory) -> None:
    grid = pv.ImageData(
        dimensions=(5, 5, 5), spacing=(0.25,) * 3, origin=(-0.5,) * 3
    ).cast_to_unstructured_grid()
    surface = grid.extract_surface(algorithm="dataset_surface")
    pl, _ = subplot_with(plotter, grid, decals_over(surface, 40), paint=OWNER, lighting=False)
    seen = shot(pl)
    ours = found_by_us(pl, grid)
    sure = (ours.object_id == 0) & ~edges(ours.object_id)
    assert ((seen[..., 0] + 256 * seen[..., 1] - 1) == ours.owner)[sure].mean() > 0.99


def test_subplots_share_an_actor_and_lay_their_own_decals_on_it(plotter: Factory) -> None:
    mesh = torus()

    def picture(left: str | None, right: str | None, *, taken_off: bool = False) -> np.ndarray:
        pl = plotter(shape=(1, 2), window_size=(320, 120), border=False)
        pl.disable_anti_aliasing()
        actor = pl.add_mesh(mesh, color="white")
        for column, image in enumerate((left, right)):
            pl.subplot(0, column)
            pl.add_actor(actor, render=False)
            pl.camera_position = [(2.0, -2.6, 2.4), (0, 0, 0), (0, 0, 1)]
            pl.reset_camera_clipping_range()
            if image is not None:
                pl.decals.add(decals_over(mesh), images=[image])
                pl.decals.apply(actor)
        first = shot(pl)
        np.testing.assert_array_equal(shot(pl), first)
        if taken_off:
            pl.subplot(0, 0)
            pl.decals.remove(actor)
            return shot(pl)
        return first

    scales, tiles, bare = (picture(image, image) for image in ("scale", "tile", None))
    np.testing.assert_array_equal(picture("scale", "tile"), np.hstack([scales[:, :160], tiles[:, 160:]]))
    off = picture("scale", "tile", taken_off=True)
    np.testing.assert_array_equal(off, np.hstack([bare[:, :160], tiles[:, 160:]]))
    one = picture(None, "tile")
    np.testing.assert_array_equal(one, off)


@pytest.mark.parametrize("kind", ["volume", "glyphs", "composite"])
def test_other_mappers_are_refused(plotter: Factory, kind: str) -> None:
    pl = plotter()
    blocks = pv.MultiBlock([pv.Sphere(), pv.Cube()])
    add: dict[str, Callable[[], object]] = {
        "volume": lambda: pl.add_volume(pv.ImageData(dimensions=(3, 3, 3)), scalars=np.ones(27)),
        "glyphs": lambda: pl.add_points(np.zeros((1, 3)), style="points_gaussian"),
        "composite": lambda: pl.add_composite(blocks)[0],
    }
    with pytest.raises(InvalidScene, match="vtkPolyDataMapper"):
        pl.decals.apply(add[kind]())


def test_actors_refuse_scenes_with_walked_images(plotter: Factory) -> None:
    """An edited document can change its mapping later, which brings a warning."""
    mesh = torus()
    pl, _ = subplot_with(plotter, mesh, decals_over(mesh))
    shown = pl.decals.scene
    with pytest.raises(InvalidScene, match="mapping: expected 'corrected' or 'chord'"):
        pl.decals.add_scene(shown.replace(drawing=Drawing(mapping=ImageMapping.WALKED)))
    assert pl.decals.scene is shown
    document = Document.from_scene(shown)
    pl.decals.subplot.scene = document
    document.draw_as(Drawing(mapping=ImageMapping.WALKED))
    with pytest.warns(UserWarning, match="mapping: expected 'corrected' or 'chord'"):
        shot(pl)


@pytest.mark.parametrize("kind", ["turned", "mixed", "mirrored"])
def test_actors_that_wind_inward_show_the_same_decals(plotter: Factory, kind: str) -> None:
    mesh: Any = pv.Sphere(theta_resolution=16, phi_resolution=16)
    layout, given, matrix = decals_over(mesh), mesh, np.eye(4)
    if kind == "turned":
        given = mesh.flip_faces()
    elif kind == "mixed":
        faces = mesh.regular_faces.copy()
        faces[::3] = faces[::3, ::-1]
        given = pv.PolyData.from_regular_faces(mesh.points, faces)
    else:
        matrix = np.diag([-1.0, 1.0, 1.0, 1.0])
        given = mesh.transform(matrix, inplace=False).flip_faces()
    pictures = []
    for shown, user_matrix in ((mesh, np.eye(4)), (given, matrix)):
        pl, actor = subplot_with(plotter, shown, layout, paint=OWNER, lighting=False)
        actor.user_matrix = user_matrix
        pictures.append(shot(pl).astype(int))
    shown = np.abs(pictures[0] - pictures[1]).max(axis=-1) > 8
    assert (pictures[0].max(axis=-1) > 0).any()
    assert shown.mean() < 0.01
