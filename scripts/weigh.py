"""Prints packages, megabytes and the largest packages of the core and of each extra.

usage: python scripts/weigh.py [ENVIRONMENT ...]   (default: .venv and .venv-ros2)

Sizes are from each installed package's RECORD, without compiled Python. An extra counts what the core does not have.
Nothing is downloaded; an extra that is not installed is reported as missing.
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
    """Return the packages of these environments by name; the first environment wins."""
    found: dict[str, Distribution] = {}
    for environment in environments:
        for place in sorted(environment.glob("lib/python3*/site-packages")):
            for package in distributions(path=[str(place)]):
                found.setdefault(canonicalize_name(package.metadata["Name"]), package)
    return found


def required(requirements: Iterable[str], here: dict[str, Distribution]) -> set[str]:
    """Return the packages of these requirements with their dependencies.

    Raises:
        KeyError: a package is not installed.
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
    core = required(project["dependencies"], here)
    lines = ["| extra | packages | MB | largest packages |", "| --- | ---: | ---: | --- |", _line("core", core, here)]
    for extra, requirements in project["optional-dependencies"].items():
        try:
            own = required(requirements, here) - core
        except KeyError as missing:
            lines.append(f"| `{extra}` | | | {missing.args[0]} is not installed |")
        else:
            lines.append(_line(f"`{extra}`", own, here))
    return "\n".join(lines) + "\n"


def _line(title: str, names: Iterable[str], here: dict[str, Distribution]) -> str:
    sizes = sorted(((megabytes(here[name]), name) for name in names), reverse=True)
    largest = ", ".join(f"{name} {size:.0f}" for size, name in sizes[:4] if size >= 1)
    return f"| {title} | {len(sizes)} | {sum(size for size, _ in sizes):.0f} | {largest} |"


if __name__ == "__main__":
    given = [Path(word) for word in sys.argv[1:]] or [ROOT / ".venv", ROOT / ".venv-ros2"]
    sys.stdout.write(table(given))
