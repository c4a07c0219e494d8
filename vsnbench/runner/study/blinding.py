"""Hides in a blind study what tells models apart: from the operator, and from Rerun."""

from dataclasses import replace
from pathlib import Path

from vsnbench.protocol.judge import Verdict
from vsnbench.results.files.episode_entries import (
    Entry,
    EpisodeHeader,
    EpisodeSink,
    EpisodeViewer,
    EventEntry,
    StepEntry,
)
from vsnbench.results.reading.blinding import hide_step
from vsnbench.results.reading.read_model import HIDDEN, TELLING
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.runner.episode.step import Step
from vsnbench.runner.operator.contract import EndedEpisode
from vsnbench.values.decision import Decision


def hide_verdict(verdict: Verdict) -> Verdict:
    """Return a verdict without text that the model wrote."""
    return replace(verdict, text=verdict.end_reason.value) if verdict.end_reason.value in TELLING else verdict


def hide_choice(step: Step) -> Step:
    """Return a step without the model's diagnostics and inference time."""
    timings = replace(step.timings, infer_s=None)
    return replace(step, decision=Decision(step.decision.action), timings=timings, answer=None)


def hide_end(ended: EndedEpisode) -> EndedEpisode:
    """Return an ended episode without the model's error."""
    outcome = ended.outcome
    if outcome.verdict.end_reason.value not in TELLING:
        return ended
    return replace(ended, outcome=replace(outcome, error=HIDDEN, verdict=hide_verdict(outcome.verdict)))


class BlindViewer:
    """Shows and copies episodes without what tells models apart; complete copies are made after unblinding."""

    def __init__(self, viewer: EpisodeViewer) -> None:
        self._viewer = viewer

    @property
    def is_live(self) -> bool:
        """Whether episodes are shown as they happen."""
        return self._viewer.is_live

    def prepare(self) -> None:
        """Prepare the viewer."""
        self._viewer.prepare()

    def open_episode(self, header: EpisodeHeader, directory: Path) -> EpisodeSink:
        """Return a sink that passes on what may be shown."""
        return _BlindSink(self._viewer.open_episode(header, directory), header)


class _BlindSink:
    def __init__(self, sink: EpisodeSink, header: EpisodeHeader) -> None:
        self._sink = sink
        self._drives_on = header.parameters.execution is not None

    def add(self, entry: Entry) -> None:
        if self._drives_on and isinstance(entry, EpisodeEnd):
            entry = replace(entry, duration_s=None)
        self._sink.add(_hide_entry(entry))

    def close(self) -> object:
        return self._sink.close()


def _hide_entry(entry: Entry) -> Entry:
    match entry:
        case StepEntry():
            return replace(entry, step=hide_step(entry.step), decision=Decision(entry.decision.action))
        case EventEntry() if entry.kind in TELLING:
            return replace(entry, text=HIDDEN)
        case EpisodeEnd() if entry.verdict.end_reason.value in TELLING:
            return replace(entry, verdict=hide_verdict(entry.verdict), error=HIDDEN)
        case _:
            return entry
