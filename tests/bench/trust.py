"""Trust: files of other programs, windings, thin parts, gaps, sharp edges, framing, attacks, cancelled work.

    python -m tests.bench.trust [--json FILE] [--quick] [--only windings,thin]

Each part counts faults, and the cases in which it looked for them. The parts are modules of their own.
`tests.bench.trust_files` takes the number of files and of processes.
"""

import sys

from tests.bench.parts import run

PARTS = ("files", "windings", "framing", "thin", "gaps", "csg", "attacks", "cancel", "calls")
"""Names of the parts; each is the module `tests.bench.trust_NAME`."""


if __name__ == "__main__":
    sys.exit(run("trust", PARTS, __doc__))
