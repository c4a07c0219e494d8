"""Fills the pages of docs/ with what commands print, by running them, and with files as they are.

A page says `<!-- output of: vsnbench ... -->` or `<!-- file: PATH -->` on a line, and the block after it is filled.
Only commands that print the same on every machine are marked so: a test runs them again. All of a page's run in one
scratch directory, one after the other, at 80 columns.
"""

import contextlib
import io
import logging
import os
import re
import shlex
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

ROOT = Path(__file__).resolve().parent.parent
COLUMNS = "80"
_MARKED = re.compile(r"(<!-- (output of|file): (.+?) -->\n```\w+\n)(.*?)(```\n)", re.DOTALL)


def filled(page: str) -> str:
    """Return a page with every marked block as it is today."""
    if not _MARKED.search(page):
        return page
    with tempfile.TemporaryDirectory() as scratch, contextlib.chdir(scratch):
        return _MARKED.sub(_fill, page)


def pages() -> Iterator[Path]:
    """Yield the pages that have such blocks."""
    for page in sorted((ROOT / "docs").glob("*.md")):
        if _MARKED.search(page.read_text(encoding="utf-8")):
            yield page


def _fill(block: "re.Match[str]") -> str:
    head, kind, what, _, end = block.groups()
    text = (ROOT / what).read_text(encoding="utf-8") if kind == "file" else f"$ {what}\n{output_of(what)}"
    return f"{head}{text.rstrip()}\n{end}"


def output_of(line: str) -> str:
    """Return what a command line prints, results and notes as a terminal shows them together."""
    from vsnbench.cli.main import main

    words = shlex.split(line)
    said = dict(word.split("=", 1) for word in words[: words.index("vsnbench")])
    typed = words[words.index("vsnbench") :]
    kept = {name: value for name, value in os.environ.items() if not name.startswith("VSNBENCH_")}
    terminal = {"COLUMNS": COLUMNS, "NO_COLOR": "1", "TERM": "dumb"}
    heard = io.StringIO()
    with (
        patch.dict(os.environ, kept | terminal | said, clear=True),
        patch.object(sys, "argv", typed),
        patch.object(logging, "basicConfig"),
        contextlib.redirect_stdout(heard),
        contextlib.redirect_stderr(heard),
        contextlib.suppress(SystemExit),
    ):
        main()
    return "\n".join(text.rstrip() for text in heard.getvalue().splitlines())


def main() -> None:
    """Fill every page."""
    for page in pages():
        page.write_text(filled(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    main()
