"""Output formats: numbers for scripts, escaped texts of the record, and narrow terminals."""

import csv
import io
import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from tests.report.records import Attempt, Lab, step, void
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.build import Report, build
from vsnbench.report.formats.csv import to_csv
from vsnbench.report.formats.html import html_page
from vsnbench.report.formats.json import to_json
from vsnbench.report.formats.latex import document, latex
from vsnbench.report.formats.latex import escaped as latex_escaped
from vsnbench.report.formats.markdown import markdown
from vsnbench.report.table import ReportTable, fitted, print_tables
from vsnbench.report.tables.reference import reference_tables
from vsnbench.report.tables.success import goal_table, overview_table
from vsnbench.results.writing.campaigns import Trial
from vsnbench.values.movement import Action

HOSTILE = "<script>alert(1)</script> \\input{/etc/passwd} $x_1$ & | `a` **b** [red]c[/red] \x1b[31m\u202eevil %d"


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Report:
    """A report whose names try to be markup in every form."""
    lab = Lab(tmp_path_factory.mktemp("hostile"))
    planned = [Trial(goal, 1) for goal in ("chair", HOSTILE)]
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


def test_json_holds_all_that_a_report_knows(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    steps = [step(1, Action.MOVE_FORWARD), step(2, Action.STOP)]
    for model, seed, limit in (("vlv", 3, 12), ("random", 4, 2)):
        attempts = [Attempt(start=start, success=start <= limit, steps=steps) for start in range(1, 16)]
        lab.write(attempts, model=model, seed=seed)
    report = build(lab.url, Selection())
    content = json.loads(to_json(report.results, report.questions, report.activity, report.record))
    first = content["models"][0]
    assert first["sensitivity"]["recounts"][0]["counted"] == "as judged"
    assert first["sensitivity"]["cells"][0] == {"goal": "chair", "start": 1, "successes": 1, "episodes": 1}
    assert sum(first["failures"]["kinds"].values()) == first["failures"]["failed"] == 3
    assert first["judgements"] is None
    assert content["sim_vs_real"] == []
    assert (first["name"], first["campaigns"], first["seeds"]) == ("vlv", [1], [3])
    assert first["protocol"]["max_actions"] == 150
    assert {each["action"]: each["steps"] for each in first["actions"]} == {"MOVE_FORWARD": 15, "STOP": 15}
    assert [(end["end_reason"], end["counted"]) for end in first["end_reasons"]] == [("stop", 15)]
    (question,) = content["questions"]
    assert question["members"] == ["vlv", "random"]
    (pair,) = question["comparisons"]
    assert (pair["first"]["name"], pair["second"]["name"]) == ("vlv", "random")
    assert pair["rates"][0]["significant"] is True
    assert content["stability"][0]["path_m"] == 60
    assert json.loads(to_json(report.results))["stability"] is None


def test_csv_rows_of_two_settings_can_be_told_apart(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    for cap in (100, 200):
        lab.write([Attempt()], protocol=ProtocolParameters(max_actions=cap), seed=cap)
    lines = list(csv.DictReader(io.StringIO(to_csv(build(lab.url, Selection()).results))))
    assert [(line["name"], line["goal"], line["campaigns"], line["seeds"]) for line in lines] == [
        ("vlv within 100 actions", "chair", "1", "100"),
        ("vlv within 100 actions", "total", "1", "100"),
        ("vlv within 200 actions", "chair", "2", "200"),
        ("vlv within 200 actions", "total", "2", "200"),
    ]


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
    print_tables(hostile.tables(long=True), Console(file=out, width=250, color_system=None))
    assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f\u202e]", out.getvalue())
    assert "[red]c[/red]" in out.getvalue()


def test_markdown_shows_markup_as_text(hostile: Report) -> None:
    text = markdown(hostile.tables())
    assert "<script>" not in text
    assert r"\<script\>alert(1)\</script\>" in text
    row = next(line for line in text.splitlines() if line.startswith("| \\<script"))
    assert len(re.findall(r"(?<!\\)\|", row)) == len(hostile.tables()[0].columns) + 1


def test_latex_runs_no_command_from_the_record(hostile: Report) -> None:
    text = latex(hostile.tables())
    assert r"\input" not in text
    assert r"\textbackslash{}input\{/etc/passwd\}" in text
    assert "\x1b" not in text
    for table in re.split(r"\\begin\{table\*?\}", text)[1:]:
        columns = table.split(r"\begin{tabular}{@{}")[1].split("@{}}")[0]
        columns = re.sub(r">\{\\raggedright\\arraybackslash\}p\{\d+em\}", "l", columns)
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
    caption = re.search(r"\\caption\{(.*)\}\n", latex(hostile.tables()))
    assert caption
    assert "n = 2 episodes of 2 planned trials" in caption[1]
    assert "Wilson's interval of the success rate at the effective sample size" in caption[1]


def test_the_document_loads_what_its_tables_need() -> None:
    text = document(reference_tables())
    assert text.index(r"\usepackage{booktabs}") < text.index(r"\begin{document}") < text.index(r"\toprule")
    assert text.count(r"\begin{tabular}") == text.count(r"\end{tabular}") == len(reference_tables())


def test_latex_shrinks_no_table_by_the_length_of_a_name(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    name = "mylab.policies.semantic:FrontierPolicyWithALongName"
    for model in (name, "vlv"):
        lab.write([Attempt(goal, start) for goal in ("chair", "bed") for start in (1, 2)], model=model)
    tables = latex(build(lab.url, Selection()).tables(long=True))
    assert "resizebox" not in tables
    overview = tables.split(r"\label{tab:overview}")[1].split(r"\end{tabular}")[0]
    assert r"\raggedright\arraybackslash}p{11em}" in overview
    assert r"mylab.\allowbreak{}policies.\allowbreak{}semantic:\allowbreak{}Frontier" in overview
    assert tables.split(r"\label{tab:overview}")[0].rsplit(r"\begin{", 1)[1].startswith("table}"), "it fits a column"


# LaTeX is large and not part of the test set-up. Without it, the tests above check the document's structure, but not
# that it compiles.
@pytest.mark.skipif(
    shutil.which("pdflatex") is None, reason="LaTeX is not part of the test set-up; the tests above check the structure"
)
def test_the_document_compiles_with_several_tables_a_page(tmp_path: Path) -> None:
    (tmp_path / "report.tex").write_text(document(reference_tables()), encoding="utf-8")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "report.tex"]
    outcome = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert outcome.returncode == 0, outcome.stdout[-2000:]
    pages = re.search(r"Output written on report.pdf \((\d+) page", outcome.stdout)
    assert pages
    assert int(pages[1]) < len(reference_tables())
    assert "too wide" not in outcome.stdout
    assert "too large" not in outcome.stdout


def many_tables() -> list[ReportTable]:
    """Return as many tables as a stress test of six disturbances has."""
    table = reference_tables()[0]
    return [replace(table, name=f"{table.name}-{n}") for n in range(100)]


def test_the_page_is_cleared_before_latex_has_more_floats_than_it_queues() -> None:
    tables = many_tables()
    for text in (latex(tables), document(tables)):
        assert max(part.count(r"\begin{table") for part in text.split(r"\clearpage")) <= 12
        assert text.count(r"\begin{table") == len(tables)


@pytest.mark.skipif(
    shutil.which("pdflatex") is None, reason="LaTeX is not part of the test set-up; the tests above check the structure"
)
def test_many_pasted_tables_compile(tmp_path: Path) -> None:
    packages = r"\documentclass[twocolumn]{article}\usepackage[T1]{fontenc}\usepackage{array,booktabs,textcomp}"
    text = f"{packages}\\begin{{document}}\n{latex(many_tables())}\\end{{document}}\n"
    (tmp_path / "paper.tex").write_text(text, encoding="utf-8")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "paper.tex"]
    outcome = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert outcome.returncode == 0, outcome.stdout[-2000:]


@pytest.mark.parametrize("width", [60, 80, 100, 150])
def test_a_narrow_terminal_keeps_the_rates_whole(tmp_path: Path, width: int) -> None:
    lab = Lab(tmp_path)
    lab.write([Attempt(start=start, success=start < 9) for start in range(1, 16)])
    out = io.StringIO()
    print_tables(build(lab.url, Selection(), activity=False).tables(), Console(file=out, width=width))
    for words in ("8/15", "53.33", "[30.12, 75.19]", *(["15/15"] if width >= 80 else [])):
        assert words in out.getvalue()
    assert max(map(len, out.getvalue().splitlines())) <= width
    table = build(lab.url, Selection(), activity=False).tables()[0]
    for column in table.columns:
        shown = all(word in out.getvalue() for word in column.heading.split())
        assert shown, "headings wrap, and a note names what is left out"
    assert out.getvalue().count(" chair ") == 1, "one table, and no total of a single goal"
    assert ("Left out at this width: " in out.getvalue()) == (width < 150)
    assert "void" in out.getvalue().split("Left out")[0] or width < 80


def test_a_person_is_marked_in_the_overview_and_apart_in_the_page(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.write([Attempt(start=start) for start in range(1, 16)])
    lab.write([Attempt(start=start) for start in range(1, 16)], model="human", settings={"driver": "ada"})
    report = build(lab.url, Selection())
    assert [line.cells[0].text for line in overview_table(report.results).rows] == ["vlv", "human ada (person)"]
    assert "People: a reference, not competitors" in html_page(report, report.tables(), [])


def test_models_with_a_single_goal_have_one_column_of_rates(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    for model in ("vlv", "random"):
        lab.write([Attempt(start=start, success=start < 9) for start in range(1, 16)], model=model)
    results = build(lab.url, Selection(), activity=False).results
    assert [column.heading for column in overview_table(results).columns] == ["model", "chair", "95 % interval", "n"]
    assert [len(goal_table(summary).rows) for summary in results.conditions] == [1, 1]


def test_columns_without_a_rank_stay(hostile: Report) -> None:
    table = fitted(hostile.tables()[0], lambda part: False)
    assert [column.heading for column in table.columns] == ["goal", "k/n", "SR %", "95 % interval", "actions"]


def test_json_holds_the_twin_and_three_models_at_once(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    for model, limit in (("vlv", 12), ("random", 2), ("forward", 1)):
        lab.write([Attempt(start=start, success=start <= limit) for start in range(1, 16)], model=model)
    lab.write([Attempt(start=start, success=start < 5) for start in range(1, 7)], model="vlv", simulated=False)
    report = build(lab.url, Selection())
    content = json.loads(to_json(report.results, report.questions, report.activity, report.record))
    (twin,) = content["sim_vs_real"]
    assert (twin["real"], twin["simulated"], twin["shared_cells"]) == ("vlv real", "vlv simulated", 6)
    assert twin["agreement"]["bias"] == pytest.approx(2 / 6)
    assert twin["prediction_powered"]["plain_success_rate"] == pytest.approx(4 / 6)
    (question,) = content["questions"]
    assert question["ranking"]["models"][0]["name"] == "vlv simulated"
