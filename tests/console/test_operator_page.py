"""The operator's page without a browser: what it shows, what may be said at it, and what nobody can make it do."""

import random
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from tests.accessibility import accessibility_findings
from tests.cli.chromium import chromium_page
from tests.console.browser import Browser
from tests.database.records_of_a_lab import begun, cell, plan, run, stopped
from vsnbench.console.operator_page import OperatorPage, code_to_be_scanned
from vsnbench.database.episode_entries import INTERVENTION
from vsnbench.database.journal import Journal
from vsnbench.database.queries import episode_details
from vsnbench.database_url import sqlite_url
from vsnbench.protocol.battery import Battery
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.record.results import ResultsDirectory
from vsnbench.runner.attendance import Occasion
from vsnbench.runner.attendant import EndedEpisode, Judgement, Upcoming
from vsnbench.runner.board import Picture
from vsnbench.runner.desk import Asks, Choice, Desk
from vsnbench.runner.episode import EpisodeOutcome, EpisodePlan
from vsnbench.runner.stopping import Stopping


@dataclass
class Session:
    """A desk with its page, over a record with one episode (1) that awaits a judgement."""

    desk: Desk
    journal: Journal
    address: str
    camera: list[npt.NDArray[np.uint8]]
    """What its camera sees now: nothing, or one picture."""
    halts: list[str] = field(default_factory=list)

    def browser(self, name: str = "") -> Browser:
        entered = Browser(self.address).enter()
        entered.proof = entered.ask("GET", "/state").json["proof"]
        if name:
            said = entered.post("/sign-in", name=name)
            entered.cookie = said.headers["set-cookie"].partition(";")[0]
        return entered


@pytest.fixture
def session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Session]:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("vsnbench.runner.corrections.UNDO_S", 1000.0)  # however slow the machine is
    results = ResultsDirectory.locate(tmp_path / "results", None)
    results.prepare()
    with Journal.open(sqlite_url(results.path / "vsnbench.db")) as journal:
        campaign = journal.find_or_create_campaign(plan())
        run(journal, campaign.trials[0], replace(stopped(success=True), proposed=True))
        claim = begun(journal, campaign.trials[1])
        site, stop, halts, desk = cell(), Stopping(), [], Desk()
        camera: list[npt.NDArray[np.uint8]] = []
        occasion = Occasion(
            *("puck in cell", 4, 1, 0, ProtocolParameters(), True, lambda: halts.append("halt"), stop, site, 0.177),
            *(journal, results, (campaign.id,), "lab"),
            glimpse=lambda: camera[0] if camera else None,
        )
        batteries = [Battery(0.84), Battery(0.71)]
        desk.board.read_battery = lambda: batteries.pop(0) if len(batteries) > 1 else batteries[0]
        desk.attends(occasion.halt, lambda request: halts.append(request.words))
        parameters = ProtocolParameters()
        desk.board.trial_begins(
            Upcoming(claim.id, claim.trial.id, "arm A", EpisodePlan(site, "chair", site.starts[1], 7, parameters))
        )
        with OperatorPage(port=0).serve(desk, occasion) as words:
            yield Session(desk, journal, words.split()[-1], camera, halts)


def test_the_next_trial_is_shown_to_everybody_and_the_first_go_counts(session: Session) -> None:
    anna, ben = session.browser("Anna"), session.browser("Ben")
    with session.desk.ask(Asks.PLACE) as question:
        state = ben.ask("GET", "/state").json
        assert (state["trial"]["driven_by"], state["trial"]["start"], state["question"]["asks"]) == (
            "arm A",
            2,
            "place",
        )
        assert anna.post("/answer", question=question.number, said="go").status == 200
        late = ben.post("/answer", question=question.number, said="go")
        assert (late.status, "Anna said go first" in late.json["words"]) == (409, True)
    assert question.reply is not None
    assert (question.reply.said, question.reply.author) == (Choice.GO, "Anna")


def test_nobody_answers_without_a_name(session: Session) -> None:
    with session.desk.ask(Asks.PLACE) as question:
        said = session.browser().post("/answer", question=question.number, said="go")
    assert (said.status, "sign in first" in said.json["words"]) == (403, True)
    assert session.browser().post("/sign-in", name="  ").status == 422


def test_stop_needs_no_name_and_halts_at_once(session: Session) -> None:
    with session.desk.ask(Asks.PLACE) as question:
        session.desk.reply(question.number, Choice.GO, "Anna", "the page")
    assert session.browser().post("/stop").status == 200
    assert session.halts == ["stopped with the page's STOP button", "halt"]


@pytest.mark.parametrize(
    ("distance", "words"),
    [("84", "if you meant centimetres, write 0.84"), ("-1", "is no distance"), ("about a metre", "is no distance")],
)
def test_a_distance_that_is_none_is_answered_in_words(session: Session, distance: str, words: str) -> None:
    said = session.browser("Anna").post("/amend", episode=1, seen=1, touched="no", distance=distance)
    assert (said.status, words in said.json["words"]) == (422, True), said
    assert episode_details(session.journal.engine, 1).standing is None


def test_a_distance_far_from_the_estimate_is_asked_back(session: Session) -> None:
    anna = session.browser("Anna")
    said = anna.post("/amend", episode=1, seen=1, touched="no", distance="3")
    assert (said.status, said.json["unsure"]) == (422, True)
    assert anna.post("/amend", episode=1, seen=1, touched="no", distance="3", sure=True).status == 200


def test_a_judgement_is_taken_back_within_seconds_and_corrected_with_a_reason_after(session: Session) -> None:
    anna = session.browser("Anna")
    assert anna.post("/amend", episode=1, seen=1, touched="no", distance="0.5").status == 200
    (shown,) = anna.ask("GET", "/episodes").json["episodes"]
    assert (shown["outcome"], shown["author"], shown["seen"]) == ("success", "Anna", 2)
    assert shown["undo_s"] > 0
    assert anna.post("/undo", episode=1, seen=2).status == 200
    details = episode_details(session.journal.engine, 1)
    assert (details.summary.outcome, details.summary.success, details.standing) == ("unjudged", None, None)
    assert [event.author for event in details.events if event.kind == "taken_back"] == ["Anna"]
    assert anna.post("/amend", episode=1, seen=2, touched="the bin").status == 200
    silent = anna.post("/amend", episode=1, seen=3, touched="no", distance="0.5")
    assert (silent.status, "say why it is corrected" in silent.json["words"]) == (409, True)
    assert anna.post("/amend", episode=1, seen=3, touched="no", distance="0.5", note="it was a shadow").status == 200
    assert episode_details(session.journal.engine, 1).summary.outcome == "success"


def test_whoever_judges_what_another_judged_meanwhile_is_told(session: Session) -> None:
    anna, ben = session.browser("Anna"), session.browser("Ben")
    assert anna.post("/amend", episode=1, seen=1, touched="no", distance="0.5").status == 200
    said = ben.post("/amend", episode=1, seen=1, touched="the bin")
    assert (said.status, "Anna said meanwhile: success" in said.json["words"]) == (409, True)
    assert len(episode_details(session.journal.engine, 1).verdicts) == 2


def ended_of(session: Session) -> EndedEpisode:
    """Episode 1 as it has just ended, with the proposal of the record."""
    upcoming = session.desk.board.upcoming
    assert upcoming is not None
    proposed = Verdict(EndReason.STEP_LIMIT, False, "failed")
    return EndedEpisode(1, upcoming.plan, EpisodeOutcome(proposed, 4, None, 1.0, proposed=True))


def test_what_the_page_confirms_is_in_the_record(session: Session) -> None:
    anna, said = session.browser("Anna"), {"episode": 1, "touched": "no", "note": "seen"}
    session.desk.board.episode_ended(ended_of(session))
    with session.desk.ask(Asks.JUDGE) as question, ThreadPoolExecutor() as pool:
        answer = pool.submit(anna.post, "/judge", question=question.number, **said)
        while question.reply is None:
            assert not answer.done(), answer.result()
        assert not answer.done()
        judgement = question.reply.said
        assert isinstance(judgement, Judgement)
        session.journal.judge(1, judgement.verdict, author="Anna", note=judgement.note, seen=1)
        assert answer.result().status == 200


def test_an_answer_about_another_episode_than_the_one_that_is_asked_about_is_refused(session: Session) -> None:
    anna = session.browser("Anna")
    session.desk.board.episode_ended(ended_of(session))
    with session.desk.ask(Asks.JUDGE) as question:
        said = anna.post("/judge", question=question.number, episode=2, touched="no")
        assert (said.status, "#2 is not asked about" in said.json["words"]) == (409, True)
        listed = anna.post("/amend", episode=1, seen=1, touched="no")
        assert (listed.status, "#1 is asked about now" in listed.json["words"]) == (409, True)
    assert question.reply is None


def test_what_awaits_a_judgement_never_falls_out_of_the_list(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vsnbench.runner.corrections.SHOWN", 0)
    assert [one["episode"] for one in session.browser().ask("GET", "/episodes").json["episodes"]] == [1]


def test_what_is_declared_void_is_run_again_first(session: Session) -> None:
    anna = session.browser("Anna")
    with session.desk.ask(Asks.FINISH) as question:
        assert anna.post("/amend", episode=1, seen=1, void="a visitor").status == 200
    assert question.reply is not None
    assert question.reply.said is Choice.AGAIN
    assert list(session.desk.board.again) == [1]


def test_the_session_says_at_its_end_what_it_was(session: Session) -> None:
    session.journal.add_event(INTERVENTION, "taken off the carpet", author="Anna", episode_id=1)
    rows = dict(session.browser("Anna").ask("GET", "/summary").json["rows"])
    assert (rows["episodes"], rows["await a judgement"], rows["interventions"]) == ("1", "1", "1")
    assert rows["battery"] == "84% to 71%"


def test_the_picture_is_what_the_camera_sees_now_while_the_robot_drives_and_the_last_action_s_else(
    session: Session,
) -> None:
    anna = session.browser("Anna")
    session.camera.append(np.full((40, 60, 3), 200, np.uint8))
    assert anna.ask("GET", "/state").json["live"]
    assert anna.ask("GET", "/picture").status == 404, "it stands, and has seen nothing yet"
    session.desk.board.picture = Picture(1, np.full((40, 60, 3), 20, np.uint8))

    def brightness() -> float:
        shown = cv2.imdecode(np.frombuffer(anna.ask("GET", "/picture").body, np.uint8), cv2.IMREAD_COLOR)
        assert shown is not None
        return float(shown.mean())

    assert brightness() == pytest.approx(20, abs=4)
    session.desk.driving = True
    assert brightness() == pytest.approx(200, abs=4)
    session.camera.clear()
    assert brightness() == pytest.approx(20, abs=4), "a camera that is silent shows what was seen last"


def test_the_code_at_the_terminal_is_read_by_another_library_as_the_pages_address() -> None:
    address = "http://192.168.1.17:8710/?token=NpWhoiTJaeG929NwRaReOA"  # fixed: that library misreads one in fifty
    halves = {" ": (0, 0), "\u2580": (1, 0), "\u2584": (0, 1), "\u2588": (1, 1)}
    lines = code_to_be_scanned(address).splitlines()
    rows = np.array([[halves[sign][half] for sign in line] for line in lines if line for half in (0, 1)], np.uint8)
    drawn = [np.kron(rows * 255, np.ones((pixels, pixels), np.uint8)) for pixels in (4, 6, 8, 10)]
    assert address in {cv2.QRCodeDetector().detectAndDecode(each)[0] for each in drawn}


def test_whatever_is_thrown_at_it_nothing_starts_and_nothing_breaks(session: Session) -> None:
    anna, chance = session.browser("Anna"), random.Random(5)
    paths = ["/answer", "/judge", "/stop", "/pause", "/wish", "/amend", "/undo", "/sign-in", "/state", "/live", "/x"]
    values = [None, -1, 1, 2**40, 1.5, "go", "x" * 600, [], {}, True, "\u202e", "0.5", {"a": [1]}]
    names = ["question", "said", "episode", "seen", "touched", "distance", "void", "sure", "name", "what", "pause"]
    with session.desk.ask(Asks.JUDGE) as question:
        for _ in range(250):
            path, method = chance.choice(paths), chance.choice(["POST", "POST", "GET", "PUT", "DELETE"])
            if chance.random() < 0.3:
                body = chance.randbytes(chance.randrange(60))
                status = anna.ask(method, path, body, anna.own()).status
            else:
                told = {chance.choice(names): chance.choice(values) for _ in range(3)}
                if path != "/sign-in" and told.get("void") != "go":
                    told["episode"] = 999
                status = anna.post(path, **told).status
            assert status < 500, (path, method)
        assert question.reply is None or question.reply.said is Choice.LATER
    assert not session.desk.driving
    assert anna.ask("GET", "/state").status == 200


@pytest.mark.browser
def test_everybody_can_read_the_page_and_work_it_by_keyboard_alone(session: Session) -> None:
    with chromium_page(390, 844) as page:
        page.set_default_timeout(120_000)
        page.goto(session.address)
        page.wait_for_selector("#name")
        assert accessibility_findings(page) == [], "signing in"
        page.keyboard.press("Tab")
        page.keyboard.type("Anna")
        page.keyboard.press("Enter")
        with session.desk.ask(Asks.PLACE) as question:
            page.wait_for_selector("#go:not([disabled])")
            page.wait_for_selector("#episodes .episode button")  # it has opened: one awaits a judgement
            assert accessibility_findings(page) == [], "placing"
            reached: list[str] = []
            while "SUMMARY" not in reached and len(reached) < 30:
                page.keyboard.press("Tab")
                held = page.locator(":focus")
                assert held.evaluate("each => getComputedStyle(each).outlineStyle") == "solid", (
                    "where it is can be seen"
                )
                reached.append(held.evaluate("each => each.id || each.tagName"))
            assert reached[-5:] == ["go", "skip", "pause", "end", "SUMMARY"]
            page.locator("#go").press("Enter")
            page.wait_for_selector("#stop:focus")
        assert question.reply is not None
        assert accessibility_findings(page) == [], "driving"
        page.keyboard.press("Enter")
        page.get_by_text("stopped: the episode ends here").wait_for()
        assert session.halts[-1] == "halt"
        session.desk.driving = False
        session.desk.board.episode_ended(ended_of(session))
        with session.desk.ask(Asks.JUDGE):
            page.wait_for_selector("#judging form")
            assert accessibility_findings(page) == [], "judging"
