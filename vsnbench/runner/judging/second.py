"""Second judgements: a rater judges recorded episodes without the first verdict and the model's name."""

import hashlib
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from vsnbench.errors import UsageError
from vsnbench.protocol.judge import EndReason, Verdict, judge
from vsnbench.results.files.confined_paths import read_confined
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.files.images import rgb_path
from vsnbench.results.model import EpisodeRecord
from vsnbench.results.reading.queries import episode_record
from vsnbench.results.schema.engine import reading, transaction
from vsnbench.results.second_judgements import (
    Outcome,
    SecondJudgement,
    first_judges,
    is_same_person,
    judged_episodes,
    second_judgements,
)
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.judging.case import Case, recorded_site
from vsnbench.runner.judging.decision import Answer, AnswerKind, decide
from vsnbench.runner.operator.answers import MisreadError
from vsnbench.sites.targets import goal_words
from vsnbench.text.sanitize import sanitize
from vsnbench.values.encoding.images import decode_picture

MAX_RATER_LENGTH: Final = 60


def read_rater(typed: str) -> str:
    """Return a rater's name in one line.

    Raises:
        UsageError: it is empty or too long.
    """
    name = " ".join(sanitize(typed).split())
    if not 0 < len(name) <= MAX_RATER_LENGTH:
        raise UsageError(
            f"--second needs a name of 1 to {MAX_RATER_LENGTH} characters",
            advice="it is recorded with every answer",
            code="invalid-rater",
        )
    return name


def blind_case(details: EpisodeRecord) -> Case:
    """Return the case of an episode without its verdicts, distances and number.

    The proposal is what the end of the episode alone determines: a failure unless the model stopped.
    """
    case = Case.of_recorded(details)
    stopped = case.ended_with is EndReason.STOP
    proposal = None if stopped else judge(case.ended_with, case.actions, None, case.parameters)
    return replace(case, number=0, proposal=proposal, current_verdict=None, recorded_distance=None, odometry=None)


def decide_second(case: Case, answer: Answer) -> tuple[Outcome, str]:
    """Return outcome and text of a rater's answer about a blind case.

    Raises:
        MisreadError: the answer does not fit the episode.
    """
    if case.ended_with is EndReason.STOP and answer.kind is AnswerKind.CONFIRM:
        raise MisreadError(
            "the model stopped, so the distance to the goal decides", advice="enter the distance", code="no-distance"
        )
    verdict = decide(case, answer).verdict
    note = " ".join(answer.note.split())
    return Outcome.of(verdict.success), "; ".join(filter(None, (_seen(case, answer, verdict), note)))


def _seen(case: Case, answer: Answer, verdict: Verdict) -> str:
    given = " ".join(answer.text.split())
    match answer.kind:
        case AnswerKind.MEASURED if verdict.distance is not None:
            return f"{verdict.distance.distance_m:g} m to the {case.measured_to or f'nearest {case.goal}'}"
        case AnswerKind.COLLISION:
            return f"touched {given}"
        case AnswerKind.VOID:
            return f"void: {given}"
    return f"ended with {case.ended_with.value}"


@dataclass(frozen=True, slots=True)
class BlindEpisode:
    """An episode as a rater sees it."""

    code: str
    """Identifier that reveals neither the number nor the order of recording."""
    case: Case
    goal: str
    """The goal in words."""


class SecondRating:
    """A rater's episodes, in random order; callable from any thread.

    Answers of earlier sessions count, so the same command resumes.
    """

    def __init__(self, journal: Journal, results: ResultsDirectory, rater: str, sample: int | None, seed: int) -> None:
        """Choose the episodes.

        `sample` is their number including answered ones, None for all; `seed` decides sample and order.

        Raises:
            UsageError: no episode can be judged a second time, or the rater is the first judge of all.
        """
        self.rater = rater
        self._journal, self._results = journal, results
        with transaction(reading(journal.engine)) as connection:
            judged = judged_episodes(connection)
            judges = first_judges(connection, judged)
            given = {judgement.episode for judgement in self._own(second_judgements(connection))}
        if not judged:
            raise UsageError(
                "no judged episode has images", advice="judge episodes first: vsnbench judge", code="nothing-to-judge"
            )
        others = [
            number for number in judged if not any(is_same_person(rater, name) for name in judges.get(number, ()))
        ]
        if not others:
            raise UsageError(
                f"{rater} has judged all {len(judged)} episodes or was their operator",
                advice="a second judgement is another person's",
                code="first-judge",
            )
        self.own_episodes = len(judged) - len(others)
        """Number of episodes left out because the rater has judged or attended them."""
        codes = {number: hashlib.sha256(f"{seed}\0{judged[number]}".encode()).hexdigest()[:16] for number in others}
        drawn = sorted(others, key=lambda number: (number not in given, codes[number]))[:sample]
        self._numbers = {codes[number]: number for number in sorted(drawn, key=codes.__getitem__)}
        self._skipped: list[str] = []
        self._lock = threading.Lock()

    @property
    def codes(self) -> tuple[str, ...]:
        """Codes of all episodes, in order."""
        return tuple(self._numbers)

    def answers(self) -> dict[str, SecondJudgement]:
        """Return the rater's answers by code, the latest first."""
        with transaction(reading(self._journal.engine)) as connection:
            own = self._own(second_judgements(connection, self._numbers.values()))
        by_number = {judgement.episode: judgement for judgement in own}
        found = {code: by_number[number] for code, number in self._numbers.items() if number in by_number}
        return dict(sorted(found.items(), key=lambda item: item[1].created_at, reverse=True))

    def upcoming(self) -> BlindEpisode | None:
        """Return the next episode without an answer, skipped ones last; None if all have one."""
        answered = self.answers()
        with self._lock:
            order = [code for code in self._numbers if code not in self._skipped] + self._skipped
        code = next((code for code in order if code not in answered), None)
        return None if code is None else self._episode(code)

    def skip(self, code: str) -> None:
        """Ask for an episode again after all others."""
        self._number(code)
        with self._lock:
            self._skipped = [*(other for other in self._skipped if other != code), code]

    def judge(self, code: str, read: Callable[[Case], Answer]) -> Outcome:
        """Record the rater's answer about an episode. `read` returns the answer for the blind case.

        Raises:
            MisreadError: the answer does not fit the episode.
            UsageError: the code is unknown, or the episode cannot be judged by this rater.
        """
        case = self._episode(code).case
        outcome, words = decide_second(case, read(case))
        self._journal.judge_second(self._number(code), self.rater, outcome, words)
        return outcome

    def retract(self, code: str) -> None:
        """Retract the rater's answer: the episode is asked again.

        Raises:
            UsageError: there is no answer.
        """
        self._journal.retract_second(self._number(code), self.rater)

    def frame(self, code: str, step: int) -> bytes | None:
        """Return the camera image before an action as JPEG without metadata; None where it is not stored."""
        import cv2

        images = episode_record(self._journal.engine, self._number(code)).images_directory
        if not images or step < 1:
            return None
        content = read_confined(self._results.episode_directory(images), rgb_path(Path(), step))
        pixels = decode_picture(content, cv2.IMREAD_COLOR) if content else None
        if pixels is None:
            return None
        done, jpeg = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 90])
        return jpeg.tobytes() if done else None

    def _own(self, given: tuple[SecondJudgement, ...]) -> list[SecondJudgement]:
        return [judgement for judgement in given if is_same_person(judgement.rater, self.rater)]

    def _number(self, code: str) -> int:
        if code not in self._numbers:
            raise UsageError("this episode is not among yours", advice="reload the page", code="unknown-episode")
        return self._numbers[code]

    def _episode(self, code: str) -> BlindEpisode:
        details = episode_record(self._journal.engine, self._number(code))
        case, site = blind_case(details), recorded_site(details)
        return BlindEpisode(code, case, goal_words(site, case.goal) if site else case.goal)
