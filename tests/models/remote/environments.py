"""Virtual environments for the server file, with each major version of websockets."""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

WEBSOCKETS_MAJORS = (11, 12, 13, 14, 15, 16, 17)
_PIP_TIMEOUT_S = 240


class NotOfferedError(Exception):
    """The package index does not have this version, or is not reachable."""


def environment(major: int, directory: Path) -> Path:
    """Return an interpreter with one major version of websockets; numpy and msgpack are those of this environment.

    Raises:
        NotOfferedError: pip cannot install it.
    """
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", directory], check=True, timeout=_PIP_TIMEOUT_S)
    python = directory / "bin" / "python"
    where = [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    packages = Path(subprocess.run(where, check=True, capture_output=True, text=True, timeout=60).stdout.strip())
    shared = [sysconfig.get_path("purelib"), *(path for path in sys.path if path.endswith("site-packages"))]
    (packages / "shared.pth").write_text("".join(f"{path}\n" for path in dict.fromkeys(shared)))
    options = ["--quiet", "--disable-pip-version-check", "--no-deps", "--no-warn-conflicts"]
    installed = subprocess.run(
        [sys.executable, "-m", "pip", "install", *options, "--target", packages, f"websockets=={major}.*"],
        capture_output=True,
        text=True,
        timeout=_PIP_TIMEOUT_S,
        env={**os.environ, "PIP_RETRIES": "1"},
    )
    if installed.returncode:
        raise NotOfferedError((installed.stderr.strip().splitlines() or ["pip failed"])[-1])
    return python
