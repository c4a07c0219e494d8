"""The reference pages cover what the program prints: keys of JSON output, options, table headings."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from tests.docs.pages import ROOT
from tests.report.records import Attempt, Lab
from vsnbench.cli.main import build_app
from vsnbench.protocol.disturbances import KINDS
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.results.second_judgements import Outcome

FREE_KEYS = {"protocol", "conditions", "settings", "kinds", "touched", "stages"}
"""Objects whose keys depend on the model, the robot or the site."""


def attempts(successes: int, *, starts: int = 15, operator: str = "") -> list[Attempt]:
    ends = {15: EndReason.COLLISION}
    return [
        Attempt(
            start=start,
            success=start <= successes,
            end_reason=ends.get(start, EndReason.STOP),
            distance_m=0.5 if start <= successes else 3.0,
            operator=operator,
        )
        for start in range(1, starts + 1)
    ]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record with every kind of table: several models, seeds, operators, real and simulated trials."""
    lab = Lab(tmp_path_factory.mktemp("results"))
    for model, successes in (("vlv", 9), ("pirlnav", 6), ("forward", 2)):
        lab.write(attempts(successes, operator="Ana"), model=model, simulated=False)
        lab.write(attempts(successes + 1), model=model)
        lab.write(attempts(successes), model=model, seed=1)
    lab.write(attempts(5, operator="Ben"), model="vlv", simulated=False, seed=1)
    lab.write(attempts(6, starts=10), model="random", simulated=False)
    lab.write(attempts(7), model="random")
    with lab.journal() as journal:
        journal.judge(1, Verdict(EndReason.COLLISION, False, "contact with the bed"), author="Ana")
        for number, outcome in ((16, Outcome.SUCCESS), (30, Outcome.SUCCESS)):
            journal.judge_second(number, "Grace", outcome, "0.5 m to the nearest chair")
    return lab.directory


def output(*words: str) -> str:
    answer = CliRunner().invoke(build_app(words[0]), list(words))
    assert answer.exit_code == 0, answer.output
    return answer.stdout


def keys(value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        for key, each in value.items():
            yield key
            if key not in FREE_KEYS:
                yield from keys(each)
    elif isinstance(value, list):
        for each in value:
            yield from keys(each)


def documented(*sections: str) -> set[str]:
    text = (ROOT / "docs" / "json.md").read_text(encoding="utf-8")
    parts = [text.split(f"\n## {section}\n")[1].split("\n## ")[0] for section in sections]
    return set(re.findall(r"`([a-z_0-9]+)`", "\n".join(parts)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "sections"),
    [
        (("episodes", "list", "--json"), ["episodes list"]),
        (("report", "--format", "json"), ["report", "compare"]),
        (("report", "--format", "json", "--reference", "paper"), ["report", "compare"]),
        (("compare", "vlv real", "pirlnav real", "forward real", "--format", "json"), ["report", "compare"]),
    ],
    ids=" ".join,
)
def test_every_key_of_json_output_is_documented(results: Path, words: tuple[str, ...], sections: list[str]) -> None:
    printed = json.loads(output(*words, "--results", str(results)))
    assert set(keys(printed)) - documented(*sections) == set()


@pytest.mark.slow
def test_every_documented_key_of_the_report_exists(results: Path) -> None:
    text = (ROOT / "docs" / "json.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`[^|]*`) \|", text.split("\n## report\n")[1].split("\n## compare\n")[0], re.MULTILINE)
    named = {name for row in rows for name in re.findall(r"`([a-z_0-9]+)`", row)}
    printed = json.loads(output("report", "--format", "json", "--results", str(results)))
    assert named - set(keys(printed)) == set()


def test_every_key_of_a_site_check_is_documented(tmp_path: Path) -> None:
    (tmp_path / "site.yaml").write_text((ROOT / "vsnbench/cli/starter/lab.yaml").read_text(encoding="utf-8"))
    printed = json.loads(output("sites", "check", str(tmp_path / "site.yaml"), "--json"))
    assert set(keys(printed)) - documented("sites check") == set()


def test_every_disturbance_is_on_the_page_of_stress_tests_with_its_unit_and_severities() -> None:
    page = (ROOT / "docs" / "stress.md").read_text(encoding="utf-8").split("\n## Disturbances\n")[1].split("\n## ")[0]
    rows = re.findall(r"^\| `([a-z_]+)` \| .* \| (\w+) \| ([-\d., ]+) \|$", page, re.MULTILINE)
    assert rows == [(kind.name, kind.unit, ", ".join(f"{value:g}" for value in kind.values)) for kind in KINDS.values()]


def glossary(section: str) -> str:
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    return text.split(f"\n## {section}\n")[1].split("\n## ")[0]


def test_every_option_of_run_is_in_the_glossary() -> None:
    command: Any = typer.main.get_command(build_app("run"))
    command = getattr(command, "commands", {"run": command})["run"]
    options = {name for parameter in command.params for name in parameter.opts if name.startswith("--")}
    assert options - {"--help"} - set(re.findall(r"`(--[a-z-]+)`", glossary("Options of vsnbench run"))) == set()


@pytest.mark.slow
def test_every_table_heading_is_in_the_glossary(results: Path) -> None:
    terms = {
        term
        for row in re.findall(r"^\| ([^|]*) \|", glossary("Table headings"), re.MULTILINE)
        for term in row.split(", ")
    }
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
    assert headings - goals - terms == set()


def test_terms_are_in_alphabetical_order() -> None:
    terms = re.findall(r"^- \*\*(.+?)\*\*: ", glossary("Concepts"), re.MULTILINE)
    assert len(terms) > 50
    assert terms == sorted(terms, key=str.lower)
