"""An episode as entries: the same whether they come from a running robot or from the record.

A sink takes the entries of one episode, to show or to copy it; a viewer opens a sink for every episode.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from vsnbench.protocol.decision import Decision
from vsnbench.protocol.fix import Fix
from vsnbench.protocol.judge import Verdict
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import Site
from vsnbench.protocol.step_record import StepRecord


@dataclass(frozen=True, slots=True)
class EpisodeHeader:
    """What is known before the first step."""

    episode_id: int
    uuid: str
    goal: str
    model: str
    """The model's name, with its weights where it has any."""
    robot: str
    site: Site
    start_number: int
    begin: Fix
    """Where the robot really stood when the episode began; odometry and maps of the policy are relative to it."""
    parameters: ProtocolParameters = field(default_factory=ProtocolParameters)
    robot_radius_m: float = 0.177


@dataclass(frozen=True, slots=True, eq=False)
class StepEntry:
    """One step as it is kept, with its images as they lie in the record: each is encoded once, for file and viewer."""

    step: StepRecord
    decision: Decision
    """The policy's, whose diagnostics the step's `details` have as JSON."""
    rgb_jpeg: bytes | None
    """None where the image is lost or was not kept."""
    depth_png: bytes | None
    """16-bit, millimetres, 0 where invalid."""


@dataclass(frozen=True, slots=True)
class EventEntry:
    """Something that happened beside the steps."""

    step: int
    """The action it followed; 0 before the first."""
    kind: str
    text: str
    author: str = ""
    """Who did it; empty for what nobody did."""


@dataclass(frozen=True, slots=True)
class EndEntry:
    """How the episode ended."""

    verdict: Verdict
    actions: int
    path_length_m: float | None = None
    duration_s: float | None = None
    error: str = ""


Entry = StepEntry | EventEntry | EndEntry


class EpisodeSink(Protocol):
    """Takes the entries of one episode; whatever becomes of them, it neither raises nor holds anybody up."""

    def add(self, entry: Entry) -> None:
        """Take a step, an event or the end."""
        ...

    def close(self) -> object:
        """Finish what was taken."""
        ...


class EpisodeViewer(Protocol):
    """Opens a sink for every episode of a run; each worker of a run has one of its own, made from the same values."""

    @property
    def is_live(self) -> bool:
        """Whether somebody is shown the episodes as they happen."""
        ...

    def prepare(self) -> None:
        """Get ready, when nothing can be refused any more.

        Raises:
            VsnbenchError: there is nothing to show episodes with.
        """
        ...

    def open_episode(self, header: EpisodeHeader, directory: Path) -> EpisodeSink:
        """Return the sink of an episode whose files lie in `directory`."""
        ...
