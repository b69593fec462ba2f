"""What is refused of public collections of test files, and what differs from trimesh; each with its reason.

The files themselves are not part of the project; see `tests.decals.surfaces.test_collections`.
"""

from typing import NamedTuple


class Row(NamedTuple):
    """A file of a collection that is not read as trimesh reads it.

    ``refusal`` is a part of our message; None if the file is read, but as another mesh than by trimesh.
    """

    file: str
    refusal: str | None
    reason: str


ASSIMP = [
    Row("models/glTF2/simple_skin/simple_skin.gltf", None, "its skin is applied; trimesh leaves it out"),
    Row(
        "models/OBJ/box_longline.obj",
        None,
        "one face names the same four corners again and again, so it has no area that is right",
    ),
    *(
        Row(file, None, "trimesh divides concave polygons as if they were convex")
        for file in (
            "models/OBJ/concave_polygon.obj",
            "models/OBJ/space_in_material_name.obj",
        )
    ),
    Row(
        "models/OBJ/number_formats.obj",
        "line 11: expected three finite numbers",
        "it has numbers such as 3.1+e2, which are none",
    ),
    *(
        Row(file, "no faces", "it has points, lines or nothing at all")
        for file in (
            "models/OBJ/point_cloud.obj",
            "models/OBJ/testline.obj",
            "models/OBJ/testpoints.obj",
            "models/PLY/points.ply",
            "models/PLY/pond.0.ply",
            "models/glTF2/TestNoRootNode/NoScene.gltf",
            "models/glTF2/TestNoRootNode/SceneWithoutNodes.gltf",
            "models/glTF2/glTF-Asset-Generator/Mesh_PrimitiveMode/Mesh_PrimitiveMode_00.gltf",
            "models/glTF2/glTF-Asset-Generator/Mesh_PrimitiveMode/Mesh_PrimitiveMode_01.gltf",
            "models/glTF2/glTF-Asset-Generator/Mesh_PrimitiveMode/Mesh_PrimitiveMode_02.gltf",
            "models/glTF2/glTF-Asset-Generator/Mesh_PrimitiveMode/Mesh_PrimitiveMode_03.gltf",
            "models/glTF2/glTF-Asset-Generator/Mesh_PrimitiveMode/Mesh_PrimitiveMode_07.gltf",
            "models/glTF2/glTF-Asset-Generator/Mesh_PrimitiveMode/Mesh_PrimitiveMode_08.gltf",
            "models/glTF2/glTF-Asset-Generator/Mesh_PrimitiveMode/Mesh_PrimitiveMode_09.gltf",
            "models/glTF2/glTF-Asset-Generator/Mesh_PrimitiveMode/Mesh_PrimitiveMode_10.gltf",
            "models/invalid/empty.obj",
        )
    ),
    Row(
        "models/OFF/invalid.off",
        "line 7: expected a number of corners",
        "its face lines are no lists of corners",
    ),
    Row(
        "models/PLY/issue623.ply", "lists claims", "its header declares lists in place of an element of faces"
    ),
    Row("models/WRL/HelloWorld.wrl", "centerOfRotation", "it is VRML of a later version than VTK reads"),
    *(
        Row(file, "version 1", "it is glTF 1.0, which trimesh refuses too")
        for file in (
            "models/glTF/BoxTextured-glTF/BoxTextured.gltf",
            "models/glTF/BoxTextured-glTF-Binary/BoxTextured.glb",
            "models/glTF/BoxTextured-glTF-Embedded/BoxTextured.gltf",
            "models/glTF/BoxTextured-glTF-MaterialsCommon/BoxTextured.gltf",
            "models/glTF/CesiumMilkTruck/CesiumMilkTruck.gltf",
            "models/glTF/IncorrectVertexArrays/Cube_v1.gltf",
            "models/glTF/TwoBoxes/TwoBoxes.gltf",
        )
    ),
    Row(
        "models/glTF2/BoxWithInfinites-glTF-Binary/BoxWithInfinites.glb",
        "no finite numbers",
        "its positions are infinite, so its area would not be a number",
    ),
    *(
        Row(file, "a face asks for", "its faces name points that it does not have")
        for file in (
            "models/glTF2/IndexOutOfRange/AllIndicesOutOfRange.gltf",
            "models/glTF2/IndexOutOfRange/IndexOutOfRange.gltf",
            "models/invalid/malformed.obj",
        )
    ),
    Row("models/glTF2/MissingBin/BoxTextured.gltf", "is missing", "the file with its points is missing"),
    *(
        Row(file, None, "the weights of its morph targets are applied; trimesh leaves them out")
        for file in (
            "models/glTF2/MorphPrimitivesTest/glTF/MorphPrimitivesTest.gltf",
            "models/glTF2/SimpleMorph/glTF/SimpleMorph.gltf",
        )
    ),
    Row(
        "models/glTF2/RecursiveNodes/RecursiveNodes.gltf",
        "their own descendants",
        "its nodes are their own descendants",
    ),
    *(
        Row(file, "JSON is wrong", "its JSON does not follow the schema")
        for file in (
            "models/glTF2/SchemaFailures/sceneWrongType.gltf",
            "models/glTF2/wrongTypes/badArray.gltf",
        )
    ),
    Row(
        "models/glTF2/draco/2CylinderEngine.gltf",
        "KHR_draco_mesh_compression",
        "its meshes are compressed by Draco; trimesh reads them as empty faces",
    ),
    Row(
        "models/invalid/OutOfMemory.off",
        "declares 353535235358 vertices",
        "it declares more vertices than it has lines",
    ),
    *(
        Row(file, "PLY", "it is empty, or its header is damaged")
        for file in (
            "models/invalid/crash-30d6d0f7c529b3b66b4131700b7a4580cd7082df.ply",
            "models/invalid/empty.ply",
        )
    ),
    Row("models/invalid/empty.3ds", "3ds", "it is empty"),
    Row("models/invalid/empty.off", "ends before", "it is empty"),
    Row(
        "models-nonbsd/PLY/ant-half.ply",
        "ends within its 912 rows",
        "it is cut off; trimesh returns the faces in front",
    ),
]
"""Of the folder `test` of assimp."""

TRIMESH = [
    Row(
        "cubevt.obj",
        "line 50: a face asks for texture coordinate",
        "its faces name texture coordinates that it does not have",
    ),
    *(
        Row(file, "no faces", "it has points, lines or nothing at all")
        for file in (
            "empty.obj",
            "empty.ply",
            "empty.stl",
            "emptyIO/obj_empty.obj",
            "emptyIO/obj_points.obj",
            "emptyIO/obj_wireframe.obj",
            "emptyIO/ply_empty_ascii.ply",
            "emptyIO/ply_empty_bin.ply",
            "emptyIO/ply_points_ascii.ply",
            "emptyIO/ply_points_bin.ply",
            "emptyIO/stl_empty_ascii.stl",
            "emptyIO/stl_empty_bin.stl",
            "empty_nodes.glb",
            "face_in_group_name.obj",
            "points_ascii.ply",
            "points_ascii_with_lists.ply",
            "points_bin.ply",
            "points_emptyascii.ply",
            "points_emptyface.ply",
        )
    ),
    Row("emptyIO/ply_empty_header.ply", "PLY", "it is empty, or its header is damaged"),
    Row(
        "face_in_group_name_mid_file.obj",
        "line 5: a face asks for normal 1",
        "its faces name normals that it does not have",
    ),
    *(
        Row(file, None, "trimesh divides concave polygons as if they were convex")
        for file in (
            "polygonfaces.obj",
            "wallhole.obj",
        )
    ),
    Row("suzanne.ply", None, "its quadrilaterals are not flat; they are divided by the shorter diagonal"),
]
"""Of the folder `models` of trimesh."""
