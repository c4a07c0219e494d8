"""Reads a recorded episode as the entries that a live viewer receives."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from vsnbench.errors import RecordError
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.confined_paths import read_confined
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.files.episode_entries import Entry, EpisodeHeader, EventEntry, StepEntry
from vsnbench.results.files.film import film_of, film_path
from vsnbench.results.files.image_set import ImageFault, image_faults
from vsnbench.results.files.images import depth_path, rgb_path, step_digests_of
from vsnbench.results.model import EpisodeRecord
from vsnbench.results.reading.queries import episode_record, episode_steps
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.sites.site import Site
from vsnbench.values.encoding.codec import decision_from_record
from vsnbench.values.encoding.image_digest import StepDigests
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.robot_identity import IMPORTED
from vsnbench.values.robot_profile import RobotProfile
from vsnbench.values.step import StepRecord


@dataclass(frozen=True, slots=True)
class EpisodeReplay:
    """One recorded episode."""

    header: EpisodeHeader
    entries: tuple[Entry, ...]
    """Steps, each followed by its events, and the end if the episode has ended."""
    directory: Path
    """Directory of its files."""
    image_faults: tuple[ImageFault, ...] = ()
    """Images that are missing or damaged."""

    @property
    def has_no_images(self) -> bool:
        """Whether there are steps, but no image of any of them."""
        steps = [entry for entry in self.entries if isinstance(entry, StepEntry)]
        return bool(steps) and all(step.rgb_jpeg is None for step in steps)

    @property
    def end(self) -> EpisodeEnd | None:
        """The current verdict; None while the episode runs."""
        last = self.entries[-1] if self.entries else None
        return last if isinstance(last, EpisodeEnd) else None


def read_episode(results: ResultsDirectory, episode_id: int) -> EpisodeReplay:
    """Read an episode with its images.

    Raises:
        UsageError: there is no such episode.
        RecordError: the database cannot be read.
    """
    with open_record(results.database_url) as engine:
        episode, steps = episode_record(engine, episode_id), episode_steps(engine, episode_id)
    return replay_of(results, episode, steps)


def replay_of(results: ResultsDirectory, episode: EpisodeRecord, steps: tuple[StepRecord, ...]) -> EpisodeReplay:
    """Return the entries of an episode that has been read, with its images.

    Raises:
        RecordError: its site, robot or protocol cannot be read.
    """
    images = episode.images_directory
    directory = results.episode_directory(images or f"episodes/{episode.id:06d}")
    entries = [*_steps_and_events(episode, steps, directory if images else None), *_end(episode)]
    faults: list[ImageFault] = []
    if images:
        faults = image_faults(directory, list(map(_digests, steps)), read=False)
    return EpisodeReplay(_header(episode), tuple(entries), directory, tuple(faults))


def _digests(step: StepRecord) -> StepDigests:
    return step_digests_of(step.number, step.rgb_digest, step.depth_digest, (None, None), step.details)


def _header(episode: EpisodeRecord) -> EpisodeHeader:
    provenance = episode.provenance
    try:
        site, robot = (
            Site.model_validate(provenance.site_content),
            RobotProfile.model_validate(provenance.robot_profile),
        )
        parameters = ProtocolParameters.from_record(provenance.protocol)
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        if episode.origin == IMPORTED:
            raise RecordError(
                f"the site or robot of the imported episode {episode.id} is unknown, so it cannot be drawn",
                advice=f"`vsnbench episodes show {episode.id}` prints what is recorded",
                code="imported-episode",
            ) from error
        raise RecordError(
            f"the site, robot or protocol of episode {episode.id} cannot be read",
            advice="the results are damaged; restore a backup",
            code="damaged-record",
        ) from error
    return EpisodeHeader(
        episode_id=episode.id,
        uuid=episode.uuid,
        goal=episode.goal,
        model=f"{episode.model} ({provenance.weights_label})" if provenance.weights_label else episode.model,
        robot=robot.title,
        site=site,
        start_number=episode.start,
        begin=episode.placement or Fix(site.start(episode.start).pose, PoseSource.SURVEYED),
        parameters=parameters,
        robot_radius_m=robot.base.radius_m,
        cameras=tuple(sorted(robot.cameras)),
    )


def _steps_and_events(episode: EpisodeRecord, steps: tuple[StepRecord, ...], images: Path | None) -> Iterator[Entry]:
    events = [EventEntry(event.step_number or 0, event.kind, event.text, event.author) for event in episode.events]
    for step in steps:
        while events and events[0].step < step.number:
            yield events.pop(0)
        yield _step(step, images)
    yield from events


def _step(step: StepRecord, images: Path | None) -> StepEntry:
    def read(role: str) -> tuple[bytes | None, bytes | None]:
        if images is None:
            return None, None
        files = rgb_path(Path(), step.number, role), depth_path(Path(), step.number, role)
        return read_confined(images, files[0]), read_confined(images, files[1])

    return StepEntry(
        step,
        decision_from_record(step.action, step.raw_action, step.probabilities, step.details),
        *read(""),
        tuple(
            replace(frame, rgb_jpeg=read_confined(images, film_path(Path(), step.number, place)) if images else None)
            for place, frame in enumerate(film_of(step.details), start=1)
        ),
        {role: read(role) for role, _ in _digests(step).cameras},
    )


def _end(episode: EpisodeRecord) -> Iterator[EpisodeEnd]:
    if episode.end_reason is None:
        return
    distance = None
    if episode.distance_m is not None and episode.distance_source is not None:
        source = PoseSource(episode.distance_source)
        is_hidden = episode.current_verdict is not None and episode.current_verdict.goal_in_sight is False
        distance = GoalDistance(episode.distance_m, source, episode.goal_instance or "", not is_hidden)
    text = episode.current_verdict.reason if episode.current_verdict else "not judged yet"
    verdict = Verdict(EndReason(episode.end_reason), episode.success, text, distance)
    yield EpisodeEnd(
        verdict, episode.actions, error=episode.error, path_m=episode.path_m, duration_s=episode.duration_s
    )
