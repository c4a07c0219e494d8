"""The forms: the numbers scripts rely on, text from the record as text everywhere, and room for narrow terminals."""

import csv
import io
import json
import re
from pathlib import Path

import pytest
from rich.console import Console

from tests.report.records import Attempt, Lab, void
from vsnbench.database.campaign_plan import PlannedTrial
from vsnbench.report.build import Report, build
from vsnbench.report.forms.latex import document, latex
from vsnbench.report.forms.latex import escaped as latex_escaped
from vsnbench.report.forms.markdown import markdown
from vsnbench.report.forms.plain import to_csv, to_json
from vsnbench.report.forms.terminal import print_sheets
from vsnbench.report.record import Selection
from vsnbench.report.reference_tables import reference_sheets
from vsnbench.report.sheets import fitted

HOSTILE = "<script>alert(1)</script> \\input{/etc/passwd} $x_1$ & | `a` **b** [red]c[/red] \x1b[31m\u202eevil %d"


@pytest.fixture
def hostile(tmp_path: Path) -> Report:
    lab = Lab(tmp_path)
    planned = [PlannedTrial(goal, 1) for goal in ("chair", HOSTILE)]
    lab.write([void(), Attempt(), Attempt(HOSTILE, success=False)], model=HOSTILE, weights_label="=1+1", trials=planned)
    return build(lab.url, Selection())


def test_json_has_the_fields_scripts_rely_on(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.write([void(), Attempt(actions=12), Attempt(start=2, success=False, actions=30)])
    (model,) = json.loads(to_json(build(lab.url, Selection()).results))["models"]
    assert model["total"] | {"ci_low": 0, "ci_high": 0} == model["total"] | {
        "successes": 1,
        "episodes": 2,
        "planned": 2,
        "coverage": 1.0,
        "void": 1,
        "success_rate": 0.5,
        "mean_actions": 21.0,
        "mean_actions_successful": 12.0,
        "spl": 0.5,
        "ci_low": 0,
        "ci_high": 0,
    }
    assert model["total"]["ci_low"] == pytest.approx(0.0945, abs=1e-4)
    assert [goal["goal"] for goal in model["goals"]] == ["chair"]


def test_json_and_csv_say_null_and_nothing_for_what_is_unknown(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.write([void()])
    results = build(lab.url, Selection()).results
    total = json.loads(to_json(results))["models"][0]["total"]
    assert total["success_rate"] is None
    assert total["ci_low"] is None
    assert "NaN" not in to_json(results)
    (_, line) = csv.DictReader(io.StringIO(to_csv(results)))
    assert line["goal"] == "total"
    assert line["success_rate"] == ""


def test_csv_starts_no_formula_and_sends_no_escape(hostile: Report) -> None:
    text = to_csv(hostile.results)
    assert "\x1b" not in text
    assert next(csv.DictReader(io.StringIO(text)))["weights_label"] == "'=1+1"


def test_a_terminal_gets_no_control_character_from_the_record(hostile: Report) -> None:
    out = io.StringIO()
    print_sheets(hostile.sheets(long=True), Console(file=out, width=250, color_system=None))
    assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f\u202e]", out.getvalue())
    assert "[red]c[/red]" in out.getvalue()


def test_markdown_shows_markup_as_text(hostile: Report) -> None:
    text = markdown(hostile.sheets())
    assert "<script>" not in text
    assert r"\<script\>alert(1)\</script\>" in text
    row = next(line for line in text.splitlines() if line.startswith("| \\<script"))
    assert len(re.findall(r"(?<!\\)\|", row)) == len(hostile.sheets()[0].columns) + 1


def test_latex_runs_no_command_from_the_record(hostile: Report) -> None:
    text = latex(hostile.sheets())
    assert r"\input" not in text
    assert r"\textbackslash{}input\{/etc/passwd\}" in text
    assert "\x1b" not in text
    for table in text.split(r"\begin{table}")[1:]:
        columns = table.split(r"\begin{tabular}{@{}")[1].split("@{}")[0]
        body = table.split(r"\midrule", 1)[1]
        for line in body.splitlines():
            if line.endswith(r"\\"):
                assert len(re.findall(r"(?<!\\)&", line)) == len(columns) - 1
                assert not line.startswith(("[", "*"))
        assert r"\toprule" in table
        assert r"\bottomrule" in table


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("50 %", r"50 \%"),
        ("a_b^c~d", r"a\_b\textasciicircum{}c\textasciitilde{}d"),
        ("[x]", "{[}x]"),
        ("75 m²", r"75 m\textsuperscript{2}"),
        ("a--b", "a-{}-b"),
        ("椅子", "U+6905U+5B50"),
        ("Gutiérrez", "Gutiérrez"),
    ],
)
def test_latex_escapes(text: str, expected: str) -> None:
    assert latex_escaped(text) == expected


def test_a_latex_caption_says_what_n_and_the_interval_are(hostile: Report) -> None:
    caption = re.search(r"\\caption\{(.*)\}\n", latex(hostile.sheets()))
    assert caption
    assert "n = 2 episodes of 2 planned trials" in caption[1]
    assert "Wilson's interval of the success rate" in caption[1]


def test_the_document_loads_what_its_tables_need() -> None:
    text = document(reference_sheets())
    assert text.index(r"\usepackage{booktabs}") < text.index(r"\begin{document}") < text.index(r"\toprule")
    assert text.count(r"\begin{tabular}") == text.count(r"\end{tabular}") == len(reference_sheets())


@pytest.mark.parametrize("width", [60, 80, 100, 140])
def test_a_narrow_terminal_keeps_the_rates_whole(tmp_path: Path, width: int) -> None:
    lab = Lab(tmp_path)
    lab.write([Attempt(start=start, success=start < 9) for start in range(1, 16)])
    out = io.StringIO()
    print_sheets(build(lab.url, Selection(), activity=False).sheets(), Console(file=out, width=width))
    for words in ("8/15", "53.33", "[30.12, 75.19]", "15/15"):
        assert words in out.getvalue()
    assert max(map(len, out.getvalue().splitlines())) <= width
    assert ("No room here for" in out.getvalue()) == (width < 140)


def test_columns_without_a_rank_stay(hostile: Report) -> None:
    sheet = fitted(hostile.sheets()[0], lambda part: False)
    assert [column.heading for column in sheet.columns] == ["goal", "k/n", "SR %", "95 % interval", "actions", "done"]
