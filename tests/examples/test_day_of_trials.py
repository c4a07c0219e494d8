"""The notebook examples/day_of_trials.ipynb runs on a results directory."""

import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from tests.report.records import Attempt, Lab, step, void
from vsnbench.protocol.judge import EndReason
from vsnbench.values.movement import Action

NOTEBOOK = json.loads((Path(__file__).parents[2] / "examples" / "day_of_trials.ipynb").read_text(encoding="utf-8"))


def run_notebook() -> dict[str, Any]:
    """Execute the code cells in order and return their names."""
    names: dict[str, Any] = {"__name__": "__main__"}
    for number, cell in enumerate(NOTEBOOK["cells"]):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"cell {number}", "exec"), names)
    return names


def test_the_notebook_holds_no_outputs() -> None:
    code = [cell for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]
    assert [(cell["outputs"], cell["execution_count"]) for cell in code] == [([], None)] * len(code)


def test_the_notebook_runs_and_counts_the_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "results").mkdir()
    lab = Lab(tmp_path / "results")
    path = [step(1, Action.MOVE_FORWARD, x_m=0.25), step(2, Action.STOP, x_m=0.25)]
    timeout = Attempt("bed", 2, success=False, end_reason=EndReason.STEP_LIMIT, distance_m=1.2, steps=path)
    lab.write([void(), Attempt(), Attempt("bed"), timeout], model="first")
    lab.write([Attempt(), Attempt("bed", success=False, steps=path)], model="second", seed=1)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    names = run_notebook()
    assert len(names["counted"]) == 5
    assert len(names["failures"]) == 2
    assert names["steps"]["action"].tolist() == ["MOVE_FORWARD", "STOP"]
    assert isinstance(names["by_start"], pd.DataFrame)
