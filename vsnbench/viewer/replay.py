"""An episode read back from the record, as the entries that a viewer was, or would have been, given live."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import select
from sqlalchemy.orm import Session

from vsnbench.database.engine import open_engine, reading, record_errors
from vsnbench.database.migrate import schema_state
from vsnbench.database.read_model import (
    DISTANCE_M,
    DISTANCE_SOURCE,
    END_REASON,
    GOAL_INSTANCE,
    SUCCESS,
    episodes_of_trials,
)
from vsnbench.database.tables import Campaign, Episode, Event, Model, Robot, Site, Step, Trial
from vsnbench.database.tables import Verdict as VerdictRow
from vsnbench.errors import DecisionError, RecordError, UsageError
from vsnbench.protocol.codec import decision_from_record
from vsnbench.protocol.fix import Fix, PoseSource
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict
from vsnbench.protocol.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site as SurveyedSite
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
    engine = open_engine(results.database_url, read_only=True)
    try:
        if not schema_state(engine).up_to_date:
            raise RecordError(f"{results.shown_database} is of an older vsnbench: run `vsnbench db upgrade` first")
        with record_errors(engine), Session(reading(engine)) as session:
            return _Reader(session, results, episode_id).replay()
    finally:
        engine.dispose()


class _Reader:
    """Reads one episode through one session."""

    def __init__(self, session: Session, results: ResultsDirectory, episode_id: int) -> None:
        episode = session.get(Episode, episode_id)
        if episode is None:
            raise UsageError(f"there is no episode {episode_id} in {results.path}: `vsnbench episodes list` shows them")
        self._session = session
        self._episode = episode
        self._directory = results.episode_directory(episode.images_directory or f"episodes/{episode_id:06d}")
        self._has_images = bool(episode.images_directory)

    def replay(self) -> EpisodeReplay:
        entries = [*self._steps_and_events(), *self._end()]
        return EpisodeReplay(self._header(), tuple(entries), self._directory)

    def _header(self) -> EpisodeHeader:
        episode = self._episode
        trial, campaign, site, robot, model = self._session.execute(
            select(Trial, Campaign, Site, Robot, Model)
            .join(Campaign, Campaign.id == Trial.campaign_id)
            .join(Site, Site.id == Campaign.site_id)
            .join(Robot, Robot.id == Campaign.robot_id)
            .join(Model, Model.id == Campaign.model_id)
            .where(Trial.id == episode.trial_id)
        ).one()
        place = SurveyedSite.model_validate(site.content)
        profile = RobotProfile.model_validate(robot.profile)
        begin = _fix(episode.start_x_m, episode.start_y_m, episode.start_heading_rad, episode.start_source)
        return EpisodeHeader(
            episode_id=episode.id,
            uuid=episode.uuid,
            goal=trial.goal,
            model=f"{model.name} ({model.weights_label})" if model.weights_label else model.name,
            robot=robot.title,
            site=place,
            start_number=trial.start,
            begin=begin or Fix(place.start(trial.start).pose, PoseSource.SURVEYED),
            parameters=ProtocolParameters.from_record(campaign.protocol),
            robot_radius_m=profile.base.radius_m,
        )

    def _steps_and_events(self) -> Iterator[Entry]:
        steps = self._session.scalars(select(Step).where(Step.episode_id == self._episode.id).order_by(Step.number))
        events = list(
            self._session.scalars(select(Event).where(Event.episode_id == self._episode.id).order_by(Event.id))
        )
        for step in steps:
            while events and (events[0].step_number or 0) < step.number:
                yield _event(events.pop(0))
            yield self._step(step)
        for event in events:
            yield _event(event)

    def _step(self, row: Step) -> StepEntry:
        rgb = self._image(rgb_path(Path(), row.number))
        depth = self._image(depth_path(Path(), row.number))
        try:
            decision = decision_from_record(row.action, row.raw_action, row.probabilities, row.details)
        except DecisionError as error:
            raise RecordError(
                f"episode {self._episode.id}, step {row.number}: {error}; the record is damaged"
            ) from error
        return StepEntry(
            index=row.number,
            stamp_s=row.stamp_s if row.stamp_s is not None else float(row.number),
            rgb_jpeg=rgb,
            depth_png=depth,
            decision=decision,
            result=None if row.blocked else _motion(row),
            blocked=row.blocked,
            after=_fix(row.world_x_m, row.world_y_m, row.world_heading_rad, row.world_source),
            infer_s=row.infer_s,
        )

    def _image(self, name: Path) -> bytes | None:
        return read_confined(self._directory, name) if self._has_images else None

    def _end(self) -> Iterator[EndEntry]:
        episode = self._episode
        if episode.end_reason is None:
            return
        row = self._session.execute(
            episodes_of_trials(
                END_REASON.label("end_reason"),
                SUCCESS.label("success"),
                DISTANCE_M.label("distance_m"),
                DISTANCE_SOURCE.label("distance_source"),
                GOAL_INSTANCE.label("goal_instance"),
                VerdictRow.reason,
            ).where(Episode.id == episode.id)
        ).one()
        distance = None
        if row.distance_m is not None:
            distance = GoalDistance(row.distance_m, PoseSource(row.distance_source), row.goal_instance or "")
        verdict = Verdict(EndReason(row.end_reason), row.success, row.reason or "not judged yet", distance)
        yield EndEntry(verdict, episode.actions, episode.path_length_m, episode.duration_s, episode.error)


def _motion(row: Step) -> MotionResult:
    collision = None
    if row.collision_source is not None:
        collision = Collision(CollisionSource(row.collision_source), row.collision_touched or "")
    return MotionResult(
        completed=row.completed,
        displacement_m=row.displacement_m or 0.0,
        turn_rad=row.turn_rad or 0.0,
        duration_s=row.duration_s or 0.0,
        collision=collision,
        failure=row.failure,
        corrections=row.corrections,
    )


def _fix(x_m: float | None, y_m: float | None, heading_rad: float | None, source: str | None) -> Fix | None:
    if x_m is None or y_m is None:
        return None
    return Fix(Pose(x_m, y_m, heading_rad or 0.0), PoseSource(source or PoseSource.ESTIMATED))


def _event(row: Event) -> EventEntry:
    return EventEntry(row.step_number or 0, row.kind, row.text)
