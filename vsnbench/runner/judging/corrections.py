"""Judges, corrects and retracts judgements of recorded episodes while a session runs.

Reads from and appends to the results database; a correction keeps the verdict that it replaces.
"""

import contextlib
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from vsnbench.errors import JudgedMeanwhileError, UsageError
from vsnbench.results.files.confined_paths import read_confined
from vsnbench.results.files.images import rgb_path
from vsnbench.results.model import EpisodeRecord
from vsnbench.results.reading.queries import episode_record
from vsnbench.results.writing.judging import trial_of
from vsnbench.runner.judging.case import Case
from vsnbench.runner.judging.decision import JudgingForm, decide
from vsnbench.runner.loop.contract import Session
from vsnbench.runner.loop.follow_up import REPEATABLE
from vsnbench.runner.operator.prompts import AnsweredMeanwhileError, Choice, OperatorPrompts, QuestionKind
from vsnbench.runner.operator.session_summary import ended_episodes, session_summary

RECORD_TIMEOUT_S = 6.0
_POLL_S = 0.02
UNDO_S = 10.0
"""Seconds after a judgement within which it can be retracted without a reason."""
SHOWN = 60
"""Number of latest episodes shown, in addition to those that await a judgement."""


@dataclass(frozen=True, slots=True)
class ShownEpisode:
    """A finished episode as a page shows it."""

    episode: EpisodeRecord
    verdicts: int
    """Number of verdicts including proposals. A correction states the number that its author has seen."""
    author: str
    """Author of the current judgement; empty if no person has judged."""
    verdict_text: str
    undo_s: float
    """Seconds for which its judgement can be retracted; 0 if no longer."""
    case: Case


class Corrections:
    """The episodes of a session and the changes that operators can make to them; callable from any thread."""

    def __init__(self, prompts: OperatorPrompts, session: Session) -> None:
        self._prompts = prompts
        self._journal = session.journal
        self._results = session.recording.results
        self._campaign_ids = session.campaign_ids

    def episodes(self) -> list[ShownEpisode]:
        """Return finished episodes, the latest first."""
        engine = self._journal.engine
        found = sorted(ended_episodes(engine, self._campaign_ids), key=lambda episode: episode.id, reverse=True)
        older = (episode for episode in found[SHOWN:] if episode.outcome == "unjudged")
        return [_shown(episode_record(engine, episode.id)) for episode in (*found[:SHOWN], *older)]

    def amend(self, number: int, form: JudgingForm, author: str, seen: int) -> str:
        """Judge an episode, or correct its current verdict.

        Args:
            number: the episode's number.
            form: what the operator entered; a correction needs a note or a reason for void.
            author: name of the operator.
            seen: number of verdicts that the operator saw.

        Returns:
            The text of the verdict.

        Raises:
            MisreadError: the form does not give an answer, or one that must be confirmed first.
            UsageError: a correction without a reason, or an episode of another session.
            JudgedMeanwhileError: another operator has judged the episode meanwhile.
        """
        details = self._details(number)
        if self._is_asked(number):
            raise UsageError(f"#{number} is the current question", advice="answer there", code="currently-asked")
        as_seen = len(details.verdicts) == seen  # otherwise the journal refuses, and names who was first
        if as_seen and details.current_verdict is not None and not form.note and not form.void:
            raise UsageError(
                "give the reason for the correction: the earlier verdict stays in the record", code="no-reason"
            )
        case = Case.of_recorded(details)
        judgement = decide(case, form.answer(case, is_correction=True))
        self._journal.judge(number, judgement.verdict, author=author, note=judgement.note, seen=seen)
        if judgement.verdict.success is None:
            self._prompts.state.done -= details.outcome != "void"
            self._repeat(number)
        self._prompts.record_changed()
        return judgement.verdict.text

    def undo(self, number: int, author: str, seen: int) -> str:
        """Retract a judgement within seconds: the episode awaits one again, and its trial does not run again.

        Raises:
            UsageError: it is too late, there is no judgement, or the trial is running again already.
            JudgedMeanwhileError: another operator has judged the episode since.
        """
        details = self._details(number)
        if _undo_s(details) <= 0:
            raise UsageError(
                f"#{number} was judged more than {UNDO_S:.0f} s ago",
                advice="correct it, with a reason",
                code="too-late",
            )
        was_void = details.outcome == "void"
        trial = trial_of(self._journal.engine, number) if was_void else 0
        upcoming = self._prompts.state.upcoming
        is_next = was_void and upcoming is not None and upcoming.trial == trial and upcoming.number != number
        if is_next and self._prompts.driving:
            raise UsageError(
                f"the trial of #{number} is running again",
                advice="judge that episode, or correct this one",
                code="trial-runs-again",
            )
        self._journal.retract_verdict(number, author=author, seen=seen)
        if was_void:
            self._prompts.state.retract_void(trial)
            if is_next:
                self._skip(author)
        self._prompts.record_changed()
        return f"#{number} awaits its judgement again"

    def await_judgement(self, number: int, author: str) -> None:
        """Wait until a judgement is recorded, so that what a page confirms survives a kill.

        Raises:
            UsageError: it is not recorded in time.
            JudgedMeanwhileError: another operator was first.
        """
        give_up_s = time.monotonic() + RECORD_TIMEOUT_S
        while (verdict := self._details(number).current_verdict) is None:
            if time.monotonic() > give_up_s:
                raise UsageError(
                    f"the judgement of #{number} is not recorded yet; check the list below", code="not-recorded"
                )
            time.sleep(_POLL_S)
        if verdict.author != author:
            raise JudgedMeanwhileError(f"#{number}: {verdict.author} judged it meanwhile: {verdict.reason}")

    def frame(self, number: int, step: int) -> bytes | None:
        """Return the camera image before an action, as JPEG; None where it is not stored."""
        details = self._details(number)
        if not details.images_directory or step < 1:
            return None
        return read_confined(self._results.path, rgb_path(Path(details.images_directory), step))

    def summary(self) -> list[tuple[str, str]]:
        """Return names and values of the session's summary."""
        return session_summary(self._journal.engine, self._campaign_ids, self._prompts.state)

    def _details(self, number: int) -> EpisodeRecord:
        details = episode_record(self._journal.engine, number)
        if details.campaign_id not in self._campaign_ids:
            raise UsageError(
                f"episode {number} does not belong to this session",
                advice=f"`vsnbench judge {number}`",
                code="other-session",
            )
        return details

    def _is_asked(self, number: int) -> bool:
        question, ended = self._prompts.question, self._prompts.state.ended
        is_judging = question is not None and question.kind is QuestionKind.JUDGE
        return is_judging and ended is not None and ended.number == number

    def _repeat(self, number: int) -> None:
        """Run the trial of an episode again, before any other."""
        self._prompts.state.to_repeat.append(trial_of(self._journal.engine, number))
        question = self._prompts.question
        if question is not None and question.kind is QuestionKind.FINISH:
            with contextlib.suppress(AnsweredMeanwhileError):
                self._prompts.reply(question.number, Choice.AGAIN, "", "the page")

    def _skip(self, author: str) -> None:
        """Skip the trial that is about to begin, because it has a result again."""
        question = self._prompts.question
        if question is not None and question.kind in (QuestionKind.BEGIN, QuestionKind.PLACE):
            with contextlib.suppress(AnsweredMeanwhileError):
                self._prompts.reply(question.number, Choice.SKIP, author, "the page")


def _shown(details: EpisodeRecord) -> ShownEpisode:
    verdict, proposal = details.current_verdict, details.proposal
    author = verdict.author if verdict is not None and verdict.source == "person" else ""
    text = verdict.reason if verdict else f"proposed: {proposal.reason}" if proposal else ""
    if details.error and not author and details.ended_with in REPEATABLE:  # a model's error could name the model
        text = ": ".join(filter(None, (text, details.error)))
    return ShownEpisode(details, len(details.verdicts), author, text, _undo_s(details), Case.of_recorded(details))


def _undo_s(details: EpisodeRecord) -> float:
    verdict = details.current_verdict
    if verdict is None or verdict.source != "person":
        return 0.0
    return max(UNDO_S - (datetime.now(UTC) - verdict.created_at).total_seconds(), 0.0)
