"""The desk: one question at a time, the first reply counts, and whoever is late is told who was first."""

import threading
from contextlib import suppress

import pytest

from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.runner.attendant import Judgement
from vsnbench.runner.desk import AnsweredMeanwhileError, Asks, Choice, Desk, RepliedElsewhereError

FAILED = Judgement(Verdict(EndReason.STEP_LIMIT, False, "failed"))


def test_the_first_reply_counts_and_the_other_is_told_who_was_first() -> None:
    desk = Desk()
    with desk.ask(Asks.JUDGE) as question:
        desk.reply(question.number, FAILED, "Anna", "the page")
        with pytest.raises(AnsweredMeanwhileError, match="Anna judged it first, at the page"):
            desk.reply(question.number, Choice.LATER, "Ben", "the terminal")
    assert question.reply is not None
    assert question.reply.said == FAILED


def test_of_many_at_once_one_is_first() -> None:
    desk = Desk()
    first: list[str] = []

    def say(name: str) -> None:
        with suppress(AnsweredMeanwhileError):
            desk.reply(question.number, Choice.GO, name, "the page")
            first.append(name)

    with desk.ask(Asks.PLACE) as question:
        threads = [threading.Thread(target=say, args=(str(number),)) for number in range(20)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert question.reply is not None
    assert first == [question.reply.author]
    assert desk.driving


def test_an_answer_to_an_older_question_is_none_to_this_one() -> None:
    desk = Desk()
    with desk.ask(Asks.PLACE) as old:
        desk.reply(old.number, Choice.GO, "Anna", "the page")
    with desk.ask(Asks.JUDGE), pytest.raises(AnsweredMeanwhileError, match="Anna said go first"):
        desk.reply(old.number, Choice.GO, "Ben", "the page")
    with pytest.raises(AnsweredMeanwhileError, match="not asked any more"):
        desk.reply(99, Choice.GO, "Ben", "the page")


def test_a_phone_that_outlives_a_killed_run_answers_no_question_of_the_next() -> None:
    with Desk().ask(Asks.PLACE) as shown, Desk().ask(Asks.PLACE) as asked:
        assert shown.number != asked.number


def test_go_is_no_verdict_and_a_verdict_is_no_go() -> None:
    desk = Desk()
    with desk.ask(Asks.JUDGE) as question, pytest.raises(ValueError, match="no answer"):
        desk.reply(question.number, Choice.GO, "Anna", "the page")
    with desk.ask(Asks.PLACE) as question, pytest.raises(ValueError, match="no answer"):
        desk.reply(question.number, FAILED, "Anna", "the page")
    assert not desk.driving


def test_a_session_that_rests_takes_no_go() -> None:
    desk = Desk()
    with desk.ask(Asks.BEGIN) as question:
        desk.pause("Anna")
        with pytest.raises(AnsweredMeanwhileError, match="Anna has paused the session"):
            desk.reply(question.number, Choice.GO, "Ben", "the page")
        desk.pause("")
        desk.reply(question.number, Choice.GO, "Ben", "the page")


def test_whoever_reads_at_the_terminal_hears_of_a_reply_and_of_a_wish() -> None:
    desk = Desk()
    with desk.ask(Asks.PLACE) as question:
        threading.Thread(target=desk.wish, args=(question.number, "look")).start()
        with pytest.raises(RepliedElsewhereError):
            desk.read_line()
        assert question.wishes == ["look"]
        threading.Thread(target=desk.reply, args=(question.number, Choice.SKIP, "Anna", "the page")).start()
        with pytest.raises(RepliedElsewhereError):
            desk.read_line()
    assert question.reply is not None


def test_a_stop_asks_for_the_end_only_while_something_is_driven_and_halts_apart() -> None:
    desk, done = Desk(), []
    desk.attends(lambda: done.append("halt"), lambda request: done.append(request.words))
    assert not desk.end_episode("Anna", "the page's STOP button")
    desk.halt()
    assert done == ["halt"]
    with desk.ask(Asks.PLACE) as question:
        desk.reply(question.number, Choice.GO, "Anna", "the page")
    assert desk.end_episode("Ben", "the page's STOP button")
    assert done[1:] == ["stopped with the page's STOP button by Ben"], "whoever waits for the base does not wait here"


def test_whoever_ends_the_session_is_known_to_every_face() -> None:
    desk = Desk()
    with desk.ask(Asks.FINISH) as question:
        assert desk.ended_by == ""
        desk.reply(question.number, Choice.END, "Anna", "the page")
    assert desk.ended_by == "Anna"
