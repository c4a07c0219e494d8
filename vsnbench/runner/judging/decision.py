"""Decides which verdict an operator's answer gives, and what must be confirmed first. Pure."""

from dataclasses import dataclass
from enum import StrEnum

from vsnbench.errors import UsageError
from vsnbench.protocol.human_verdict import collided, declared_void, metres, taped
from vsnbench.protocol.judge import EndReason, Verdict, judge
from vsnbench.runner.judging.case import Case
from vsnbench.runner.operator.answers import MisreadError, TypedAnswer, parse_touched
from vsnbench.runner.operator.contract import Judgement
from vsnbench.text.distances import distance_text
from vsnbench.values.fix import PoseSource

SURPRISE_M = 1.0
"""A measured distance that differs from the estimate by more must be confirmed."""
ODOMETRY = "odometry"
"""In place of a distance by tape: the pose by the odometry is right, not the one measured from images."""


class UnconfirmedAnswerError(MisreadError):
    """An answer that counts only after the operator has confirmed it, because it may be a slip."""


class AnswerKind(StrEnum):
    """What an operator can answer about an episode."""

    CONFIRM = "confirm"
    """The protocol's proposal is right."""
    MEASURED = "measured"
    """Distance by tape measure, or `odometry`."""
    COLLISION = "collision"
    """The robot touched something that it did not feel."""
    VOID = "void"
    """The episode is not a result."""


@dataclass(frozen=True, slots=True)
class Answer:
    """An operator's answer about an episode, the same from the terminal, a browser or the command."""

    kind: AnswerKind
    text: str = ""
    """As typed: the distance, what the robot touched, or why the episode is void."""
    note: str = ""
    is_confirmed: bool = False
    """The operator was asked back and confirmed the answer."""
    is_correction: bool = False
    """The operator has stated that this replaces an earlier verdict."""


@dataclass(frozen=True, slots=True)
class JudgingForm:
    """The fields of the operator page's judging form, as typed."""

    touched: str = ""
    """`no`, or what the robot touched."""
    distance: str = ""
    """By tape measure, `0.84` or `84 cm`; `odometry` for its pose; empty keeps the estimate."""
    felt: bool = False
    """The collision that the robot felt did happen."""
    void: str = ""
    """Why the episode is not a result; empty for a result."""
    note: str = ""
    is_confirmed: bool = False

    def answer(self, case: Case, *, is_correction: bool = False) -> Answer:
        """Return the answer that the fields give.

        Raises:
            MisreadError: the fields do not give one.
        """
        kind, text = self._kind_and_text(case)
        return Answer(kind, text, self.note, self.is_confirmed, is_correction)

    def _kind_and_text(self, case: Case) -> tuple[AnswerKind, str]:
        if self.void:
            return AnswerKind.VOID, self.void
        if case.ended_with is EndReason.COLLISION:
            if not self.felt:
                raise MisreadError("confirm that there was a collision, or give the reason why the episode is void")
            return AnswerKind.CONFIRM, ""
        touched = parse_touched(self.touched)
        if touched is TypedAnswer.LATER:
            raise MisreadError("'later' is not a judgement")
        if isinstance(touched, str):
            return AnswerKind.COLLISION, touched
        if self.distance.strip():
            return AnswerKind.MEASURED, self.distance
        return AnswerKind.CONFIRM, ""


def decide(case: Case, answer: Answer) -> Judgement:
    """Return the judgement that an answer gives.

    Raises:
        MisreadError: the answer does not fit the episode; the message gives an answer that does.
        UnconfirmedAnswerError: the answer counts only once the operator confirms it.
    """
    judgement = _judgement(case, answer)
    if not answer.is_confirmed and (doubts := _doubts(case, answer, judgement.verdict)):
        raise UnconfirmedAnswerError("; ".join(doubts))
    return judgement


def _judgement(case: Case, answer: Answer) -> Judgement:
    text = " ".join(answer.text.split())
    match answer.kind:
        case AnswerKind.VOID:
            if not text:
                raise MisreadError("give the reason why the episode is void")
            return Judgement(declared_void(text), answer.note or text)
        case AnswerKind.COLLISION:
            if not text:
                raise MisreadError("name what the robot touched")
            verdict = collided(text, case.actions, case.distance, case.parameters)
            return Judgement(verdict, answer.note or text, called_collision=True)
        case AnswerKind.MEASURED:
            return Judgement(case.of_sequence(_measured(case, text)), answer.note)
        case AnswerKind.CONFIRM:
            if case.proposal is None:
                raise MisreadError(
                    f"episode {case.number} has no proposal to confirm",
                    advice="give the distance by tape measure, a collision, or the reason why it is void",
                )
            return Judgement(case.proposal, answer.note)


def _measured(case: Case, text: str) -> Verdict:
    if not case.ended_with.is_result:
        raise MisreadError(
            f"episode {case.number} ended with {case.ended_with.value}, without a STOP: a distance does not make it a "
            "result",
            advice="if the robot touched something, report a collision; else declare the episode void",
        )
    if text.lower() == ODOMETRY:
        if case.odometry is None:
            raise MisreadError(
                f"episode {case.number} has no other pose than the odometry's",
                advice="keep the estimate, or give metres by tape, like 0.84",
            )
        return judge(case.ended_with, case.actions, case.odometry, case.parameters)
    try:
        distance_m = metres(text, case.longest_m)
    except UsageError as error:
        raise MisreadError(error.statement, advice=error.advice) from error
    return taped(case.ended_with, case.actions, distance_m, case.instance, case.parameters)


def _doubts(case: Case, answer: Answer, verdict: Verdict) -> list[str]:
    """Return what the operator must confirm, one clause each."""
    doubts = []
    if answer.kind is AnswerKind.MEASURED and verdict.distance is not None:
        measured_m, estimate, success_m = verdict.distance.distance_m, case.estimate, case.parameters.success_distance_m
        by = "measured" if verdict.distance.source is PoseSource.TAPE else "odometry"
        measured = f"{by} {distance_text(measured_m, success_m)} m"
        if estimate is not None:
            measured += f", estimated {distance_text(estimate.distance_m, success_m)} m"
        expected = case.expected_success
        if expected is not None and verdict.success != expected:
            doubts.append(f"{measured}: changes {outcome_text(expected)} to {outcome_text(verdict.success)}")
        elif estimate is not None and abs(measured_m - estimate.distance_m) > SURPRISE_M:
            doubts.append(f"{measured}: they differ by more than {SURPRISE_M:g} m")
    if case.current_verdict is not None and not answer.is_correction:
        was, becomes = outcome_text(case.current_verdict.success), outcome_text(verdict.success)
        change = "replace it" if was == becomes else f"change {was} to {becomes}"
        doubts.append(
            f"episode {case.number} is already judged ({case.current_verdict.text}); this verdict would {change}"
        )
    return doubts


def outcome_text(success: bool | None) -> str:
    """Return the outcome of a verdict in one word."""
    return {True: "success", False: "failure", None: "void"}[success]
