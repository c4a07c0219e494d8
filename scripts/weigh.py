"""Says what the core and each extra bring into an environment: packages, megabytes, and the heaviest of them.

usage: python scripts/weigh.py [ENVIRONMENT ...]   (.venv and .venv-ros2 when absent)

Sizes are those of the files that each installed package's RECORD names, compiled Python left out; an extra brings
what the core does not. Nothing is downloaded: an extra that is installed nowhere is said to be missing.
"""

import sys
import tomllib
from collections.abc import Iterable
from importlib.metadata import Distribution, distributions
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parent.parent


def installed(environments: Iterable[Path]) -> dict[str, Distribution]:
    """Return every package in these environments by its name; of one in several, the first."""
    found: dict[str, Distribution] = {}
    for environment in environments:
        for place in sorted(environment.glob("lib/python3*/site-packages")):
            for each in distributions(path=[str(place)]):
                found.setdefault(canonicalize_name(each.metadata["Name"]), each)
    return found


def brought(requirements: Iterable[str], here: dict[str, Distribution]) -> set[str]:
    """Return the packages that these requirements bring, with those that they bring in turn.

    Raises:
        KeyError: one is not installed.
    """
    names: set[str] = set()
    waiting = [(Requirement(text), "") for text in requirements]
    seen: set[tuple[str, str]] = set()
    while waiting:
        wanted, extra = waiting.pop()
        if wanted.marker and not wanted.marker.evaluate({"extra": extra}):
            continue
        name = canonicalize_name(wanted.name)
        names.add(name)
        for own in {"", *wanted.extras}:
            if (name, own) not in seen:
                seen.add((name, own))
                waiting += [(Requirement(text), own) for text in here[name].requires or ()]
    return names


def megabytes(package: Distribution) -> float:
    """Return the size of a package's files."""
    files = (Path(str(package.locate_file(file))) for file in package.files or () if file.suffix != ".pyc")
    return sum(file.stat().st_size for file in files if file.is_file()) / 1e6


def table(environments: Iterable[Path]) -> str:
    """Return the table of docs/install.md."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    here = installed(environments)
    core = brought(project["dependencies"], here)
    lines = ["| | packages | MB | the heaviest |", "| --- | ---: | ---: | --- |", _line("core", core, here)]
    for extra, requirements in project["optional-dependencies"].items():
        try:
            own = brought(requirements, here) - core
        except KeyError as missing:
            lines.append(f"| `{extra}` | | | {missing.args[0]} is not installed |")
        else:
            lines.append(_line(f"`{extra}`", own, here))
    return "\n".join(lines) + "\n"


def _line(title: str, names: Iterable[str], here: dict[str, Distribution]) -> str:
    sizes = sorted(((megabytes(here[name]), name) for name in names), reverse=True)
    heaviest = ", ".join(f"{name} {size:.0f}" for size, name in sizes[:4] if size >= 1)
    return f"| {title} | {len(sizes)} | {sum(size for size, _ in sizes):.0f} | {heaviest} |"


if __name__ == "__main__":
    given = [Path(word) for word in sys.argv[1:]] or [ROOT / ".venv", ROOT / ".venv-ros2"]
    sys.stdout.write(table(given))
