"""Questions to the operator: one at a time, and the first reply wins."""

import threading
from contextlib import suppress

import pytest

from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.runner.operator.contract import Judgement
from vsnbench.runner.operator.prompts import (
    AnsweredMeanwhileError,
    Choice,
    OperatorPrompts,
    QuestionKind,
    RepliedElsewhereError,
)

FAILED = Judgement(Verdict(EndReason.STEP_LIMIT, False, "failed"))


def test_the_first_reply_wins_and_a_late_one_names_it() -> None:
    prompts = OperatorPrompts()
    with prompts.ask(QuestionKind.JUDGE) as question:
        prompts.reply(question.number, FAILED, "Anna", "the page")
        with pytest.raises(AnsweredMeanwhileError, match="Anna judged it first, at the page"):
            prompts.reply(question.number, Choice.LATER, "Ben", "the terminal")
    assert question.answer is not None
    assert question.answer == FAILED


def test_one_of_many_simultaneous_replies_wins() -> None:
    prompts = OperatorPrompts()
    first: list[str] = []

    def say(name: str) -> None:
        with suppress(AnsweredMeanwhileError):
            prompts.reply(question.number, Choice.GO, name, "the page")
            first.append(name)

    with prompts.ask(QuestionKind.PLACE) as question:
        threads = [threading.Thread(target=say, args=(str(number),)) for number in range(20)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert question.answer is not None
    assert first == [question.author]
    assert prompts.driving


def test_an_answer_to_an_older_question_is_refused() -> None:
    prompts = OperatorPrompts()
    with prompts.ask(QuestionKind.PLACE) as old:
        prompts.reply(old.number, Choice.GO, "Anna", "the page")
    with prompts.ask(QuestionKind.JUDGE), pytest.raises(AnsweredMeanwhileError, match="Anna answered go first"):
        prompts.reply(old.number, Choice.GO, "Ben", "the page")
    with pytest.raises(AnsweredMeanwhileError, match="no longer asked"):
        prompts.reply(99, Choice.GO, "Ben", "the page")


def test_question_numbers_of_two_runs_differ() -> None:
    with OperatorPrompts().ask(QuestionKind.PLACE) as shown, OperatorPrompts().ask(QuestionKind.PLACE) as asked:
        assert shown.number != asked.number


def test_an_answer_must_fit_the_question() -> None:
    prompts = OperatorPrompts()
    with prompts.ask(QuestionKind.JUDGE) as question, pytest.raises(ValueError):
        prompts.reply(question.number, Choice.GO, "Anna", "the page")
    with prompts.ask(QuestionKind.PLACE) as question, pytest.raises(ValueError):
        prompts.reply(question.number, FAILED, "Anna", "the page")
    assert not prompts.driving


def test_a_paused_session_refuses_a_go() -> None:
    prompts = OperatorPrompts()
    with prompts.ask(QuestionKind.BEGIN) as question:
        prompts.pause("Anna")
        with pytest.raises(AnsweredMeanwhileError, match="Anna has paused the session"):
            prompts.reply(question.number, Choice.GO, "Ben", "the page")
        prompts.pause("")
        prompts.reply(question.number, Choice.GO, "Ben", "the page")


def test_the_terminal_wakes_for_a_reply_and_a_requested_action() -> None:
    prompts = OperatorPrompts()
    with prompts.ask(QuestionKind.PLACE) as question:
        threading.Thread(target=prompts.request_action, args=(question.number, "look")).start()
        with pytest.raises(RepliedElsewhereError):
            prompts.read_line()
        assert question.actions == ["look"]
        threading.Thread(target=prompts.reply, args=(question.number, Choice.SKIP, "Anna", "the page")).start()
        with pytest.raises(RepliedElsewhereError):
            prompts.read_line()
    assert question.answer is not None


def test_a_stop_ends_the_episode_only_while_driving() -> None:
    done: list[str] = []
    prompts = OperatorPrompts(None, lambda: done.append("halt"), lambda request: done.append(request.description))
    assert not prompts.end_episode("Anna", "the page's STOP button")
    prompts.halt()
    assert done == ["halt"]
    with prompts.ask(QuestionKind.PLACE) as question:
        prompts.reply(question.number, Choice.GO, "Anna", "the page")
    assert prompts.end_episode("Ben", "the page's STOP button")
    assert done[1:] == ["stopped with the page's STOP button by Ben"], "the prompt does not wait for the base"


def test_the_operator_who_ended_the_session_is_shown() -> None:
    prompts = OperatorPrompts()
    with prompts.ask(QuestionKind.FINISH) as question:
        assert prompts.ended_by == ""
        prompts.reply(question.number, Choice.END, "Anna", "the page")
    assert prompts.ended_by == "Anna"
