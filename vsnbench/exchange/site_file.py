"""Writes a site, or a draft of one, as the YAML file that `load_site` reads back to the same content."""

from pathlib import Path
from typing import Any

import yaml

from vsnbench.errors import SiteError
from vsnbench.protocol.site import Site
from vsnbench.whole_files import write_whole

_FRAME = "metres, x to the right, y up on the plan, headings counter-clockwise."


def site_yaml(site: Site, made_by: str = "sites generate") -> str:
    """Return a site as YAML text: one line for each wall, door, object and starting position."""
    return draft_yaml(site.model_dump(mode="json", exclude_defaults=True), made_by)


def draft_yaml(content: dict[str, Any], made_by: str) -> str:
    """Return the plain values of a site as YAML text; lists may be missing or empty, `made_by` is the verb."""
    head = {key: content[key] for key in ("name", "title", "ceiling_height_m", "survey_error_m") if key in content}
    lines = [f"# Made by `vsnbench {made_by}`; {_FRAME}\n"]
    lines.append(yaml.safe_dump(head, sort_keys=False, allow_unicode=True))
    for part in ("rooms", "walls", "doors", "windows", "objects", "starts"):
        if content.get(part):
            lines.append(f"\n{part}:\n")
            lines += [f"  - {_one_line(entry)}\n" for entry in content[part]]
    return "".join(lines)


def write_site(site: Site, path: Path) -> None:
    """Write a site's file whole or not at all.

    Raises:
        SiteError: it cannot be written.
    """
    write_whole(path, site_yaml(site).encode(), SiteError)


def _one_line(entry: dict[str, Any]) -> str:
    return yaml.safe_dump(entry, default_flow_style=True, sort_keys=False, width=10_000, allow_unicode=True).strip()
