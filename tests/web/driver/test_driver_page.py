"""The driver's page: what it sends, who may drive, and the record of a driven run."""

import threading
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.processes import wait_until
from tests.web.driver.driven import Driver, entered
from vsnbench.cli.results.lerobot_export import export_lerobot
from vsnbench.errors import UsageError
from vsnbench.models.human.controls import NO_LIMITS, Controls, Phase
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.summary import summarise
from vsnbench.report.build import read
from vsnbench.results.files.directory import KeepFiles, ResultsDirectory
from vsnbench.results.reading.queries import episode_record
from vsnbench.results.schema.engine import open_engine
from vsnbench.runner.operator.provider import OperatorProvider
from vsnbench.runner.setup.launch import launch
from vsnbench.runner.setup.request import RunRequest
from vsnbench.runner.setup.trial_setup import TrialSetupSpec
from vsnbench.sites.site import load_site
from vsnbench.web.driver.page import DriverPage

SENT = {
    *("driver", "controls", "practice", "phase", "trial", "leg", "goal", "has_photo", "success_distance_m", "picture"),
    *("refused", "actions_left", "time_left_s", "path_left_m", "csrf_token"),
}
"""Everything that the page is told: nothing of the plan, the pose, the distance, the path or a verdict."""


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def controls() -> Controls:
    return Controls("ada")


@pytest.fixture
def address(controls: Controls) -> Iterator[str]:
    with DriverPage(port=0).serve(controls) as text:
        yield text.split()[-1]


def ask_later(controls: Controls) -> None:
    picture = controls.view.picture + 1
    threading.Thread(target=controls.ask, args=(b"\xff\xd8 picture", NO_LIMITS), daemon=True).start()
    wait_until(lambda: controls.view.picture == picture, "the picture is offered")


def test_only_the_driver_gets_the_picture_and_can_choose(address: str, controls: Controls) -> None:
    phone, tablet = entered(address), entered(address)
    assert phone.post("/take").status == 200
    ask_later(controls)
    assert phone.ask("GET", "/picture?number=1").body == b"\xff\xd8 picture"
    assert tablet.ask("GET", "/picture?number=1").status == 403
    assert tablet.ask("GET", "/state").json["controls"] == "taken"
    for refused in (tablet.post("/take"), tablet.post("/choose", picture=1, action="MOVE_FORWARD")):
        assert (refused.status, refused.json["code"]) == (409, "driven-already")
        assert "ada" in refused.json["message"]
    assert controls.view.phase is Phase.CHOOSING, "nothing moves"


def test_the_page_sends_nothing_but_the_camera_the_goal_and_the_budget(address: str) -> None:
    browser = entered(address)
    assert set(browser.ask("GET", "/state").json) == SENT
    for path in ("/plan.svg", "/episodes", "/summary", "/episodes/1/frames/1", "/placing/expected", "/answer"):
        assert browser.ask("GET", path).status == 404, path


@pytest.mark.parametrize(
    "body",
    [
        {"picture": 1, "action": "NOOP"},
        {"picture": 1, "action": "FLY"},
        {"picture": "1", "action": "STOP"},
        {"action": "STOP"},
        {},
    ],
)
def test_other_content_is_refused_and_chooses_nothing(
    address: str, controls: Controls, body: dict[str, object]
) -> None:
    phone = entered(address)
    phone.post("/take")
    ask_later(controls)
    assert phone.post("/choose", **body).status == 400
    assert controls.view.phase is Phase.CHOOSING


def test_a_request_from_another_page_is_refused(address: str, controls: Controls) -> None:
    phone = entered(address)
    phone.csrf_token = "guessed"
    assert phone.post("/take").status == 403
    assert controls.is_free


def request(tmp_path: Path, model: str = "human:ada", practice: int | None = None) -> RunRequest:
    setup = TrialSetupSpec(load_site("apartment"), model, ("chair",), keep=KeepFiles.IMAGES)
    results = ResultsDirectory.locate(tmp_path / "results", None)
    return RunRequest(setup, results, starts=(1, 5), practice=practice)


def test_a_run_without_a_page_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(UsageError) as refusal:
        launch(request(tmp_path), OperatorProvider())
    assert refusal.value.code == "no-driver-page"
    assert not (tmp_path / "results").exists()


def test_a_person_drives_a_campaign_and_is_a_reference_in_its_report(tmp_path: Path) -> None:
    driver = Driver(["TURN_LEFT", "MOVE_FORWARD", "STOP", "STOP"])
    result = launch(request(tmp_path), OperatorProvider(serve_driver=driver.serve))
    assert (result.episodes, result.left, result.void) == (2, 0, 0)
    assert [state["phase"] for state in driver.states] == ["ready", *3 * ["choosing"], "ready", "choosing"]
    assert all(set(state) == SENT for state in driver.states)
    assert [state["actions_left"] for state in driver.states if state["phase"] == "choosing"] == [150, 149, 148, 150]
    assert {state["goal"] for state in driver.states} == {"chair"}
    shown = cv2.imdecode(np.frombuffer(driver.pictures[0], np.uint8), cv2.IMREAD_COLOR)
    recorded = cv2.imread(str(next((tmp_path / "results" / "episodes").rglob("*.jpg"))))
    assert shown.shape == recorded.shape
    url = ResultsDirectory.locate(tmp_path / "results", None).database_url
    first = episode_record(open_engine(url, read_only=True), 1)
    assert (first.model, first.driver, first.outcome, first.actions) == ("human", "ada", "failure", 3)
    (summary,) = summarise(read(url, Selection())).conditions
    assert (summary.condition.name, summary.condition.driver) == ("human ada", "ada")
    assert not summary.is_competitor
    assert "not a competitor" in summary.condition.description
    export_lerobot(ResultsDirectory.locate(tmp_path / "results", None), tmp_path / "dataset", (), with_depth=False)
    (demonstrations,) = (tmp_path / "dataset" / "meta" / "episodes").rglob("*.parquet")
    assert pq.read_table(demonstrations)["vsnbench/driver"].to_pylist() == ["ada", "ada"]


def test_the_driver_is_told_which_actions_the_guard_refused(tmp_path: Path) -> None:
    driver = Driver([*20 * ["MOVE_FORWARD"], "TURN_LEFT", "STOP", "STOP"])
    launch(request(tmp_path), OperatorProvider(serve_driver=driver.serve))
    url = ResultsDirectory.locate(tmp_path / "results", None).database_url
    with open_engine(url, read_only=True).connect() as connection:
        query = "select coalesce(blocked, 0) from step order by episode_id, number"
        blocked = [bool(value) for (value,) in connection.exec_driver_sql(query)]
    told = [state["refused"] for state in driver.states if state["phase"] == "choosing"]
    assert any(blocked)
    assert told == [False, *blocked[:-2], False]
    assert not driver.states[-2]["refused"], "the next trial begins without"


def test_practice_trials_are_repeated_until_there_are_enough(tmp_path: Path) -> None:
    driver = Driver(3 * ["STOP"])
    result = launch(request(tmp_path, practice=3), OperatorProvider(serve_driver=driver.serve))
    assert (result.trials, result.left) == (3, 0)
    assert all(state["practice"] for state in driver.states)
