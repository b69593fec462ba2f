"""Export: decals in the shaders of other programs, in pages and in files.

    python -m tests.bench.export [--json FILE] [--quick] [--only shader,page,files,bake]

The parts are modules of their own.
"""

import sys

from tests.bench.parts import run

PARTS = "shader", "page", "files", "bake"
"""Names of the parts; each is the module `tests.bench.export_NAME`."""


if __name__ == "__main__":
    sys.exit(run("export", PARTS, __doc__))
