"""Writes a site as a YAML file that `load_site` reads back unchanged."""

from pathlib import Path

from vsnbench.errors import SiteError
from vsnbench.files.atomic import write_atomic
from vsnbench.settings.yaml_text import dump_yaml
from vsnbench.sites.site import Site

_FRAME = "metres, x to the right, y up on the plan, headings counter-clockwise."


def site_yaml(site: Site, made_by: str = "`vsnbench sites generate`") -> str:
    """Return a site as YAML: one line per wall, door, object and starting position."""
    content = site.model_dump(mode="json", exclude_defaults=True)
    names = ("name", "title", "ceiling_height_m", "survey_error_m", "scan")
    head = {key: content[key] for key in names if key in content}
    lines = [f"# Made by {made_by}; {_FRAME}\n"]
    lines.append(f"{dump_yaml(head)}\n")
    for part in ("rooms", "walls", "doors", "windows", "objects", "starts"):
        if content.get(part):
            lines.append(f"\n{part}:\n")
            lines += [f"  - {dump_yaml(entry, one_line=True)}\n" for entry in content[part]]
    return "".join(lines)


def write_site(site: Site, path: Path) -> None:
    """Write a site's file atomically.

    Raises:
        SiteError: the file cannot be written.
    """
    write_atomic(path, site_yaml(site).encode(), SiteError)
