"""What a page of docs/ needs on its way into the site: it is written to be read in the repository as well.

A list straight after a line of text begins a list there, and has to begin one here; a link out of docs/ leads to a file
of the repository, which the site has not, and becomes its path. MkDocs calls `on_page_markdown` (`mkdocs.yml`, hooks).
"""

import re
from typing import Any

_FENCE = re.compile(r"^ {0,3}(```|~~~)")
_ITEM = re.compile(r"^([-*]|\d+\.) ")
_OUTSIDE = re.compile(r"\[([^\]]+)\]\(\.\./([^)#]+)[^)]*\)")
_MARKER = re.compile(r"^<!-- (output of|file): .* -->\n", re.MULTILINE)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Return a page's text as the site's reader of Markdown wants it."""
    lines: list[str] = []
    fenced = False
    for line in _MARKER.sub("", markdown).splitlines():
        before = lines[-1] if lines else ""
        fenced ^= bool(_FENCE.match(line))
        begins_list = _ITEM.match(line) and before.strip() and not _ITEM.match(before) and not before.startswith(" ")
        if not fenced and begins_list and not before.startswith(("#", "|")):
            lines.append("")
        lines.append(line if fenced else _OUTSIDE.sub(_as_path, line))
    return "\n".join(lines) + "\n"


def _as_path(link: "re.Match[str]") -> str:
    words, path = link.groups()
    return f"`{path}`" if path in words else f"{words} (`{path}`)"


def on_post_page(output: str, **_: Any) -> str:
    """Return a finished page, whose search says to a screen reader what it is."""
    return output.replace(
        'data-md-component="search" role="dialog"', 'data-md-component="search" role="dialog" aria-label="Search"'
    )
