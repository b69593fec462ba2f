"""Programs in Python that tests run in processes of their own; a failure shows what they say."""

import os
import subprocess
import sys
from typing import Any


def run_python(*arguments: str, timeout: float = 300, **options: Any) -> str:
    """Run Python with arguments, and return its output."""
    command = [sys.executable, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False, **options)
    assert done.returncode == 0, done.stderr
    printed: str = done.stdout
    return printed


def output_of(text: str, *arguments: str, **options: Any) -> str:
    """Run the text of a program, and return its output."""
    return run_python("-c", text, *arguments, **options)


def run_module(module: str, *arguments: str, **environment: str) -> str:
    """Run a module of the tests as a program, and return its output."""
    return run_python("-m", module, *arguments, env={**os.environ, **environment})
