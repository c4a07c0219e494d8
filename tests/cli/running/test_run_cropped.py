"""`vsnbench run` with `fit = "crop"`, and the warnings about a camera that the model was not trained with."""

import contextlib
import json
import logging
import math
from dataclasses import dataclass
from pathlib import Path

import cv2
import pytest

from tests.cli.test_record_verbs import Done, vsnbench
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.reading.queries import episode_record, episode_steps, list_campaigns
from vsnbench.results.schema.migrate import open_record

NARROW = "tests.cli.turning:Narrow"


def run(results: Path, *words: str, model: str = NARROW, fit: str = "full") -> Done:
    """Run one trial below a `vsnbench.toml` with a fit."""
    (results / "vsnbench.toml").write_text(f'[models]\nfit = "{fit}"\n')
    with contextlib.chdir(results):
        return vsnbench(results, "run", "--model", model, "--goal", "chair", "--starts", "1", "--workers", "1", *words)


@dataclass(frozen=True)
class Runs:
    """A record with a plain and a cropped run of one trial, and what both logged."""

    folder: Path
    codes: tuple[object, object]
    warnings: tuple[str, str]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    """Both runs."""
    folder, logged = tmp_path_factory.mktemp("results"), logging.getLogger("vsnbench")
    codes, texts = [], []
    for fit in ("full", "crop"):
        lines: list[str] = []
        handler = logging.Handler(logging.WARNING)
        handler.emit = lambda record, lines=lines: lines.append(record.getMessage())  # type: ignore[method-assign]
        logged.addHandler(handler)
        codes.append(run(folder, fit=fit).returncode)
        logged.removeHandler(handler)
        texts.append("\n".join(lines))
    return Runs(folder, (codes[0], codes[1]), (texts[0], texts[1]))


def test_a_stress_test_crops_as_a_run_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "vsnbench.toml").write_text('[models]\nfit = "crop"\n')
    monkeypatch.chdir(tmp_path)
    words = ("--model", NARROW, "--goal", "chair", "--starts", "1", "--max-steps", "3", "--workers", "1")
    done = vsnbench(tmp_path, "stress", *words, "--disturb", "low_light", "--severity", "5")
    assert done.returncode == 0, done.stderr
    with open_record(sqlite_url(tmp_path / "vsnbench.db")) as engine:
        conditions = [episode_record(engine, number).provenance.conditions for number in (1, 2)]
    assert all("fit" in each for each in conditions)


def test_a_cropped_run_is_a_condition_of_its_own(runs: Runs) -> None:
    assert runs.codes == (0, 0)
    with open_record(sqlite_url(runs.folder / "vsnbench.db")) as engine:
        states = list_campaigns(engine)
        first, second = (episode_record(engine, number).provenance for number in (1, 2))
    assert len({state.key for state in states}) == 2
    assert "fit" not in first.conditions
    added = {name: value for name, value in second.conditions.items() if name not in first.conditions}
    size = added.pop("crop")
    assert added == {"fit": "crop"}
    assert size == {"width": 404, "height": 302, "horizontal_fov_deg": size["horizontal_fov_deg"]}
    report = json.loads(vsnbench(runs.folder, "report", "--format", "json").stdout)
    assert (
        sorted(model["name"] for model in report["models"]) == ["narrow", "narrow fit=crop"]
        or len({model["name"] for model in report["models"]}) == 2
    )
    assert any("fit=crop" in model["name"] for model in report["models"])


def test_the_model_sees_the_crop_and_the_record_has_the_robot_s_image(runs: Runs) -> None:
    with open_record(sqlite_url(runs.folder / "vsnbench.db")) as engine:
        plain, cropped = (episode_steps(engine, number)[0] for number in (1, 2))
        images = [episode_record(engine, number).images_directory for number in (1, 2)]
    assert (plain.details["rgb"], cropped.details["rgb"]) == ([480, 640], [302, 404])
    assert cropped.details["depth"] == [302, 404]
    focal_px = 320 / math.tan(math.radians(30))
    seen = cropped.details["camera"]
    assert (seen["width"], seen["height"], seen["mount_height_m"]) == (404, 302, 0.6)
    assert seen["horizontal_fov_deg"] == pytest.approx(2 * math.degrees(math.atan(202 / focal_px)))
    assert plain.rgb_digest == cropped.rgb_digest
    for directory in images:
        picture = cv2.imread(str(next((runs.folder / directory / "rgb").glob("*.jpg"))))
        assert picture is not None
        assert picture.shape == (480, 640, 3)


def test_a_run_names_each_difference_of_the_camera(runs: Runs) -> None:
    plain, cropped = runs.warnings
    for text in ("0.28 m lower", "5° further down", "20° wider", "640 x 480 instead of 320 x 240 pixels"):
        assert text in plain
    assert "wider" not in cropped
    assert "0.28 m lower" in cropped


@pytest.mark.parametrize(
    ("fit", "words", "model", "code"),
    [
        ("crop", (), "forward", "no field of view"),
        ("crop", ("--robot", "simulated:stretch@200x600"), NARROW, "horizontally"),
        ("stretch", (), NARROW, "'full' or 'crop'"),
    ],
)
def test_an_impossible_crop_is_one_line_and_writes_nothing(
    tmp_path: Path, fit: str, words: tuple[str, ...], model: str, code: str
) -> None:
    done = run(tmp_path, *words, model=model, fit=fit)
    assert done.returncode == 2
    assert code in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "vsnbench.db").exists()


def test_doctor_and_check_compare_the_cameras(tmp_path: Path) -> None:
    done = vsnbench(tmp_path, "doctor", "--robot", "simulated", "--model", "pirlnav,forward", "--json")
    found = {line["what"]: line for line in json.loads(done.stdout)["checks"]}
    assert (done.returncode, found["camera for pirlnav"]["health"]) == (0, "warning")
    assert "0.28 m lower, 19° narrower" in found["camera for pirlnav"]["seen"]
    assert found["camera for forward"]["health"] == "ok"
    checked = vsnbench(tmp_path, "models", "check", NARROW, "--robot", "lola2", "--json")
    (camera,) = (line for line in json.loads(checked.stdout) if line["what"] == "camera")
    assert camera["passed"]
    assert "0.17 m higher" in camera["seen"]
    shown = json.loads(vsnbench(tmp_path, "models", "show", "vlv", "--json").stdout)
    assert shown["camera"]["mount_height_m"] == 1.25
