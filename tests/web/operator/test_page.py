"""Requests to the operator's page: its state, answers and corrections."""

import queue
import random
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import cv2
import numpy as np
import pytest
from websockets.sync.client import connect

from tests.processes import wait_until
from tests.web.page_session import PageSession, ended_episode
from vsnbench.models.human.controls import Controls
from vsnbench.results.reading.queries import episode_record
from vsnbench.results.writing.entries import INTERVENTION
from vsnbench.runner.operator.contract import Judgement
from vsnbench.runner.operator.prompts import Choice, QuestionKind
from vsnbench.web.operator import app, clients
from vsnbench.web.operator.clients import Clients
from vsnbench.web_server.page_address import qr_code
from vsnbench.web_server.session_key import Visitor


def test_all_operators_see_the_trial_and_the_first_start_counts(session: PageSession) -> None:
    anna, ben = session.browser("Anna"), session.browser("Ben")
    with session.prompts.ask(QuestionKind.PLACE) as question:
        state = ben.ask("GET", "/state").json
        trial = state["trial"]
        assert (trial["driven_by"], trial["start"], state["question"]["kind"]) == ("arm A", 2, "place")
        assert anna.post("/answer", question=question.number, answer="go").status == 200
        late = ben.post("/answer", question=question.number, answer="go")
        assert (late.status, "Anna" in late.json["message"]) == (409, True)
    assert (question.answer, question.author) == (Choice.GO, "Anna")


def test_an_answer_needs_a_signed_in_operator(session: PageSession) -> None:
    with session.prompts.ask(QuestionKind.PLACE) as question:
        assert session.browser().post("/answer", question=question.number, answer="go").status == 403
    assert session.browser().post("/sign-in", name="  ").status == 422


def test_stop_needs_no_name_and_halts_at_once(session: PageSession) -> None:
    with session.prompts.ask(QuestionKind.PLACE) as question:
        session.prompts.reply(question.number, Choice.GO, "Anna", "the page")
    assert session.browser().post("/stop").status == 200
    assert session.stops == ["stopped with the page's STOP button", "halt"]


def test_the_terminal_is_told_of_a_closed_page_only_while_a_trial_is_left(
    session: PageSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    messages: queue.Queue[str] = queue.Queue()
    session.prompts.show_message = messages.put
    monkeypatch.setattr(app, "INTERVAL_S", 0.05)
    monkeypatch.setattr(clients, "SILENT_S", 0.2)
    anna = session.browser("Anna")
    headers = {"Cookie": anna.cookie}
    with session.prompts.ask(QuestionKind.PLACE):
        with connect(f"ws://{anna.host}/live", origin=f"http://{anna.host}", additional_headers=headers):
            pass
        assert "Anna is not connected" in messages.get(timeout=30)
        assert session.prompts.may_drive
    with session.prompts.ask(QuestionKind.FINISH) as question:
        assert not session.prompts.may_drive
        session.prompts.reply(question.number, Choice.END, "Anna", "the page")
    assert not session.prompts.may_drive, "the session has ended"


def test_no_page_is_missed_when_no_trial_is_left() -> None:
    pages = Clients()
    pages.record_message(Visitor("1", "Anna"))
    pages._clients["1"].last_message_s -= clients.SILENT_S + 1
    assert pages.status_changes(may_drive=False) == []
    assert len(pages.status_changes(may_drive=True)) == 1, "a trial that runs again needs STOP"


@pytest.mark.parametrize("distance", ["84", "-1", "about a metre"])
def test_an_invalid_distance_is_refused(session: PageSession, distance: str) -> None:
    answer = session.browser("Anna").post("/amend", episode=1, seen=1, touched="no", distance=distance)
    assert (answer.status, answer.json["needs_confirmation"]) == (422, False)
    assert episode_record(session.journal.engine, 1).current_verdict is None


def test_a_distance_far_from_the_estimate_needs_confirmation(session: PageSession) -> None:
    anna = session.browser("Anna")
    answer = anna.post("/amend", episode=1, seen=1, touched="no", distance="3")
    assert (answer.status, answer.json["needs_confirmation"]) == (422, True)
    assert anna.post("/amend", episode=1, seen=1, touched="no", distance="3", confirmed=True).status == 200


def test_a_judgement_can_be_undone_then_corrected_with_a_reason(session: PageSession) -> None:
    anna = session.browser("Anna")
    assert anna.post("/amend", episode=1, seen=1, touched="no", distance="0.5").status == 200
    (episode,) = anna.ask("GET", "/episodes").json["episodes"]
    assert (episode["outcome"], episode["author"], episode["seen"]) == ("success", "Anna", 2)
    assert episode["undo_s"] > 0
    assert anna.post("/undo", episode=1, seen=2).status == 200
    details = episode_record(session.journal.engine, 1)
    assert (details.outcome, details.success, details.current_verdict) == ("unjudged", None, None)
    assert [event.author for event in details.events if event.kind == "taken_back"] == ["Anna"]
    assert anna.post("/amend", episode=1, seen=2, touched="the bin").status == 200
    assert anna.post("/amend", episode=1, seen=3, touched="no", distance="0.5").status == 409
    assert anna.post("/amend", episode=1, seen=3, touched="no", distance="0.5", note="it was a shadow").status == 200
    assert episode_record(session.journal.engine, 1).outcome == "success"


def test_a_measured_distance_does_not_replace_the_estimate(session: PageSession) -> None:
    anna = session.browser("Anna")
    (before,) = anna.ask("GET", "/episodes").json["episodes"]
    assert anna.post("/amend", episode=1, seen=1, touched="no", distance="0.55").status == 200
    (measured,) = anna.ask("GET", "/episodes").json["episodes"]
    assert "0.550 m from" in measured["verdict"]
    assert before["case"]["estimate_m"] not in (None, 0.55)
    assert measured["case"]["estimate_m"] == before["case"]["estimate_m"]
    assert anna.post("/undo", episode=1, seen=2).status == 200
    (undone,) = anna.ask("GET", "/episodes").json["episodes"]
    assert undone["verdict"] == before["verdict"], "a retracted judgement is not a proposal"


def test_a_judgement_after_another_operators_is_refused(session: PageSession) -> None:
    anna, ben = session.browser("Anna"), session.browser("Ben")
    assert anna.post("/amend", episode=1, seen=1, touched="no", distance="0.5").status == 200
    answer = ben.post("/amend", episode=1, seen=1, touched="the bin")
    assert (answer.status, answer.json["code"]) == (409, "judged-meanwhile")
    assert "Anna" in answer.json["message"]
    assert len(episode_record(session.journal.engine, 1).verdicts) == 2


def test_the_page_confirms_a_judgement_after_it_is_recorded(session: PageSession) -> None:
    anna, form = session.browser("Anna"), {"episode": 1, "touched": "no", "note": "seen"}
    session.prompts.state.episode_ended(ended_episode(session))
    with session.prompts.ask(QuestionKind.JUDGE) as question, ThreadPoolExecutor() as pool:
        answer = pool.submit(anna.post, "/judge", question=question.number, **form)
        while question.answer is None:
            assert not answer.done(), answer.result()
        assert not answer.done()
        judgement = question.answer
        assert isinstance(judgement, Judgement)
        session.journal.judge(1, judgement.verdict, author="Anna", note=judgement.note, seen=1)
        assert answer.result().status == 200


def test_an_answer_about_another_episode_is_refused(session: PageSession) -> None:
    anna = session.browser("Anna")
    session.prompts.state.episode_ended(ended_episode(session))
    with session.prompts.ask(QuestionKind.JUDGE) as question:
        assert anna.post("/judge", question=question.number, episode=2, touched="no").status == 409
        assert anna.post("/amend", episode=1, seen=1, touched="no").status == 409, "it is the current question"
    assert question.answer is None


def test_unjudged_episodes_stay_in_the_list(session: PageSession, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vsnbench.runner.judging.corrections.SHOWN", 0)
    episodes = session.browser().ask("GET", "/episodes").json["episodes"]
    assert [episode["episode"] for episode in episodes] == [1]


def test_the_trial_of_a_void_episode_runs_again_first(session: PageSession) -> None:
    anna = session.browser("Anna")
    with session.prompts.ask(QuestionKind.FINISH) as question:
        assert anna.post("/amend", episode=1, seen=1, void="a visitor").status == 200
    assert question.answer is Choice.AGAIN
    assert list(session.prompts.state.to_repeat) == [1]


def test_the_trial_of_a_retracted_void_does_not_run_again(session: PageSession) -> None:
    anna, state = session.browser("Anna"), session.prompts.state
    done = state.done
    assert anna.post("/amend", episode=1, seen=1, void="a visitor").status == 200
    assert (list(state.to_repeat), state.done) == ([1], done - 1)
    assert anna.post("/undo", episode=1, seen=2).status == 200
    assert (list(state.to_repeat), state.done) == ([], done)
    assert episode_record(session.journal.engine, 1).outcome == "unjudged"


def test_a_void_can_be_retracted_until_the_trial_drives_again(session: PageSession) -> None:
    anna, state = session.browser("Anna"), session.prompts.state
    assert anna.post("/amend", episode=1, seen=1, void="a visitor").status == 200
    assert state.upcoming is not None
    state.to_repeat.clear()
    state.trial_begins(replace(state.upcoming, number=3, trial=1))
    session.prompts.driving = True
    assert anna.post("/undo", episode=1, seen=2).status == 409
    session.prompts.driving = False
    with session.prompts.ask(QuestionKind.PLACE) as question:
        assert anna.post("/undo", episode=1, seen=2).status == 200
    assert question.answer is Choice.SKIP


def test_the_summary_counts_episodes_and_interventions(session: PageSession) -> None:
    session.journal.add_event(INTERVENTION, "taken off the carpet", author="Anna", episode_id=1)
    rows = dict(session.browser("Anna").ask("GET", "/summary").json["rows"])
    assert (rows["episodes"], rows["await a judgement"], rows["interventions"]) == ("1", "1", "1")
    assert rows["battery"] == "84% to 71%"


def test_the_picture_is_live_while_the_robot_drives(session: PageSession) -> None:
    anna = session.browser("Anna")
    session.camera.append(np.full((40, 60, 3), 200, np.uint8))
    assert anna.ask("GET", "/state").json["has_live_camera"]
    assert anna.ask("GET", "/picture").status == 404, "before the first action"
    session.prompts.state.picture = np.full((40, 60, 3), 20, np.uint8)

    def brightness() -> float:
        picture = cv2.imdecode(np.frombuffer(anna.ask("GET", "/picture").body, np.uint8), cv2.IMREAD_COLOR)
        assert picture is not None
        return float(picture.mean())

    assert brightness() == pytest.approx(20, abs=4)
    session.prompts.driving = True
    assert brightness() == pytest.approx(200, abs=4)
    session.camera.clear()
    assert brightness() == pytest.approx(20, abs=4), "without a live image it is the last action's"


def test_the_operator_sees_that_the_person_who_drives_has_not_begun(session: PageSession) -> None:
    controls = Controls("ada")
    controls.is_served = True
    session.robots.controls = controls
    anna = session.browser("Anna")
    assert anna.ask("GET", "/state").json["waits_for"] == ""
    threading.Thread(target=controls.offer_trial, args=("chair",), daemon=True).start()
    wait_until(lambda: anna.ask("GET", "/state").json["waits_for"] == "ada", "the trial waits for its driver")
    controls.take("phone")
    assert anna.ask("GET", "/state").json["waits_for"] == ""


def test_the_qr_code_contains_the_address() -> None:
    address = "http://192.168.1.17:8710/?token=NpWhoiTJaeG929NwRaReOA"  # OpenCV misreads about one random token in 50
    halves = {" ": (0, 0), "\u2580": (1, 0), "\u2584": (0, 1), "\u2588": (1, 1)}
    lines = qr_code(address).splitlines()
    rows = np.array([[halves[sign][half] for sign in line] for line in lines if line for half in (0, 1)], np.uint8)
    images = [np.kron(rows * 255, np.ones((pixels, pixels), np.uint8)) for pixels in (4, 6, 8, 10)]
    assert address in {cv2.QRCodeDetector().detectAndDecode(image)[0] for image in images}


def test_where_it_is_can_be_asked_while_a_robot_drives(session: PageSession) -> None:
    anna, prompts = session.browser("Anna"), session.prompts
    for driving in (False, True):
        prompts.driving = driving
        assert anna.post("/where").status == 200
        assert prompts.take_where() is driving
        assert not prompts.take_where(), "one question, one answer"
    prompts.driving = False
    state = anna.ask("GET", "/state").json
    assert (state["can_measure"], state["whereabouts"]) == (False, "measuring after this action …")


def test_random_requests_start_nothing_and_break_nothing(session: PageSession) -> None:
    anna, chance = session.browser("Anna"), random.Random(5)
    paths = [
        "/answer",
        "/judge",
        "/stop",
        "/pause",
        "/where",
        "/placing",
        "/amend",
        "/undo",
        "/sign-in",
        "/state",
        "/live",
        "/x",
    ]
    values = [None, -1, 1, 2**40, 1.5, "go", "x" * 600, [], {}, True, "\u202e", "0.5", {"a": [1]}]
    names = ["question", "answer", "episode", "seen", "touched", "distance", "void", "confirmed", "name", "pause"]
    with session.prompts.ask(QuestionKind.JUDGE) as question:
        for _ in range(250):
            path, method = chance.choice(paths), chance.choice(["POST", "POST", "GET", "PUT", "DELETE"])
            if chance.random() < 0.3:
                body = chance.randbytes(chance.randrange(60))
                status = anna.ask(method, path, body, anna.own()).status
            else:
                content = {chance.choice(names): chance.choice(values) for _ in range(3)}
                if path != "/sign-in" and content.get("void") != "go":
                    content["episode"] = 999
                status = anna.post(path, **content).status
            assert status < 500, (path, method)
        assert question.answer is None or question.answer is Choice.LATER
    assert not session.prompts.driving
    assert anna.ask("GET", "/state").status == 200
