"""Reads a site from whatever it was drawn in: GeoJSON or SVG, by the file's name."""

import re
from dataclasses import dataclass
from pathlib import Path

from vsnbench.errors import SiteError, UsageError
from vsnbench.exchange.site_features import MOST_CHARACTERS, Content, content_of
from vsnbench.exchange.site_geojson import read_geojson
from vsnbench.exchange.site_svg import read_svg


@dataclass(frozen=True, slots=True)
class DrawnSite:
    """The content of a site file, as it was drawn."""

    content: Content
    lacks: tuple[str, ...]
    """The lists without which it is no site yet: of rooms, walls and starts."""
    left_out: int
    """How many shapes are of no kind that a site has."""


def read_drawing(path: Path, name: str, metres_per_unit: float | None = None) -> DrawnSite:
    """Read a .geojson, .json or .svg file.

    Args:
        path: the file.
        name: of the site, where the file gives it none.
        metres_per_unit: what one unit of its coordinates is; None takes the file's word.

    Raises:
        UsageError: the file is of another kind.
        SiteError: it cannot be read, or what is drawn breaks the format of a site; one line says what and where.
    """
    if path.suffix.lower() not in (".geojson", ".json", ".svg"):
        raise UsageError(f"cannot read a site from {path}", advice="name a .geojson or .svg file")
    try:
        with path.open(encoding="utf-8-sig") as file:
            text = file.read(MOST_CHARACTERS + 1)
    except OSError as problem:
        raise SiteError(f"cannot read {path}: {problem.strerror or problem}") from problem
    except UnicodeDecodeError as problem:
        raise SiteError(f"cannot read {path}: it is no text in UTF-8") from problem
    if len(text) > MOST_CHARACTERS:
        raise SiteError(f"{path} is longer than {MOST_CHARACTERS:,} characters")
    left_out = 0
    if path.suffix.lower() == ".svg":
        features, head, left_out = read_svg(text, str(path), metres_per_unit)
    else:
        features, head = read_geojson(text, str(path), metres_per_unit)
    if not features:
        raise SiteError(
            f"{path} has nothing of a site in it",
            advice="put its shapes into groups named rooms, walls, doors, windows, objects and starts"
            if path.suffix.lower() == ".svg"
            else "give each feature its property kind",
        )
    plain = re.sub(r"[^a-z0-9_-]+", "-", name.lower()).strip("-_") or "site"
    content, lacks = content_of(features, {"name": plain, **head}, str(path))
    return DrawnSite(content, lacks, left_out)
