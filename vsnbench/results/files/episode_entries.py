"""Entries of an episode, the same for a running robot and for the record.

A sink receives the entries of one episode to show or copy them; a viewer opens a sink for each episode.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.film import RecordedFrame
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.sites.site import Site
from vsnbench.values.decision import Decision
from vsnbench.values.fix import Fix
from vsnbench.values.step import StepRecord


@dataclass(frozen=True, slots=True)
class EpisodeHeader:
    """Data known before the first step."""

    episode_id: int
    uuid: str
    goal: str
    model: str
    """Name of the model with its weights, if any."""
    robot: str
    site: Site
    start_number: int
    begin: Fix
    """True start pose of the robot; odometry and the policy's maps are relative to it."""
    parameters: ProtocolParameters = field(default_factory=ProtocolParameters)
    robot_radius_m: float = 0.177
    cameras: tuple[str, ...] = ()
    """Roles of the robot's further cameras."""


@dataclass(frozen=True, slots=True, eq=False)
class StepEntry:
    """A recorded step with its encoded images, which files and viewers share."""

    step: StepRecord
    decision: Decision
    """Decision of the policy; the step's `details` contain its diagnostics as JSON."""
    rgb_jpeg: bytes | None
    """None if the image is missing."""
    depth_png: bytes | None
    """16-bit, millimetres, 0 if invalid."""
    film: tuple[RecordedFrame, ...] = ()
    """Images that were taken while the robot drove on, until the next answer took effect."""
    cameras: Mapping[str, tuple[bytes | None, bytes | None]] = field(default_factory=dict)
    """Colours and depth of further cameras by role, as `rgb_jpeg` and `depth_png`."""


@dataclass(frozen=True, slots=True)
class EventEntry:
    """An event of an episode."""

    step: int
    """Number of the preceding action; 0 before the first."""
    kind: str
    text: str
    author: str = ""
    """Author of the event, or an empty string."""


Entry = StepEntry | EventEntry | EpisodeEnd


class EpisodeSink(Protocol):
    """Receives the entries of one episode; never raises or blocks."""

    def add(self, entry: Entry) -> None:
        """Receive a step, an event or the end."""

    def close(self) -> object:
        """Finish the episode."""


class EpisodeViewer(Protocol):
    """Opens a sink for each episode; every worker of a run has its own viewer."""

    @property
    def is_live(self) -> bool:
        """Whether episodes are shown live."""

    def prepare(self) -> None:
        """Prepare the viewer after all checks have passed.

        Raises:
            VsnbenchError: the viewer is not available.
        """

    def open_episode(self, header: EpisodeHeader, directory: Path) -> EpisodeSink:
        """Return the sink of an episode with files in `directory`."""
