"""Modules of a page's viewer, run by Node.js."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

VIEWER = Path(__file__).parents[3] / "decals" / "pages" / "viewer"

node = shutil.which("node")

needs_node = pytest.mark.skipif(node is None, reason="Node.js is not installed")


def run_node(script: str, data: Any) -> Any:
    """Return what a script prints as JSON, which imports modules of the viewer and has `data`."""
    assert node is not None
    text = f"import fs from 'node:fs';\nconst data = JSON.parse(fs.readFileSync(0, 'utf8'));\n{script}"
    command = [node, "--input-type=module", "-e", text]
    ended = subprocess.run(
        command, input=json.dumps(data), capture_output=True, text=True, cwd=VIEWER, timeout=60, check=False
    )
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)
