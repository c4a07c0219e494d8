"""The rater's page as an HTTP client sees it."""

import re
import shutil
import sqlite3
from pathlib import Path

import pytest

from tests.web.browser import Answer, Browser
from tests.web.second_judgement.blind_record import JUDGE, TELLTALE, entered, make_record, served
from vsnbench.errors import UsageError
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.reading.queries import episode_record
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.second_judgements import Outcome, second_judgements

CHANGING = ("date", "set-cookie")
"""Headers that differ between any two sessions."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """40 episodes that a first person has judged."""
    directory = tmp_path_factory.mktemp("made") / "results"
    make_record(directory)
    return directory


@pytest.fixture
def record(made: Path, tmp_path: Path) -> Path:
    """A copy of the record for one test."""
    return shutil.copytree(made, tmp_path / "results")


def everything_sent(client: Browser) -> dict[str, Answer]:
    """Every answer of the server for the upcoming episode, by path."""
    state = client.ask("GET", "/state")
    code = state.json["episode"]["episode"]
    paths = ["/", "/assets/second.js", "/assets/second.css", "/operator/judging.js", "/operator/connection.js"]
    paths += [f"/episodes/{code}/frames/{step}" for step in (1, 2, 3)]
    return {"/state": state, **{path: client.ask("GET", path) for path in paths}}


def answer(client: Browser, **form: object) -> Answer:
    code = client.ask("GET", "/state").json["episode"]["episode"]
    return client.post("/judge", episode=code, **form)


def test_other_first_verdicts_and_models_change_no_byte_that_a_rater_receives(record: Path) -> None:
    def session() -> list[object]:
        sent: list[object] = []
        with served(record) as address:
            client = entered(address)
            for _ in range(3):
                answers = everything_sent(client)
                assert all(answer.status == 200 for answer in answers.values())
                for path, given in answers.items():
                    body = re.sub(rb'"csrf_token":"\w+"', b"", given.body)
                    headers = {name: value for name, value in given.headers.items() if name not in CHANGING}
                    sent.append((path, body, headers))
                client.post("/skip", episode=answers["/state"].json["episode"]["episode"])
        return sent

    before = session()
    with sqlite3.connect(record / "vsnbench.db") as database:
        database.execute("UPDATE verdict SET success = NOT success, reason = 'other', note = 'other', distance_m = 9.9")
        database.execute("UPDATE model SET name = 'wombat' || id, weights_label = 'other'")
        database.execute("UPDATE campaign SET name = 'wombat' || id")
        database.execute("UPDATE episode SET distance_to_goal_m = 9.9")
    assert session() == before


def test_no_telltale_text_is_in_any_answer(record: Path) -> None:
    with served(record) as address:
        for path, sent in everything_sent(entered(address)).items():
            content = sent.body.decode("latin1") + str(sent.headers) + path
            assert not [text for text in TELLTALE if text.lower() in content.lower()], path


def test_an_answer_is_recorded_without_changing_the_verdict(record: Path) -> None:
    with served(record) as address:
        client = entered(address)
        assert answer(client, touched="no", distance="0.8", note="clear view").json == {"outcome": "success"}
        assert answer(client, touched="leg of the table").json == {"outcome": "failure"}
        assert answer(client, void="a visitor in view").json == {"outcome": "void"}
        state = client.ask("GET", "/state").json
    assert [given["outcome"] for given in state["answers"]] == ["void", "failure", "success"]
    with open_record(sqlite_url(record / "vsnbench.db")) as engine:
        with engine.connect() as connection:
            given = second_judgements(connection)
        assert sorted(judgement.outcome for judgement in given) == [Outcome.FAILURE, Outcome.SUCCESS, Outcome.VOID]
        texts = sorted(judgement.text for judgement in given)
        assert re.fullmatch("0.8 m to the nearest (chair|sofa); clear view", texts[0])
        assert texts[1:] == ["touched leg of the table", "void: a visitor in view"]
        for judgement in given:
            verdicts = episode_record(engine, judgement.episode).verdicts
            assert [verdict.author for verdict in verdicts] == ["vsnbench", JUDGE]


def test_a_stop_without_a_distance_is_refused(record: Path) -> None:
    with served(record) as address:
        refused = answer(entered(address), touched="no")
    assert (refused.status, refused.json["code"]) == (422, "no-distance")


def test_a_rater_stops_and_resumes_and_a_retracted_answer_is_asked_again(record: Path) -> None:
    with served(record, sample=5, seed=3) as address:
        client = entered(address)
        first = client.ask("GET", "/state").json["episode"]["episode"]
        answer(client, touched="no", distance="0.8")
        answer(client, touched="no", distance="1.8")
    with served(record, sample=5, seed=3) as address:
        client = entered(address)
        state = client.ask("GET", "/state").json
        assert (state["total"], len(state["answers"])) == (5, 2)
        assert state["episode"]["episode"] not in [given["code"] for given in state["answers"]]
        assert client.post("/retract", episode=first).status == 200
        assert client.post("/retract", episode=first).json["code"] == "no-second-judgement"
        state = client.ask("GET", "/state").json
        assert (len(state["answers"]), state["episode"]["episode"]) == (1, first)
        assert client.post("/judge", episode="0" * 16, touched="no", distance="1").status == 409


def test_two_raters_with_one_seed_judge_the_same_episodes(record: Path) -> None:
    def drawn(rater: str, seed: int) -> list[str]:
        codes = []
        with served(record, rater, sample=4, seed=seed) as address:
            client = entered(address)
            while (state := client.ask("GET", "/state").json)["episode"]:
                codes.append(state["episode"]["episode"])
                assert answer(client, touched="no", distance="0.8").status == 200
        return codes

    assert drawn("Grace", 1) == drawn("Joan", 1)
    assert len(set(drawn("Edith", 2)) - set(drawn("Mary", 1))) > 0


@pytest.mark.parametrize("name", [JUDGE, JUDGE.upper(), f" {JUDGE.replace(' ', '  ')} "])
def test_the_first_judge_is_refused(record: Path, name: str) -> None:
    with pytest.raises(UsageError) as refused, served(record, name):
        pass
    assert refused.value.code == "first-judge"
