"""`vsnbench report`, `compare`, `export` and `import` as a user types them."""

import json
import queue
import threading
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from typer.testing import CliRunner, Result

from tests.report.records import Attempt, Lab
from tests.web.browser import Browser
from vsnbench.cli.main import build_app
from vsnbench.errors import RecordError, UsageError
from vsnbench.report.output import serve_page


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    """A record of two models; not to be changed."""
    lab = Lab(tmp_path_factory.mktemp("results"))
    for model, limit in (("vlv", 8), ("random", 1)):
        lab.write([Attempt(start=start, success=start <= limit) for start in range(1, 16)], model=model)
    return lab


def vsnbench(*words: object) -> Result:
    arguments = [str(word) for word in words]
    return CliRunner().invoke(build_app(arguments[0]), arguments, catch_exceptions=True)


def test_only_reference_needs_no_record() -> None:
    outcome = vsnbench("report", "--only-reference", "--results", "/nowhere")
    assert outcome.exit_code == 0
    for words in ("22/75", "29.33", "[20.24, 40.44]", "19/90", "21.11", "[13.95, 30.63]", "0.278", "0.833", "5.22"):
        assert words in outcome.stdout
    whole = json.loads(vsnbench("report", "--only-reference", "--format", "json").stdout)
    assert whole["interval"] == "wilson"
    stability = whole["published_stability"]
    assert (stability["hours"], stability["kilometres"], len(stability["robots"])) == (38, 5.22, 2)
    models = whole["models"]
    assert [model["published"] for model in models] == [True, True]


def test_each_table_is_a_file_to_paste_and_is_chosen_by_name(lab: Lab, tmp_path: Path) -> None:
    one = ("--figure", "success-by-goal")
    everything = vsnbench("report", "--results", lab.directory, "--output", tmp_path / "all", *one)
    assert everything.exit_code == 0
    names = sorted(file.stem for file in (tmp_path / "all" / "tables").iterdir())
    assert len(names) > 3
    for name in names:
        text = (tmp_path / "all" / "tables" / f"{name}.tex").read_text(encoding="utf-8")
        assert (text.count(r"\caption{"), text.count(rf"\label{{tab:{name}}}")) == (1, 1)
    chosen = ["--table", f"{names[1]},{names[0]}", *one]
    assert vsnbench("report", "--results", lab.directory, "--output", tmp_path / "two", *chosen).exit_code == 0
    assert sorted(file.stem for file in (tmp_path / "two" / "tables").iterdir()) == names[:2]
    assert {file.stem for file in (tmp_path / "two" / "figures").iterdir()} == {"success-by-goal"}
    printed = vsnbench("report", "--results", lab.directory, *chosen[:2], "--format", "latex").stdout
    assert printed.index(f"tab:{names[1]}") < printed.index(f"tab:{names[0]}")


def test_latex_tables_are_set_for_the_width_of_a_column(lab: Lab) -> None:
    words = ("report", "--results", lab.directory, "--table", "goals-1", "--format", "latex", "--column")
    narrow, wide = (vsnbench(*words, column).stdout for column in ("2in", "200mm"))
    assert r"\begin{table*}" in narrow
    assert r"\begin{table}" in wide


def test_output_that_cannot_be_written_is_one_line(lab: Lab, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    outcome = vsnbench(
        *("report", "--results", lab.directory, "--output", tmp_path / "file", "--figure", "success-by-goal")
    )
    assert isinstance(outcome.exception, RecordError)
    assert "cannot write" in str(outcome.exception)


def test_the_page_is_served_to_this_machine_only() -> None:
    addresses: queue.Queue[str] = queue.Queue()
    threading.Thread(target=serve_page, args=("<p>hello</p>", 0, addresses.put), daemon=True).start()
    address = addresses.get(timeout=10)
    assert address.startswith("http://127.0.0.1:")
    assert Browser(address).ask("GET", "/").status == 403
    browser = Browser(address).enter()
    assert browser.ask("GET", "/").body == b"<p>hello</p>"
    assert browser.ask("GET", "/vsnbench.db").status == 404
    with pytest.raises(UsageError) as error:
        serve_page("", urlsplit(address).port or 0, addresses.put)
    assert error.value.code == "port-unavailable"


def test_published_rates_are_compared_without_a_record() -> None:
    answer = json.loads(vsnbench("compare", "paper:vlv", "paper:pirlnav", "--format", "json").stdout)
    (one,) = answer["comparisons"]
    assert [round(rate["p"], 3) for rate in one["rates"]] == [0.278, 0.833]
