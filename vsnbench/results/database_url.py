"""Database URLs: SQLite paths, redaction of passwords and connection parameters."""

import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError

from vsnbench.errors import UsageError

HIDDEN = "***"
_KEPT = rf"\g<before>{HIDDEN}"
_KIND = re.compile(r"\w+(\+\w+)?")
_SECRET_PARAMETER = re.compile(r"pass(word|wd)?$|secret|token", re.IGNORECASE)
_PASSWORD = re.compile(r"(?P<before>[a-z][\w+.-]*://[^/\s:@]*:).*(?=@)", re.IGNORECASE | re.DOTALL)
_PARAMETER = re.compile(r"(?P<before>[?&][\w-]*(?:password|passwd|secret|token)=)[^&]*", re.IGNORECASE)


def sqlite_url(path: Path) -> str:
    """Return the URL of an SQLite file.

    Raises:
        UsageError: the path is not valid UTF-8, which SQLite needs.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise UsageError(
            f"the path {path} is not valid UTF-8, which SQLite needs",
            advice="rename the directory, or name another one",
            code="path-not-utf8",
        ) from error
    return URL.create("sqlite", database=str(path)).render_as_string(hide_password=False)


def sqlite_path(url: str) -> Path | None:
    """Return the path of an SQLite URL; None for other databases."""
    parsed = parse_url(url)
    return Path(parsed.database) if parsed.get_backend_name() == "sqlite" and parsed.database else None


def redacted_url(url: str) -> str:
    """Return a database without its password: the path of an SQLite file, or the URL."""
    file = sqlite_path(url)
    if file:
        return str(file)
    parsed = parse_url(url)
    secrets = [name for name in parsed.query if _SECRET_PARAMETER.search(name)]
    return parsed.difference_update_query(secrets).render_as_string(hide_password=True)


def without_passwords(text: str) -> str:
    """Return a URL, or an argument that may contain one, with its password hidden, which may contain blanks."""
    return _PARAMETER.sub(_KEPT, _PASSWORD.sub(_KEPT, text))


def command_without_passwords(arguments: Sequence[str]) -> str:
    """Return a command line with the passwords of all URLs hidden."""
    return shlex.join(map(without_passwords, arguments))


def libpq_connection(url: str) -> tuple[str, Mapping[str, str]]:
    """Return a connection string and environment variables for PostgreSQL's programs.

    The password is passed in the environment, because command lines are visible to other users. Without a password in
    the URL, libpq uses `~/.pgpass` and `PGPASSWORD`.

    Args:
        url: `postgresql://` with any driver (`postgresql+psycopg2://`).

    Raises:
        UsageError: it is another kind of database.
    """
    parsed = parse_url(url)
    if parsed.get_backend_name() != "postgresql":
        raise UsageError(f"{redacted_url(url)} is neither SQLite nor PostgreSQL: use its own backup tools")
    query = {name: value if isinstance(value, str) else ",".join(value) for name, value in parsed.query.items()}
    password = parsed.password or query.get("password")
    named = {"host": parsed.host, "port": parsed.port, "user": parsed.username, "dbname": parsed.database}
    settings = {name: str(value) for name, value in named.items() if value is not None}
    settings |= {name: value for name, value in query.items() if not _SECRET_PARAMETER.search(name)}
    string = " ".join(f"{name}='{_escaped(value)}'" for name, value in settings.items())
    return string, {} if password is None else {"PGPASSWORD": str(password)}


def _escaped(value: str) -> str:
    return value.replace("\\", "\\\\").replace("'", "\\'")


def parse_url(url: str) -> URL:
    """Return the parts of a database URL.

    Raises:
        UsageError: the URL is invalid.
    """
    try:
        parsed = make_url(url)
        if not _KIND.fullmatch(parsed.drivername):
            raise ValueError("a kind of database, and at most one driver")
    except (ArgumentError, ValueError) as error:  # ValueError: also an invalid port
        raise UsageError(
            f"{without_passwords(url)!r} is not a database URL",
            advice="write sqlite:///path/vsnbench.db or postgresql+psycopg://user@host/name",
        ) from error
    return parsed
