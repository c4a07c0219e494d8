"""The reference pages cover what the program prints: disturbances, table headings."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scripts.headings_page import meanings
from tests.docs.json_records import write_rich_record
from tests.docs.pages import ROOT
from vsnbench.cli.main import build_app
from vsnbench.protocol.disturbances import KINDS


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record with every kind of table."""
    return write_rich_record(tmp_path_factory.mktemp("results"))


def output(*words: str) -> str:
    answer = CliRunner().invoke(build_app(words[0]), list(words))
    assert answer.exit_code == 0, answer.output
    return answer.stdout


def test_every_disturbance_is_documented_with_its_unit_and_severities() -> None:
    page = (ROOT / "docs" / "stress.md").read_text(encoding="utf-8").split("\n## Disturbances\n")[1].split("\n## ")[0]
    rows = re.findall(r"^\| `([a-z_]+)` \| .* \| (\w+) \| ([-\d., ]+) \|$", page, re.MULTILINE)
    assert rows == [(kind.name, kind.unit, ", ".join(f"{value:g}" for value in kind.values)) for kind in KINDS.values()]


PLAIN = {"n", "part", "real k/n", "rule", "seed", "shortest path", "virtual SR %"}
"""Headings of columns that functions add, which need no explanation."""


def test_the_page_of_headings_knows_every_heading_of_a_table(results: Path) -> None:
    pages = [
        output("report", "--all-tables", "--format", "markdown", "--results", str(results)),
        output("report", "--only-reference", "--format", "markdown", "--results", str(results)),
        output(
            "compare", "vlv real", "pirlnav real", "forward real", "--format", "markdown", "--results", str(results)
        ),
    ]
    rows = [row for page in pages for row in re.findall(r"^\|(.*)\|\n\| *:?-", page, re.MULTILINE)]
    headings = {heading.strip() for row in rows for heading in row.split("|")}
    goals = {"chair", "bed", "sofa", "table", "toilet", "plant", "monitor", ""}
    assert headings - goals - meanings().keys() == PLAIN


def test_terms_are_in_alphabetical_order() -> None:
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    terms = re.findall(r"^- \*\*(.+?)\*\*: ", text, re.MULTILINE)
    assert len(terms) > 35
    assert terms == sorted(terms, key=str.lower)
