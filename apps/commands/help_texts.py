"""The text that ``--help`` prints for each command: a summary and examples."""

HELP = {
    "demo": """Draw three pictures that show the method.

For example:

implicit-decals demo

implicit-decals demo --output pictures
""",
    "render": """Cover models with decals and draw a picture.

All models share one coordinate system. Decals continue from one model to another where they touch.

For example:

implicit-decals render knot --decals 800 -o knot.png

implicit-decals render bunny.ply blob.json --image scale --image rock -o both.png

implicit-decals render dragon --decals 1000 --camera 1,0.4,1 --save dragon.json -o dragon.png

implicit-decals render dragon.json --size 2400x1800 -o large.png
""",
    "edit": """Open models or a scene in an editor window.

For example:

implicit-decals edit knot --decals 300 --image scale --image eye --save knot.json

implicit-decals edit knot.json
""",
    "scatter": """Scatter decals over models and write a scene, or a table of decals.

All models share one coordinate system. Decals of different models push each other where the models touch.

For example:

implicit-decals scatter knot --count 2000 -o scene.json

implicit-decals render scene.json -o picture.png

implicit-decals scatter bunny.ply --spacing 0.02 --sizing touching --along curvature -o decals.csv
""",
    "polygonize": """Write the surface of an implicit model as a triangle mesh.

For example:

implicit-decals polygonize spheres -o spheres.ply

implicit-decals polygonize blob.json --cell-size 0.02 -o blob.obj

implicit-decals polygonize part.json --chord-error 0.001 --creases -o part.stl
""",
    "doctor": "Check the software and hardware of this machine, and print advice.",
}

BENCH_TABLE = """Measure figure 14 of the paper on this machine, and print it beside the paper's numbers.

For example:

implicit-decals bench table --size 800x600 --counts 100,1000 --models knot,spheres
"""
"""The text for ``implicit-decals bench table``."""
