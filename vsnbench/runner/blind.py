"""What a run hides while its study is blind: from the screen, from Rerun, and from the lines of the log."""

import logging
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

from vsnbench.database.blinding import HIDDEN, TELLING, hide_step
from vsnbench.protocol.decision import Decision
from vsnbench.protocol.judge import Verdict
from vsnbench.protocol.site import StartingPosition
from vsnbench.record.entries import EndEntry, Entry, EpisodeHeader, EpisodeSink, EpisodeViewer, EventEntry, StepEntry
from vsnbench.runner.attendant import Attendant, EndedEpisode, Judgement
from vsnbench.runner.episode import EpisodePlan, Step

UNSAID = "[hidden]"
"""What stands in a line in place of a word that gives a model away; not a code, which would give it away too."""
_SHORTEST = 2


def hide_verdict(verdict: Verdict) -> Verdict:
    """Return a verdict without a model's own words."""
    return replace(verdict, text=verdict.end_reason.value) if verdict.end_reason.value in TELLING else verdict


class BlindAttendant:
    """Whoever stands beside the robot, told neither what a model says of itself nor how long it thinks."""

    def __init__(self, attendant: Attendant) -> None:
        self._attendant = attendant

    def trial_begins(self, plan: EpisodePlan) -> None:
        """Pass it on."""
        self._attendant.trial_begins(plan)

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Pass on the action alone."""
        said = replace(step, decision=Decision(step.decision.action), timings=replace(step.timings, infer_s=None))
        self._attendant.step_taken(plan, said)

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Pass it on."""
        self._attendant.episode_ended(_hide_end(ended))

    def place(self, start: StartingPosition, problem: str) -> None:
        """Pass it on."""
        self._attendant.place(start, problem)

    def judge(self, ended: EndedEpisode) -> Judgement | None:
        """Ask."""
        return self._attendant.judge(_hide_end(ended))


def _hide_end(ended: EndedEpisode) -> EndedEpisode:
    outcome = ended.outcome
    if outcome.verdict.end_reason.value not in TELLING:
        return ended
    return replace(ended, outcome=replace(outcome, error=HIDDEN, verdict=hide_verdict(outcome.verdict)))


class BlindViewer:
    """Shows and copies episodes without what tells their models; a copy that is whole is made again when unblinded."""

    def __init__(self, viewer: EpisodeViewer) -> None:
        self._viewer = viewer

    @property
    def is_live(self) -> bool:
        """Whether somebody is shown the episodes as they happen."""
        return self._viewer.is_live

    def prepare(self) -> None:
        """Get ready."""
        self._viewer.prepare()

    def open_episode(self, header: EpisodeHeader, directory: Path) -> EpisodeSink:
        """Return a sink that passes on what may be seen."""
        return _BlindSink(self._viewer.open_episode(header, directory))


class _BlindSink:
    def __init__(self, sink: EpisodeSink) -> None:
        self._sink = sink

    def add(self, entry: Entry) -> None:
        self._sink.add(_hide_entry(entry))

    def close(self) -> object:
        return self._sink.close()


def _hide_entry(entry: Entry) -> Entry:
    match entry:
        case StepEntry():
            return replace(entry, step=hide_step(entry.step), decision=Decision(entry.decision.action))
        case EventEntry() if entry.kind in TELLING:
            return replace(entry, text=HIDDEN)
        case EndEntry() if entry.verdict.end_reason.value in TELLING:
            return replace(entry, verdict=hide_verdict(entry.verdict), error=HIDDEN)
        case _:
            return entry


class _WithoutWords(logging.Filter):
    def __init__(self, words: re.Pattern[str]) -> None:
        super().__init__()
        self._words = words

    def filter(self, record: logging.LogRecord) -> bool:
        record.msg, record.args = self._words.sub(UNSAID, record.getMessage()), ()
        return True


class _StreamWithoutWords:
    """A text stream that writes what it is given without certain words; everything else is the stream's own."""

    def __init__(self, stream: TextIO, words: re.Pattern[str]) -> None:
        self._stream = stream
        self._words = words

    def write(self, text: str) -> int:
        self._stream.write(self._words.sub(UNSAID, text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def words_hidden(words: Iterable[str]) -> Iterator[None]:
    """Keep these words out of the log, and out of what anything in this process prints, models included."""
    known = sorted({word for word in words if len(word) >= _SHORTEST}, key=len, reverse=True)
    if not known:
        yield
        return
    pattern = re.compile(rf"(?<![A-Za-z0-9])(?:{'|'.join(map(re.escape, known))})(?![A-Za-z0-9])", re.IGNORECASE)
    unsaid = _WithoutWords(pattern)
    handlers = list(logging.getLogger().handlers)
    streams = sys.stdout, sys.stderr
    for handler in handlers:
        handler.addFilter(unsaid)
    sys.stdout, sys.stderr = (_StreamWithoutWords(stream, pattern) for stream in streams)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = streams
        for handler in handlers:
            handler.removeFilter(unsaid)
