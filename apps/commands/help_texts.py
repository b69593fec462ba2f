"""What ``--help`` says of each command: a line, then examples."""

HELP = {
    "demo": """Draw three pictures that show what this is about.

For instance:

implicit-decals demo

implicit-decals demo --output pictures
""",
    "render": """Cover models with one coat of decals and draw a picture.

Several models keep their own coordinates; where they touch, the decals run across.

For instance:

implicit-decals render knot --decals 800 -o knot.png

implicit-decals render bunny.ply blob.json --image scale --image rock -o both.png

implicit-decals render dragon --decals 1000 --camera 1,0.4,1 --save dragon.json -o dragon.png

implicit-decals render dragon.json --size 2400x1800 -o large.png
""",
    "view": """Open models or a scene in a window, and push decals by hand.

For instance:

implicit-decals view knot --decals 300 --image scale --image eye --save knot.json

implicit-decals view knot.json
""",
    "seed": """Spread seeds over models and write the decals that lie on them.

Several models keep their own coordinates; where they touch, seeds push each other.

For instance:

implicit-decals seed knot --count 2000 -o seeds.json

implicit-decals seed bunny.ply --spacing 0.02 --sizing touching --along curvature -o seeds.csv
""",
    "polygonize": """Write an implicit model's surface as a triangle mesh.

For instance:

implicit-decals polygonize spheres -o spheres.ply

implicit-decals polygonize blob.json --cell-size 0.02 -o blob.obj

implicit-decals polygonize part.json --chord-error 0.001 --creases -o part.stl
""",
    "doctor": "Say what is here of what the project needs, and what to do about the rest.",
}

BENCH_TABLE = """Print the paper's figure 14 as this machine has it, beside the paper's numbers.

For instance:

implicit-decals bench table --size 800x600 --counts 100,1000 --models knot,spheres
"""
"""Of ``implicit-decals bench table``."""
