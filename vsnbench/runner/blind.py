"""What a run hides while its study is blind: from whoever stands beside the robot, and from Rerun."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from vsnbench.database.blinding import HIDDEN, TELLING, hide_step
from vsnbench.protocol.decision import Decision
from vsnbench.protocol.judge import Verdict
from vsnbench.protocol.site import StartingPosition
from vsnbench.record.entries import EndEntry, Entry, EpisodeHeader, EpisodeSink, EpisodeViewer, EventEntry, StepEntry
from vsnbench.runner.attendant import Attendant, EndedEpisode, Judgement, Upcoming
from vsnbench.runner.episode import EpisodePlan, Step
from vsnbench.runner.placing import Placing


def hide_verdict(verdict: Verdict) -> Verdict:
    """Return a verdict without a model's own words."""
    return replace(verdict, text=verdict.end_reason.value) if verdict.end_reason.value in TELLING else verdict


class BlindAttendant:
    """Whoever stands beside the robot, told neither what a model says of itself nor how long it thinks."""

    def __init__(self, attendant: Attendant) -> None:
        self._attendant = attendant

    @property
    def beside(self) -> str:
        """Pass it on."""
        return self._attendant.beside

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Pass it on: it has a code, and no name."""
        self._attendant.trial_begins(upcoming)

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Pass on the action alone."""
        said = replace(step, decision=Decision(step.decision.action), timings=replace(step.timings, infer_s=None))
        self._attendant.step_taken(plan, said)

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Pass it on."""
        self._attendant.episode_ended(_hide_end(ended))

    def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
        """Pass it on."""
        self._attendant.place(start, problem, placing)

    def again(self) -> Sequence[int]:
        """Pass it on."""
        return self._attendant.again()

    def nothing_left(self) -> Sequence[int]:
        """Ask."""
        return self._attendant.nothing_left()

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
