"""Passwords of database URLs never reach the screen, the record, or a command line."""

import shlex

import pytest

from vsnbench.errors import UsageError
from vsnbench.results.database_url import (
    command_without_passwords,
    libpq_connection,
    parse_url,
    redacted_url,
)

DRIVERS = ["postgresql", "postgresql+psycopg", "postgresql+psycopg2", "postgresql+asyncpg", "postgresql+pg8000"]


@pytest.mark.parametrize("driver", DRIVERS)
def test_every_spelling_of_a_driver_reaches_libpq_alike(driver: str) -> None:
    string, secrets = libpq_connection(f"{driver}://lab:p%40ss%2Fword@db.lab:5433/trials?sslmode=disable")
    assert string == "host='db.lab' port='5433' user='lab' dbname='trials' sslmode='disable'"
    assert secrets == {"PGPASSWORD": "p@ss/word"}


def test_what_a_connection_string_would_misread_is_escaped() -> None:
    string, secrets = libpq_connection("postgresql://o%27hara%20%5C@h/d")
    assert string == r"host='h' user='o\'hara \\' dbname='d'"
    assert secrets == {}, "libpq reads ~/.pgpass"


def test_a_password_given_as_a_parameter_is_one_too() -> None:
    url = "postgresql+psycopg://lab@h/d?password=secret&sslmode=require"
    assert redacted_url(url) == "postgresql+psycopg://lab@h/d?sslmode=require"
    assert libpq_connection(url) == ("host='h' user='lab' dbname='d' sslmode='require'", {"PGPASSWORD": "secret"})


def test_another_kind_of_database_has_no_backup_of_ours() -> None:
    with pytest.raises(UsageError, match="neither SQLite nor PostgreSQL") as caught:
        libpq_connection("mysql://lab:secret@h/d")
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize(
    ("typed", "kept"),
    [
        ("--db postgresql+psycopg://lab:secret@h/d", "--db postgresql+psycopg://lab:***@h/d"),
        ("--db=postgresql://lab:sec/r@et@h/d --seed 1", "--db=postgresql://lab:***@h/d --seed 1"),
        ("'--db=postgresql://:secret@h/d'", "'--db=postgresql://:***@h/d'"),
        ("--db postgresql://lab@h/d?sslmode=x&password=secret", "--db postgresql://lab@h/d?sslmode=x&password=***"),
        ("--note mail:anna@lab --results a:b", "--note mail:anna@lab --results a:b"),
    ],
)
def test_a_command_line_is_kept_without_passwords(typed: str, kept: str) -> None:
    assert shlex.split(command_without_passwords(shlex.split(typed))) == shlex.split(kept)


def test_a_password_with_a_blank_is_hidden_in_a_command() -> None:
    words = ["run", "--db", "postgresql://lab:my secret@h/d?sslmode=require", "--note", "a b"]
    assert command_without_passwords(words) == "run --db 'postgresql://lab:***@h/d?sslmode=require' --note 'a b'"
    assert "secret" not in command_without_passwords(["--db", "postgresql://h/d?password=my secret&sslmode=require"])


@pytest.mark.parametrize("url", ["postgresql://lab:secret@h:port/d", "postgresql+a+b://lab:secret@h/d"])
def test_what_is_no_url_is_said_without_its_password(url: str) -> None:
    with pytest.raises(UsageError, match="not a database URL") as caught:
        parse_url(url)
    assert "secret" not in str(caught.value)
