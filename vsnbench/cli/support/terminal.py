"""Console of the commands' results, and text from the record in rich's markup."""

import os
import sys
from typing import TYPE_CHECKING

from vsnbench.text.sanitize import sanitize

if TYPE_CHECKING:
    from vsnbench.text.terminal import Console


COLORS = {"success": "green", "failure": "red", "void": "yellow", "running": "cyan", "unjudged": "magenta"}
"""Color of each outcome of an episode."""


def page() -> "Console":
    """Return a rich console for stdout. A pipe is 200 columns wide, or `$COLUMNS`."""
    from vsnbench.text.terminal import Console

    has_width = sys.stdout.isatty() or os.environ.get("COLUMNS", "").isdecimal()
    return Console(highlight=False, width=None if has_width else 200)


def safe(text: object) -> str:
    """Return text from the record with rich's markup and terminal escapes disabled."""
    from rich.markup import escape

    return escape(sanitize(str(text)))
