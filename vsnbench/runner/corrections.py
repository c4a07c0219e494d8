"""What is said of episodes that have ended already: taken back within seconds, or corrected with a reason.

Everything is read from the record and written there; nothing that was said before is forgotten.
"""

import contextlib
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from vsnbench.database.journal import Journal
from vsnbench.database.judging import trial_of
from vsnbench.database.lifecycle import ENDED, EpisodeState
from vsnbench.database.queries import episode_details, list_episodes
from vsnbench.database.read_shapes import EpisodeDetails, EpisodeFilter, EpisodeSummary
from vsnbench.errors import JudgedMeanwhileError, UsageError
from vsnbench.record.confined import read_confined
from vsnbench.record.images import rgb_path
from vsnbench.record.results import ResultsDirectory
from vsnbench.runner.attendance import Occasion
from vsnbench.runner.case import Case, Word
from vsnbench.runner.desk import AnsweredMeanwhileError, Asks, Choice, Desk
from vsnbench.runner.session import TAKEN_AGAIN
from vsnbench.runner.session_summary import session_summary

KEPT_WITHIN_S = 6.0
_LOOKS_EVERY_S = 0.02
UNDO_S = 10.0
"""For so long a judgement can be taken back without a reason."""
SHOWN = 60
"""Episodes, the latest ones; whatever awaits a judgement beside."""


@dataclass(frozen=True, slots=True)
class ShownEpisode:
    """An episode that has ended, as a page shows it."""

    summary: EpisodeSummary
    verdicts: int
    """How many there are, proposals included: whoever corrects says how many were seen."""
    author: str
    """Whose judgement stands; empty where no person's does."""
    words: str
    undo_s: float
    """For how long its judgement can still be taken back; 0 for no more."""
    case: Case


class Corrections:
    """The episodes of what is run, and what may still be said of them; from any thread."""

    def __init__(self, desk: Desk, occasion: Occasion) -> None:
        self._desk = desk
        self._journal: Journal = occasion.journal
        self._results: ResultsDirectory = occasion.results
        self._campaigns = occasion.campaigns

    def episodes(self) -> list[ShownEpisode]:
        """Return what has ended, the latest first."""
        engine = self._journal.engine
        found = [
            one
            for campaign in self._campaigns
            for one in list_episodes(engine, EpisodeFilter(campaign=str(campaign)))
            if one.state in ENDED
        ]
        found.sort(key=lambda one: one.id, reverse=True)
        latest = [*found[:SHOWN], *(one for one in found[SHOWN:] if one.state == EpisodeState.AWAITING)]
        return [self._shown(episode_details(engine, one.id)) for one in latest]

    def amend(self, number: int, word: Word, note: str, author: str, seen: int) -> str:
        """Judge an episode, or judge it anew.

        Args:
            number: the episode's.
            word: what is said of it.
            note: why, where a judgement stands already.
            author: who says so.
            seen: how many verdicts were there when it was looked at.

        Raises:
            MisreadError: the word cannot be taken.
            UsageError: a correction without a reason, or an episode that is not of what is run.
            JudgedMeanwhileError: another has judged it since.
        """
        details = self._mine(number)
        if self._is_asked_about(number):
            raise UsageError(f"#{number} is asked about now", advice="answer there")
        judgement = Case.of_recorded(details).judged_by(word, note)
        as_seen = len(details.verdicts) == seen  # else another was first, which the journal says
        if as_seen and details.standing is not None and not note and not word.void:
            raise UsageError("say why it is corrected: what stood before stays in the record beside it")
        self._journal.judge(number, judgement.verdict, author=author, note=judgement.note, seen=seen)
        if judgement.verdict.success is None:
            self._desk.board.done -= details.summary.state != EpisodeState.VOID
            self._wanted_again(number)
        self._desk.record_changed()
        return judgement.verdict.text

    def undo(self, number: int, author: str, seen: int) -> str:
        """Take a judgement back, within seconds of it: the episode awaits one again, and its trial is not run again.

        Raises:
            UsageError: it is too late, there is none, or its trial is being driven again already.
            JudgedMeanwhileError: another has judged it since.
        """
        details = self._mine(number)
        if _undo_s(details) <= 0:
            raise UsageError(f"#{number} was judged more than {UNDO_S:.0f} s ago", advice="correct it, with a reason")
        was_void = details.summary.state == EpisodeState.VOID
        trial = trial_of(self._journal.engine, number) if was_void else 0
        upcoming = self._desk.board.upcoming
        comes_again = was_void and upcoming is not None and upcoming.trial == trial and upcoming.number != number
        if comes_again and self._desk.driving:
            raise UsageError(f"the trial of #{number} is being driven again", advice="judge that, or correct this")
        self._journal.take_back(number, author=author, seen=seen)
        if was_void:
            self._desk.board.no_longer_void(trial)
            if comes_again:
                self._skip(author)
        self._desk.record_changed()
        return f"#{number} awaits its judgement again"

    def await_judgement(self, number: int, author: str) -> None:
        """Wait until the record has what was just said of an episode: what a page confirms outlives a kill.

        Raises:
            UsageError: it does not have it in time.
            JudgedMeanwhileError: another was first, beside the desk.
        """
        give_up_s = time.monotonic() + KEPT_WITHIN_S
        while (standing := self._mine(number).standing) is None:
            if time.monotonic() > give_up_s:
                raise UsageError(f"the record does not have it yet: look whether #{number} is judged below")
            time.sleep(_LOOKS_EVERY_S)
        if standing.author != author:
            raise JudgedMeanwhileError(f"#{number}: {standing.author} said meanwhile: {standing.reason}")

    def frame(self, number: int, step: int) -> bytes | None:
        """Return what the robot saw before an action, as JPEG; None where it is not kept."""
        details = self._mine(number)
        if not details.summary.images_directory or step < 1:
            return None
        return read_confined(self._results.path, rgb_path(Path(details.summary.images_directory), step))

    def summary(self) -> list[tuple[str, str]]:
        """Return what a session's end says: names and values, for people."""
        return session_summary(self._journal.engine, self._campaigns, self._desk.board)

    def _mine(self, number: int) -> EpisodeDetails:
        details = episode_details(self._journal.engine, number)
        if details.summary.campaign_id not in self._campaigns:
            raise UsageError(f"episode {number} is not of what is run here", advice=f"`vsnbench judge {number}`")
        return details

    def _shown(self, details: EpisodeDetails) -> ShownEpisode:
        standing = details.standing
        author = standing.author if standing is not None and standing.source == "person" else ""
        proposed = next((one.reason for one in reversed(details.verdicts) if one.proposed), "")
        words = standing.reason if standing else f"proposed: {proposed}" if proposed else ""
        if details.error and not author and details.ended_with in TAKEN_AGAIN:  # a model's own words may tell its name
            words = ": ".join(filter(None, (words, details.error)))
        return ShownEpisode(
            details.summary,
            len(details.verdicts),
            author,
            words,
            _undo_s(details),
            Case.of_recorded(details),
        )

    def _is_asked_about(self, number: int) -> bool:
        question, ended = self._desk.question, self._desk.board.ended
        return question is not None and question.asks is Asks.JUDGE and ended is not None and ended.number == number

    def _wanted_again(self, number: int) -> None:
        """Have the trial of an episode that was declared void run again, before any other."""
        self._desk.board.again.append(trial_of(self._journal.engine, number))
        question = self._desk.question
        if question is not None and question.asks is Asks.FINISH:
            with contextlib.suppress(AnsweredMeanwhileError):
                self._desk.reply(question.number, Choice.AGAIN, "", "the page")

    def _skip(self, author: str) -> None:
        """Have the trial that is about to begin left out for now; one that has a result is not begun again."""
        question = self._desk.question
        if question is not None and question.asks in (Asks.BEGIN, Asks.PLACE):
            with contextlib.suppress(AnsweredMeanwhileError):
                self._desk.reply(question.number, Choice.SKIP, author, "the page")


def _undo_s(details: EpisodeDetails) -> float:
    standing = details.standing
    if standing is None or standing.source != "person":
        return 0.0
    return max(UNDO_S - (datetime.now(UTC) - standing.created_at).total_seconds(), 0.0)
