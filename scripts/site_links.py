"""Adapts pages that are written for GitHub to MkDocs (`mkdocs.yml`, hooks).

MkDocs needs an empty line before a list. A link out of docs/ leads to a file that the website does not have; it becomes
plain text with the file's path.
"""

import re
from itertools import groupby
from operator import itemgetter
from typing import Any

_FENCE = re.compile(r"^ {0,3}(```|~~~)")
_ITEM = re.compile(r"^([-*]|\d+\.) ")
_OUTSIDE = re.compile(r"\[([^\]]+)\]\(\.\./([^)#]+)[^)]*\)")
_MARKER = re.compile(r"^<!-- (output of|file): .* -->\n", re.MULTILINE)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Return a page's Markdown for MkDocs."""
    lines: list[str] = []
    in_fence: list[bool] = []
    fenced = False
    for line in _MARKER.sub("", markdown).splitlines():
        before = lines[-1] if lines else ""
        fenced ^= bool(_FENCE.match(line))
        begins_list = _ITEM.match(line) and before.strip() and not _ITEM.match(before) and not before.startswith(" ")
        if not fenced and begins_list and not before.startswith(("#", "|")):
            lines.append("")
            in_fence.append(False)
        lines.append(line)
        in_fence.append(fenced)
    # A link can extend over two lines.
    blocks = groupby(zip(in_fence, lines, strict=True), key=itemgetter(0))
    texts = [(inside, "\n".join(line for _, line in block)) for inside, block in blocks]
    return "\n".join(text if inside else _OUTSIDE.sub(_as_path, text) for inside, text in texts) + "\n"


def _as_path(link: "re.Match[str]") -> str:
    text, path = link.groups()
    return text if path in text else f"{text} (`{path}`)"


def on_post_page(output: str, **_: Any) -> str:
    """Return a finished page with a label for the search dialog, for screen readers."""
    return output.replace(
        'data-md-component="search" role="dialog"', 'data-md-component="search" role="dialog" aria-label="Search"'
    )
