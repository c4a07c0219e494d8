"""The command that installs a package into the environment in which vsnbench runs."""

import json
import shlex
import shutil
import sys
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path
from typing import Final
from urllib.parse import unquote, urlsplit

NAME: Final = "vsnbench"


def command_to_add(extra: str) -> str:
    """Return the command that installs an extra of vsnbench from where vsnbench itself came from."""
    source, is_editable = _source()
    return _install(["--editable"] if is_editable else [], f"{source}[{extra}]")


def command_to_install(package: str, *options: str) -> str:
    """Return the command that installs another package.

    Args:
        package: its name, with a version where one is needed.
        options: options of pip.
    """
    return _install(list(options), package)


def _install(options: list[str], requirement: str) -> str:
    return shlex.join([*_installer(), *options, requirement])


def _installer() -> list[str]:
    """Return how packages get into this environment: by pipx, by uv, or by the interpreter's own pip."""
    environment = Path(sys.prefix)
    if (environment / "pipx_metadata.json").is_file():
        return ["pipx", "runpip", environment.name, "install"]
    if find_spec("pip") is None and shutil.which("uv"):
        return ["uv", "pip", "install", "--python", sys.executable]
    return [sys.executable, "-m", "pip", "install"]


def _source() -> tuple[str, bool]:
    """Return the checkout or wheel from which vsnbench was installed, and whether that was editable; or its name."""
    checkout = Path(__file__).resolve().parent.parent
    try:
        recorded = json.loads(distribution(NAME).read_text("direct_url.json") or "{}")
        url = urlsplit(recorded.get("url", ""))
        source = Path(unquote(url.path))
        is_editable = bool(recorded.get("dir_info", {}).get("editable"))
    except PackageNotFoundError:
        source, is_editable = checkout, True
    except (ValueError, AttributeError, OSError):  # written by another program
        return NAME, False
    else:
        if url.scheme != "file":
            return NAME, False
    if is_editable:
        return (str(source), True) if (source / "pyproject.toml").is_file() else (NAME, False)
    return (str(source), False) if source.exists() else (NAME, False)
