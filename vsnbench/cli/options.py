"""Options that several verbs share, so that one word means the same everywhere."""

from pathlib import Path
from typing import Annotated

import typer

RECORD_PANEL = "Record"
"""Heading under which `--help` lists them."""

Results = Annotated[
    Path | None,
    typer.Option(
        "--results",
        help="results directory; $VSNBENCH_RESULTS, then ./results, when absent",
        rich_help_panel=RECORD_PANEL,
    ),
]
Database = Annotated[
    str | None,
    typer.Option(
        "--db",
        help="SQLAlchemy URL (postgresql+psycopg://...) in place of the directory's SQLite",
        rich_help_panel=RECORD_PANEL,
    ),
]
