"""The address of a database: the URL of an SQLite file, and any URL as it may be printed."""

from pathlib import Path

from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError

from vsnbench.errors import UsageError


def sqlite_url(path: Path) -> str:
    """Return the URL of an SQLite file."""
    return URL.create("sqlite", database=str(path)).render_as_string(hide_password=False)


def sqlite_path(url: str) -> Path | None:
    """Return the file behind an SQLite URL; None for another database."""
    parsed = parse_url(url)
    return Path(parsed.database) if parsed.get_backend_name() == "sqlite" and parsed.database else None


def shown_url(url: str) -> str:
    """Return the database as it may be printed: SQLite's file, or the URL without its password."""
    file = sqlite_path(url)
    return str(file) if file else parse_url(url).render_as_string(hide_password=True)


def parse_url(url: str) -> URL:
    """Return the parts of a database URL.

    Raises:
        UsageError: it is not one.
    """
    try:
        return make_url(url)
    except ArgumentError as error:
        raise UsageError(
            f"{url!r} is not a database URL: write sqlite:///path/vsnbench.db or postgresql+psycopg://user@host/name"
        ) from error
