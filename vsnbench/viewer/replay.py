"""An episode read back from the record, as the entries that a viewer was, or would have been, given live."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from vsnbench.database.migrate import open_record
from vsnbench.database.queries import episode_details, episode_steps
from vsnbench.database.read_shapes import EpisodeDetails
from vsnbench.protocol.codec import decision_from_record
from vsnbench.protocol.fix import Fix, PoseSource
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site
from vsnbench.protocol.step_record import StepRecord
from vsnbench.record.confined import read_confined
from vsnbench.record.entries import EndEntry, Entry, EpisodeHeader, EventEntry, StepEntry
from vsnbench.record.images import depth_path, rgb_path
from vsnbench.record.results import ResultsDirectory


@dataclass(frozen=True, slots=True)
class EpisodeReplay:
    """One recorded episode."""

    header: EpisodeHeader
    entries: tuple[Entry, ...]
    """Steps, each followed by its events; the end comes last, where the episode has ended."""
    directory: Path
    """Where its files lie."""

    @property
    def keeps_no_images(self) -> bool:
        """Whether there are steps, and of none of them an image."""
        steps = [entry for entry in self.entries if isinstance(entry, StepEntry)]
        return bool(steps) and all(step.rgb_jpeg is None for step in steps)

    @property
    def end(self) -> EndEntry | None:
        """The standing verdict; None while the episode runs."""
        last = self.entries[-1] if self.entries else None
        return last if isinstance(last, EndEntry) else None


def read_episode(results: ResultsDirectory, episode_id: int) -> EpisodeReplay:
    """Read an episode with its images.

    Raises:
        UsageError: there is no such episode.
        RecordError: the database cannot be read.
    """
    with open_record(results.database_url) as engine:
        details, steps = episode_details(engine, episode_id), episode_steps(engine, episode_id)
    images = details.summary.images_directory
    directory = results.episode_directory(images or f"episodes/{episode_id:06d}")
    entries = [*_steps_and_events(details, steps, directory if images else None), *_end(details)]
    return EpisodeReplay(_header(details), tuple(entries), directory)


def _header(details: EpisodeDetails) -> EpisodeHeader:
    episode, given = details.summary, details.provenance
    site, robot = Site.model_validate(given.site_content), RobotProfile.model_validate(given.robot_profile)
    return EpisodeHeader(
        episode_id=episode.id,
        uuid=episode.uuid,
        goal=episode.goal,
        model=f"{episode.model} ({given.weights_label})" if given.weights_label else episode.model,
        robot=robot.title,
        site=site,
        start_number=episode.start,
        begin=details.placement or Fix(site.start(episode.start).pose, PoseSource.SURVEYED),
        parameters=ProtocolParameters.from_record(given.protocol),
        robot_radius_m=robot.base.radius_m,
    )


def _steps_and_events(details: EpisodeDetails, steps: tuple[StepRecord, ...], images: Path | None) -> Iterator[Entry]:
    events = [EventEntry(event.step_number or 0, event.kind, event.text, event.author) for event in details.events]
    for step in steps:
        while events and events[0].step < step.number:
            yield events.pop(0)
        yield _step(step, images)
    yield from events


def _step(step: StepRecord, images: Path | None) -> StepEntry:
    return StepEntry(
        step,
        decision_from_record(step.action, step.raw_action, step.probabilities, step.details),
        read_confined(images, rgb_path(Path(), step.number)) if images else None,
        read_confined(images, depth_path(Path(), step.number)) if images else None,
    )


def _end(details: EpisodeDetails) -> Iterator[EndEntry]:
    episode = details.summary
    if episode.end_reason is None:
        return
    distance = None
    if episode.distance_to_goal_m is not None and episode.distance_source is not None:
        source = PoseSource(episode.distance_source)
        hidden = details.standing is not None and details.standing.goal_in_sight is False
        distance = GoalDistance(episode.distance_to_goal_m, source, details.goal_instance or "", not hidden)
    words = details.standing.reason if details.standing else "not judged yet"
    verdict = Verdict(EndReason(episode.end_reason), episode.success, words, distance)
    yield EndEntry(verdict, episode.actions, episode.path_length_m, episode.duration_s, details.error)
