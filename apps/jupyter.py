"""The sandbox behind jupyter-server-proxy, which needs no port for a notebook on another machine."""

import secrets
import sys
from typing import Any

TOKEN = "IMPLICIT_DECALS_TOKEN"
"""Variable of the environment with the token that the command `sandbox` takes."""

STARTS_SECONDS = 90.0
"""Time in which the server of sessions has to answer."""


def sandbox() -> dict[str, Any]:
    """Return how jupyter-server-proxy starts the sandbox, and the header with which it asks for pages.

    The proxy has checked the login of a browser, and the origin of its messages. It sends a token that the
    browser never gets.
    """
    token = secrets.token_urlsafe(24)
    return {
        "command": [sys.executable, "-m", "decals", "sandbox", "--port", "{port}", "--no-browser"],
        "environment": {TOKEN: token},
        "request_headers_override": {"Authorization": f"Bearer {token}"},
        "timeout": STARTS_SECONDS,
        "launcher_entry": {"title": "Implicit Decals", "path_info": "implicit-decals/"},
    }
