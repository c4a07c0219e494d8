"""Fills blocks in docs/ with command output, file contents, and tables of movements and sensors.

A page marks a block with `<!-- output of: vsnbench ... -->` or `<!-- file: PATH -->` on the line before it, and a table
with `<!-- movements as: answers -->` or `<!-- sensors -->`. Commands of a page run in order in one temporary directory,
at 80 columns. A test runs them again, so their output must not depend on the machine.
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
_MARKED = re.compile(r"(<!-- (output of|file): (.+?) -->\n```\w+\n)(.*?)(```\n)", re.DOTALL)
_TABLES = re.compile(r"(<!-- (?:movements as: (\w+)|sensors) -->\n\n)(?:\|.*\n)*")


def filled(page: str) -> str:
    """Return a page with current contents in every marked block."""
    page = _TABLES.sub(_tabulate, page)
    if not _MARKED.search(page):
        return page
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        return _MARKED.sub(_fill, page)


def pages() -> Iterator[Path]:
    """Yield the pages with marked blocks."""
    for page in sorted((ROOT / "docs").glob("*.md")):
        text = page.read_text(encoding="utf-8")
        if _MARKED.search(text) or _TABLES.search(text):
            yield page


def _fill(block: "re.Match[str]") -> str:
    head, kind, what, _, end = block.groups()
    text = (ROOT / what).read_text(encoding="utf-8") if kind == "file" else f"$ {what}\n{output_of(what)}"
    return f"{head}{text.rstrip()}\n{end}"


def _tabulate(block: "re.Match[str]") -> str:
    from scripts import movements, sensors

    return f"{block[1]}{movements.table(block[2]) if block[2] else sensors.table()}"


def output_of(line: str, columns: int = 80) -> str:
    """Return stdout and stderr of a command line, run in this process."""
    from vsnbench.cli.main import main

    words = shlex.split(line)
    command = words.index("vsnbench")
    kept = {
        name: value for name, value in os.environ.items() if not name.startswith("VSNBENCH_") and name != "FORCE_COLOR"
    }
    terminal = {"COLUMNS": str(columns), "NO_COLOR": "1", "TERM": "dumb"}
    given = dict(word.split("=", 1) for word in words[:command])
    output = io.StringIO()
    with (
        patch.dict(os.environ, kept | terminal | given, clear=True),
        patch.object(sys, "argv", words[command:]),
        patch.object(logging, "basicConfig"),
        contextlib.redirect_stdout(output),
        contextlib.redirect_stderr(output),
        contextlib.suppress(SystemExit),
    ):
        main()
    return "\n".join(text.rstrip() for text in output.getvalue().splitlines()).strip("\n")


def main() -> None:
    """Fill every page."""
    for page in pages():
        page.write_text(filled(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    main()
