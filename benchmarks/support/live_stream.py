"""A second viewer of a run with `--live`, which saves the stream as any viewer gets it."""

import subprocess
import urllib.parse
from collections.abc import Mapping
from pathlib import Path

from tests.web.browser import Browser
from vsnbench.viewer.viewers import _program, free_port


def save_live_stream(
    address: str, file: Path, environment: Mapping[str, str] | None = None
) -> "subprocess.Popen[bytes]":
    """Start the viewer.

    Args:
        address: of the web viewer, with its token.
        file: what it saves to.
        environment: of the viewer; None for this process's.
    """
    location = Browser(address).enter().ask("GET", "/").headers["location"]
    (url,) = urllib.parse.parse_qs(urllib.parse.urlsplit(location).query)["url"]
    command = [str(_program()), "--bind", "127.0.0.1", "--port", str(free_port()), "--save", str(file), url]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment)
