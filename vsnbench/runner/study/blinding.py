"""Hides in a blind study what tells models apart: from the operator, and from Rerun."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from vsnbench.protocol.judge import Verdict
from vsnbench.results.files.episode_entries import (
    EndEntry,
    Entry,
    EpisodeHeader,
    EpisodeSink,
    EpisodeViewer,
    EventEntry,
    StepEntry,
)
from vsnbench.results.reading.blinding import hide_step
from vsnbench.results.reading.read_model import HIDDEN, TELLING
from vsnbench.runner.episode.step import EpisodePlan, Step
from vsnbench.runner.operator.contract import EndedEpisode, Judgement, Operator, Upcoming
from vsnbench.runner.operator.placing import Placing
from vsnbench.sites.site import StartingPosition
from vsnbench.values.decision import Decision


def hide_verdict(verdict: Verdict) -> Verdict:
    """Return a verdict without text that the model wrote."""
    return replace(verdict, text=verdict.end_reason.value) if verdict.end_reason.value in TELLING else verdict


class BlindOperator(Operator):
    """Passes calls on to an operator without the model's diagnostics, errors and computing times."""

    def __init__(self, operator: Operator) -> None:
        self._operator = operator
        self.is_present = operator.is_present
        self.repeats_void_trials = operator.repeats_void_trials

    @property
    def name(self) -> str:
        """Name of the operator who started the last trial, or an empty string."""
        return self._operator.name

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Pass it on; the trial carries a code instead of the model's name."""
        self._operator.trial_begins(upcoming)

    def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
        """Pass it on."""
        self._operator.place(start, problem, placing)

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Pass on the action without diagnostics and inference time."""
        hidden = replace(step, decision=Decision(step.decision.action), timings=replace(step.timings, infer_s=None))
        self._operator.step_taken(plan, hidden)

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Pass it on without the model's error."""
        self._operator.episode_ended(_hide_end(ended))

    def judge(self, ended: EndedEpisode) -> Judgement | None:
        """Ask for a judgement."""
        return self._operator.judge(_hide_end(ended))

    def trials_to_repeat(self) -> Sequence[int]:
        """Return the trials to run again."""
        return self._operator.trials_to_repeat()

    def nothing_left(self) -> Sequence[int]:
        """Ask whether the session ends."""
        return self._operator.nothing_left()


def _hide_end(ended: EndedEpisode) -> EndedEpisode:
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
