"""Recorded results as DataFrames."""

from pathlib import Path
from typing import Any

import pytest

import vsnbench
from tests.report.records import Attempt, Lab, step, void
from vsnbench.errors import RecordError, UsageError
from vsnbench.report import frames
from vsnbench.report.analysis import episodes_frame
from vsnbench.report.analysis.episodes_frame import COLUMNS, read_report_data
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.fields import Fields
from vsnbench.results.model import EPISODE, TABLE
from vsnbench.results.schema.migrate import open_record
from vsnbench.values.movement import Action

KEY = ["episode_id", "number"]


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    lab = Lab(tmp_path)
    taken = [step(1, Action.MOVE_FORWARD, "LOOK_DOWN", x_m=0.25), step(2, Action.STOP, x_m=0.25)]
    lab.write([void(), Attempt(steps=taken), Attempt("bed", success=False, distance_m=1.2), Attempt("bed", 2)])
    return lab


def test_episodes_are_rows_with_their_condition(lab: Lab) -> None:
    episodes = vsnbench.open_results(lab.directory).episodes()
    assert list(episodes.columns) == [*COLUMNS, "model", "weights_label", "robot", "environment", "site"]
    assert episodes["state"].tolist() == ["void", "counted", "counted", "counted"]
    assert set(episodes["model"]) == {"vlv"}


def test_a_table_can_also_have_what_belongs_to_the_campaign_or_is_decoded(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab.write([Attempt()], model="oracle", seed=9)
    wanted = Fields((*TABLE, *EPISODE.only("model", "execution", "counts")))
    monkeypatch.setattr(episodes_frame, "_OF_RECORD", wanted)
    with open_record(sqlite_url(lab.directory / "vsnbench.db")) as engine:
        columns = read_report_data(engine).columns
    assert columns.model.tolist() == ["vlv", "vlv", "vlv", "vlv", "oracle"]
    assert columns.execution.tolist() == ["stop_and_go"] * 5
    assert columns.counts.tolist() == [False, True, True, True, True]
    assert [quantity.name for quantity in TABLE if len(quantity.sql) != 1] == ["duration_s"]  # hidden by the report


def test_steps_are_rows_in_their_order(lab: Lab) -> None:
    steps = vsnbench.open_results(lab.directory).steps(2, 3)
    assert steps["episode_id"].tolist()[:2] == [2, 2]
    assert steps["raw_action"].tolist()[:2] == ["LOOK_DOWN", "STOP"]
    assert steps["world_x_m"].tolist()[:2] == [1.25, 1.25]


def test_steps_of_all_episodes_or_of_a_list_of_them(lab: Lab) -> None:
    lab.write([Attempt(steps=[step(1, Action.TURN_LEFT), step(2, Action.STOP)])], model="oracle", seed=9)
    results = vsnbench.open_results(lab.directory)
    assert results.steps()[KEY].values.tolist() == results.steps(2, 5)[KEY].values.tolist()
    last = results.episodes().query("model == 'oracle'")["episode"]
    for chosen in ([3, 5], last, last.to_numpy(), range(3, 40_000)):
        assert results.steps(chosen)[KEY].values.tolist() == [[5, 1], [5, 2]]
    assert len(results.steps([])) == len(results.steps(2**70)) == 0


@pytest.mark.parametrize("episodes", ["2", 1.5, [None], ["2"], [[2]]])
def test_episodes_that_are_not_numbers_are_refused(lab: Lab, episodes: Any) -> None:
    with pytest.raises(UsageError) as refused:
        vsnbench.open_results(lab.directory).steps(episodes)
    assert refused.value.code == "usage"


def test_campaigns_are_rows_that_episodes_refer_to(lab: Lab) -> None:
    results = vsnbench.open_results(lab.url)
    campaigns = results.campaigns()
    assert list(campaigns.columns) == list(frames.CAMPAIGN_COLUMNS)
    assert set(campaigns["campaign"]) == set(results.episodes()["campaign"])
    assert set(campaigns["model"]) == {"vlv"}


def test_missing_results_are_refused_when_opened(tmp_path: Path) -> None:
    with pytest.raises(RecordError):
        vsnbench.open_results(tmp_path / "nothing")


def test_a_column_of_several_expressions_is_refused_instead_of_read_wrongly() -> None:
    with pytest.raises(TypeError, match="progress is computed from several columns"):
        EPISODE.only("id", "progress").single("duration_s")
