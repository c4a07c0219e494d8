"""Writes a site as the YAML file that `load_site` reads back to the same content."""

import os
from pathlib import Path
from typing import Any

import yaml

from vsnbench.protocol.site import Site


def site_yaml(site: Site) -> str:
    """Return a site as YAML text: one line for each wall, door, object and starting position."""
    content = site.model_dump(mode="json", exclude_defaults=True)
    head = {key: content[key] for key in ("name", "title", "ceiling_height_m") if key in content}
    lines = [
        "# Made by `vsnbench sites generate`; metres, x to the right, y up on the plan, headings counter-clockwise.\n"
    ]
    lines.append(yaml.safe_dump(head, sort_keys=False, allow_unicode=True))
    for part in ("rooms", "walls", "doors", "windows", "objects", "starts"):
        if content.get(part):
            lines.append(f"\n{part}:\n")
            lines += [f"  - {_one_line(entry)}\n" for entry in content[part]]
    return "".join(lines)


def write_site(site: Site, path: Path) -> None:
    """Write a site's file whole or not at all.

    Raises:
        OSError: it cannot be written.
    """
    half = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        half.write_text(site_yaml(site), encoding="utf-8")
        half.replace(path)
    finally:
        half.unlink(missing_ok=True)


def _one_line(entry: dict[str, Any]) -> str:
    return yaml.safe_dump(entry, default_flow_style=True, sort_keys=False, width=10_000, allow_unicode=True).strip()
