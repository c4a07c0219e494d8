"""`vsnbench run --continuous` from the command line: recorded, judged, listed, reported and verified."""

import json
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from tests.cli.test_record_verbs import Done, vsnbench

TRIALS = ("--model", "oracle-waypoints", "--goal", "chair", "--max-steps", "4", "--robot", "simulated:turtlebot2@64x48")
FILMED = ("--protocol", str(Path(__file__).with_name("filmed.yaml")), "--continuous", "0.4", "--keep", "images")
RUN = ("run", *TRIALS, "--starts", "1-2", *FILMED, "--quiet")


def steps(results: Path) -> list[tuple[Any, ...]]:
    """Return what was driven and seen, independent of the process that recorded it."""
    query = """
        SELECT t.start, s.number, s.action, s.stamp_s, s.movement, s.world_x_m, s.world_y_m, s.rgb_digest, s.refusal
        FROM step s JOIN episode e ON e.id = s.episode_id JOIN trial t ON t.id = e.trial_id ORDER BY 1, 2
    """
    with closing(sqlite3.connect(results / "vsnbench.db")) as connection:
        return connection.execute(query).fetchall()


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record of two trials that end at their limit of 8 s, and of the same trials with the robot at rest."""
    results = tmp_path_factory.mktemp("ran")
    for words in (RUN, ("run", *TRIALS, "--starts", "1", "--quiet")):
        done = vsnbench(results, *words, "--workers", "1")
        assert done.returncode == 0, done.stderr
    return results


def shown(done: Done) -> Any:
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_every_step_is_an_answer_with_its_age_and_the_waiting_time(ran: Path) -> None:
    page = shown(vsnbench(ran, "episodes", "show", "1", "--steps", "--json"))
    assert (page["execution"], page["end_reason"]) == ("continuous", "time_limit")
    assert page["provenance"]["protocol"]["execution"]["latency_s"] == 0.4
    assert {round(step["age_s"], 2) for step in page["steps"]} == {0.4}
    assert page["steps"][0]["waiting_s"] == pytest.approx(0.4, abs=0.03)
    assert page["waiting_s"] == pytest.approx(sum(step["waiting_s"] for step in page["steps"]))
    assert sum(step["duration_s"] for step in page["steps"]) == pytest.approx(page["duration_s"])
    text = vsnbench(ran, "episodes", "show", "1", "--steps").stdout
    assert "continuous, latency 0.4 s" in text
    assert "0.40 s old (median) when they took effect" in text


def test_a_film_has_the_frames_between_the_answers_and_a_video_shows_them(ran: Path) -> None:
    import av

    files = sorted(path.name for path in ran.glob("episodes/*/film/*.jpg"))
    assert 2 * 36 <= len(files) <= 2 * 41, "5 Hz for 8 s, twice"
    assert files[0] == "0001-001.jpg"
    video = ran.parent / "film.mp4"
    done = vsnbench(ran, "export", "video", "1", "--output", str(video), "--size", "web")
    assert done.returncode == 0, done.stderr
    with av.open(str(video)) as opened:
        shown = sum(1 for _ in opened.decode(video=0))
    film = len(list(ran.glob("episodes/000001/film/*.jpg")))
    assert shown == film + 1 + 8, "the first image, the film, and 2 s of the result"


def test_reports_and_lists_never_pool_executions_and_name_them_in_a_word(ran: Path) -> None:
    models = shown(vsnbench(ran, "report", "--format", "json"))["models"]
    assert {model["execution"]: model["campaigns"] for model in models} == {"continuous": [1], "stop_and_go": [2]}
    assert len({model["name"] for model in models}) == 2
    episodes = shown(vsnbench(ran, "episodes", "list", "--json"))
    assert sorted(episode["execution"] for episode in episodes) == ["continuous", "continuous", "stop_and_go"]
    assert "latency 0.4 s" in vsnbench(ran, "report").stdout


def test_what_was_driven_is_verified_and_driven_again_bit_for_bit(ran: Path) -> None:
    done = vsnbench(ran, "verify", str(ran), "--replay", "all")
    assert done.returncode == 0, done.stdout


@pytest.mark.long
def test_two_workers_give_the_same_bits_as_one(ran: Path, tmp_path: Path) -> None:
    done = vsnbench(tmp_path, *RUN, "--workers", "2")
    assert done.returncode == 0, done.stderr
    own = steps(tmp_path)
    assert own
    assert own == [row for row in steps(ran) if "answer" in (row[4] or "")]


@pytest.mark.long
def test_frontier_by_waypoints_gives_the_same_bits_with_one_and_two_workers(tmp_path: Path) -> None:
    found = []
    for workers in ("1", "2"):
        words = [word.replace("oracle-waypoints", "frontier-waypoints") for word in RUN]
        done = vsnbench(tmp_path / workers, *words, "--workers", workers)
        assert done.returncode == 0, done.stderr
        found.append(steps(tmp_path / workers))
    assert len(found[0]) > 30
    assert found[0] == found[1]
