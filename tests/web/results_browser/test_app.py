"""Requests to the page of a results directory."""

import json
import shutil
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.results.locked_study import lock_drawn, run_ranks
from tests.study.studies import study_text
from tests.web.browser import Browser
from tests.web.results_browser.filmed_record import CAPTURES_S, COMMANDED, FILM_S, make_filmed_record, pose_at
from tests.web.results_browser.served_record import HOSTILE, entered, make_record, served
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.model import EPISODE
from vsnbench.results.reading.queries import images_of
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.writing.journal import Journal
from vsnbench.web.results_browser import data


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A record whose first model has a hostile name."""
    monkeypatch.setenv("VSNBENCH_OPERATOR", "ada")
    make_record(tmp_path / "results", (HOSTILE, "fast"))
    return tmp_path / "results"


@pytest.fixture
def client(results: Path) -> Iterator[Browser]:
    with served(results) as address:
        yield entered(address)


def listed(client: Browser) -> list[dict[str, Any]]:
    content = client.ask("GET", "/data/episodes.json").json
    return [dict(zip(content["columns"], row, strict=True)) for row in content["rows"]]


def test_images_are_those_of_the_record(client: Browser, results: Path) -> None:
    answer = client.ask("GET", "/images/2/3.jpg")
    assert answer.headers["content-type"] == "image/jpeg"
    assert answer.body == (results / "episodes" / "000002" / "rgb" / "0003.jpg").read_bytes()
    assert client.ask("GET", "/images/2/4.jpg").status == 404
    assert client.ask("GET", "/images/3/1.jpg").status == 404
    assert client.ask("GET", "/images/99/1.jpg").status == 404


def test_a_film_has_its_times_poses_and_images(tmp_path: Path) -> None:
    make_filmed_record(tmp_path)
    with served(tmp_path) as address:
        client = entered(address)
        page, by_stack = (client.ask("GET", f"/data/episode-{number}.json").json for number in (1, 2))
        image = client.ask("GET", "/images/1/1-2.jpg")
        assert client.ask("GET", "/images/1/1-3.jpg").status == client.ask("GET", "/images/9/1-1.jpg").status == 404
    assert image.body == (tmp_path / "episodes" / "000001" / "film" / "0001-002.jpg").read_bytes()
    assert (page["execution"], by_stack["execution"]) == ("continuous", "stack")
    assert [step["film"] for step in page["steps"]] == [
        [[time_s, round(pose_at(time_s).x_m, 4), 1.0, 0.0] for time_s in times] for times in FILM_S
    ]
    assert [step["pose"][0] for step in page["steps"]] == [round(pose_at(time_s).x_m, 4) for time_s in CAPTURES_S]
    assert [row[4:] for row in by_stack["steps"][0]["film"]] == [list(COMMANDED)] * 2
    assert [(step["age_s"], step["stale"], step["until_s"]) for step in page["steps"]] == [
        (0.4, False, 101.0), (0.4, True, 101.4), (0.4, False, 101.8),
    ]  # fmt: skip


def test_a_page_has_further_quantities_unless_they_are_empty(client: Browser, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "facts" not in client.ask("GET", "/data/episode-1.json").json
    monkeypatch.setattr(data, "FACTS", EPISODE.only("goal_text", "goal_kind", "simulated", "remaining_m"))
    page = client.ask("GET", "/data/episode-1.json").json
    assert page["facts"] == {"goal kind": "category", "simulated": "yes"}


def test_the_failures_are_classified_after_a_moment(client: Browser) -> None:
    listed(client)
    while not (answer := client.ask("GET", "/data/failures.json").json)["is_complete"]:
        pass
    assert answer["kinds"] == {"1": "stopped far off"}


def test_notes_and_tags_are_saved_with_the_author_and_change_the_version(client: Browser) -> None:
    before = client.ask("GET", "/data/version.json").json
    assert client.post("/annotate", episodes=[1, 4], note="glare", tags=["Window"]).status == 200
    assert client.ask("GET", "/data/version.json").json != before
    assert {row["id"]: row["tags"] for row in listed(client) if row["tags"]} == {1: ["window"], 4: ["window"]}
    events = client.ask("GET", "/data/episode-4.json").json["events"]
    assert [(event["kind"], event["author"], event["text"]) for event in events] == [
        ("note", "ada", "glare"), ("tagged", "ada", "window"),
    ]  # fmt: skip
    assert client.post("/annotate", episodes=[1], removed_tags=["window"]).status == 200
    assert {row["id"] for row in listed(client) if row["tags"]} == {4}


REFUSED_NOTES: tuple[tuple[dict[str, Any], int], ...] = (
    ({"episodes": [99], "note": "x"}, 404),
    ({"episodes": [], "note": "x"}, 400),
    ({"episodes": ["1"], "note": "x"}, 400),
    ({"episodes": [True], "note": "x"}, 400),
    ({"episodes": [1] * 1001, "note": "x"}, 400),
    ({"episodes": [1], "note": "x" * 2001}, 400),
    ({"episodes": [1], "tags": "window"}, 400),
    ({"episodes": [1], "tags": [1]}, 400),
    ({"episodes": [1], "tags": ["two words"]}, 409),
)


def test_what_cannot_be_noted_changes_nothing(client: Browser) -> None:
    for content, status in REFUSED_NOTES:
        assert client.post("/annotate", **content).status == status, content
    assert client.ask("GET", "/data/episode-1.json").json["events"] == []


def test_nothing_is_served_or_changed_without_the_cookie(client: Browser) -> None:
    stranger = Browser(client.address)
    for path in ("/data/episodes.json", "/data/episode-1.json", "/images/1/1.jpg", "/plan/a.svg", "/video/1.mp4"):
        assert stranger.ask("GET", path).status == 403
    body = json.dumps({"episodes": [1], "note": "x"}).encode()
    assert client.ask("POST", "/annotate", body, client.own() | {"X-CSRF-Token": "wrong"}).status == 403
    assert client.ask("POST", "/annotate", body, client.own() | {"Origin": "http://elsewhere"}).status == 403


def test_paths_out_of_the_directory_are_refused(client: Browser, results: Path, tmp_path: Path) -> None:
    secret = tmp_path / "secret" / "rgb"
    secret.mkdir(parents=True)
    (secret / "0001.jpg").write_bytes(b"hidden content")
    with sqlite3.connect(results / "vsnbench.db") as database:
        database.execute("UPDATE episode SET images_directory = '../secret' WHERE id = 1")
        database.execute("UPDATE episode SET images_directory = ? WHERE id = 2", (str(tmp_path / "secret"),))
    linked = results / "episodes" / "000004" / "rgb"
    shutil.rmtree(linked)
    linked.symlink_to(secret)
    for path in ("/images/1/1.jpg", "/images/2/1.jpg", "/images/4/1.jpg"):
        answer = client.ask("GET", path)
        assert (answer.status >= 400, b"hidden content" in answer.body) == (True, False)
    for path in ("/assets/../../app.py", "/assets/%2e%2e/app.py", "/shared/..%2f..%2fserver.py", "/video/../1.mp4"):
        assert client.ask("GET", path).status == 404


def test_a_video_is_rendered_for_download(client: Browser) -> None:
    answer = client.ask("GET", "/video/1-4.mp4")
    assert (answer.status, answer.headers["content-type"]) == (200, "video/mp4")
    assert answer.body[4:8] == b"ftyp"
    for path, status in (
        ("/video/3.mp4", 409),
        ("/video/99.mp4", 404),
        ("/video/1-2-4.mp4", 404),
        ("/video/x.mp4", 404),
    ):
        assert client.ask("GET", path).status == status


def test_a_damaged_site_or_step_is_said_and_the_list_goes_on(client: Browser, results: Path) -> None:
    plan = f"/plan/{client.ask('GET', '/data/episode-2.json').json['site_sha256']}.svg"
    with sqlite3.connect(results / "vsnbench.db") as database:
        database.execute("UPDATE site SET content = '{\"name\": 7}'")
        database.execute('UPDATE step SET details = \'{"shown": 7, "note": [1]}\' WHERE episode_id = 2')
    assert client.ask("GET", "/data/episode-2.json").json["site_sha256"] == ""
    assert client.ask("GET", plan).status == 404
    assert len(listed(client)) == 5


def test_a_blinded_study_shows_codes_only(tmp_path: Path) -> None:
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as journal:
        study = lock_drawn(journal, study_text())
        assert study.blind
        run_ranks(journal, study, range(4))
        names = {arm.name for arm in study.arms}
    with served(tmp_path) as address:
        client = entered(address)
        pages = [client.ask("GET", path).body.decode() for path in ("/data/episodes.json", "/data/episode-1.json")]
        with open_record(sqlite_url(tmp_path / "vsnbench.db")) as engine:
            directory = tmp_path / images_of(engine, 1)
        for folder, file in (("rgb", "0001.jpg"), ("film", "0001-001.jpg")):
            (directory / folder).mkdir(parents=True, exist_ok=True)
            (directory / folder / file).write_bytes(b"an image")
        assert client.ask("GET", "/images/1/1.jpg").status == 200
        assert client.ask("GET", "/images/1/1-1.jpg").status == 404, "frames of a film tell the time of an answer"
    assert names
    assert not [name for name in names for page in pages if f'"{name}"' in page]
