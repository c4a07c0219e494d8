"""Records one episode: image files, then the database row, then the viewer's entry.

A thread writes each step while the next one runs, and takes the next step only when the one before it is committed. A
killed process therefore loses one step at most, every committed step has its images, and a write error stops the robot
within one action. Where every core runs a worker, each step is written before the next observation instead.
"""

import logging
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Protocol

from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.metrics import path_length_m
from vsnbench.results.files.directory import KeepFiles, ResultsDirectory
from vsnbench.results.files.episode_entries import (
    Entry,
    EpisodeHeader,
    EpisodeSink,
    EpisodeViewer,
    EventEntry,
    StepEntry,
)
from vsnbench.results.files.film import FILM, StampedPose, film_to_json
from vsnbench.results.files.images import CAMERAS, EpisodeImages, WrittenImages, cameras_to_json, hash_images
from vsnbench.results.files.mark_photos import MarkPhotos
from vsnbench.results.writing.entries import INTERVENTION, EpisodeBegin, EpisodeEnd
from vsnbench.results.writing.episodes import Claim
from vsnbench.runner.episode.step import EpisodePlan, Step
from vsnbench.runtime.clock import ClockReading
from vsnbench.sites.targets import legs_of
from vsnbench.values.decision_check import SENSING
from vsnbench.values.encoding.codec import diagnostics_to_details
from vsnbench.values.fix import Fix
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import RobotProfile
from vsnbench.values.step import StepRecord

logger = logging.getLogger(__name__)

CLOCK_SET = "clock_set"
"""Kind of events that say that the computer's clock was set."""
_CLOCK_CHANGE_S = 2.0
"""Larger changes are recorded; time synchronization makes smaller ones."""


class RowWriter(Protocol):
    """Writes the rows of an episode: to the database, or to a worker's memory."""

    def place(self, episode_id: int, start: Fix) -> None:
        """Write the robot's pose at the start."""
        ...

    def begin(self, episode_id: int, entry: EpisodeBegin) -> None:
        """Write the begin of the episode."""
        ...

    def append_step(self, episode_id: int, step: StepRecord) -> None:
        """Write a step whose images are in place."""
        ...

    def add_event(
        self, kind: str, words: str, *, author: str = "", episode_id: int | None = None, step_number: int | None = None
    ) -> None:
        """Write an event other than a step."""
        ...

    def end_episode(self, episode_id: int, end: EpisodeEnd) -> None:
        """Write the end and the verdict."""
        ...


@dataclass(frozen=True, slots=True)
class RecordingOptions:
    """Where and how episodes are recorded; plain values, which every worker receives."""

    results: ResultsDirectory
    viewer: EpisodeViewer | None = None
    """Copies or shows the episodes."""
    operator_name: str = ""
    """Author of operator actions for which no other name is known."""
    keep: KeepFiles = KeepFiles.ALL
    """What to store of an episode."""
    own_thread: bool = True
    """A thread writes each step while the next one runs; False where no core is free for it."""


class EpisodeRecorderFanOut:
    """The recorder of one claimed episode; `model` names the model and its weights as people may see them."""

    def __init__(
        self, journal: RowWriter, options: RecordingOptions, robot: RobotProfile, model: str, claim: Claim
    ) -> None:
        self._journal = journal
        self._options = options
        self._robot = robot
        self._model = model
        self._claim = claim
        self._plan: EpisodePlan | None = None
        self._images: EpisodeImages | None = None
        self._sink: EpisodeSink | None = None
        self._photos = MarkPhotos(options.results, robot)
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="recorder") if options.own_thread else None
        self._pending: Future[None] | None = None
        self._trajectory: list[StampedPose] = []
        self._detour_m = 0.0
        self._last_number = 0
        self._robot_time_s = 0.0
        self._began = ClockReading()

    def kept_photo(self, plan: EpisodePlan) -> bytes | None:
        """Return the image from when this robot was first accepted at this start; None if there is none."""
        return self._photos.find(plan.site, plan.start)

    def begin(self, plan: EpisodePlan, start: Fix, begin: EpisodeBegin, view_jpeg: bytes | None = None) -> None:
        """Open the episode in the database, its directory and the viewer's sink."""
        journal, options, claim = self._journal, self._options, self._claim
        if view_jpeg is not None:
            self._photos.keep(plan.site, plan.start, view_jpeg)
        self._plan = plan
        self._began = ClockReading()
        self._trajectory = [StampedPose(0.0, start.pose)]
        geodesic_m = self._geodesic_m(start.pose)
        journal.place(claim.id, start)
        images = options.keep is not KeepFiles.NONE
        journal.begin(claim.id, replace(begin, shortest_m=geodesic_m, has_images=images))
        directory = options.results.episode_directory(claim.images_directory)
        self._images = EpisodeImages(directory) if images else None
        header = EpisodeHeader(
            episode_id=claim.id,
            uuid=claim.uuid,
            goal=plan.goal,
            model=self._model,
            robot=self._robot.title,
            site=plan.site,
            start_number=plan.start.number,
            begin=start,
            parameters=plan.parameters,
            robot_radius_m=self._robot.base.radius_m,
            cameras=tuple(sorted(self._robot.cameras)),
        )
        if options.viewer is not None:
            self._sink = options.viewer.open_episode(header, directory)

    def step(self, step: Step) -> None:
        """Write a step, in the thread if there is one, after the step before it is committed."""
        self._settle()
        if step.index == 1:
            self._trajectory = [StampedPose(step.observation.stamp_s, step.site_before.pose)]
        driving_s = step.result.duration_s if step.result else 0.0
        if step.result is not None and step.result.path_m is not None:  # longer than the line between its two ends
            self._detour_m += max(step.result.path_m - step.site_before.pose.distance_to(step.site_after.pose), 0.0)
        self._trajectory.append(StampedPose(step.ended_s, step.site_after.pose))
        self._last_number = step.index
        self._robot_time_s += driving_s
        if self._worker is None:
            self._write(step)
        else:
            self._pending = self._worker.submit(partial(self._write, step))

    def event(self, kind: str, text: str, author: str = "") -> None:
        """Write an event after the last step."""
        self._settle()
        number = self._last_number or None
        self._journal.add_event(kind, text, author=author, episode_id=self._claim.id, step_number=number)
        self._show(EventEntry(self._last_number, kind, text, author))

    def intervention(self, what: str, author: str = "") -> None:
        """Write that a person acted on the robot."""
        self.event(INTERVENTION, what, author or self._options.operator_name)

    def end(self, outcome: EpisodeEnd) -> None:
        """Write the end and the verdict in one transaction."""
        self._settle()
        self._note_clock_change()
        path_m = None
        if outcome.began:
            path_m = path_length_m([moment.pose for moment in self._trajectory]) + self._detour_m
        if self._images:
            self._images.finish(self._trajectory)
        remaining_m = self._geodesic_m(outcome.final.pose, ended=True) if outcome.final else None
        whole = replace(outcome, path_m=path_m, remaining_m=remaining_m, duration_s=self._robot_time_s)
        self._journal.end_episode(self._claim.id, whole)
        self._show(whole)

    def _note_clock_change(self) -> None:
        """Record that the computer's clock was set: dates of the episode are out of order or have a gap."""
        change_s = self._began.change_until_s(ClockReading())
        if abs(change_s) < _CLOCK_CHANGE_S:
            return
        direction = "back" if change_s < 0 else "forward"
        words = f"the computer's clock was set {direction} by {abs(change_s):.0f} s during this episode"
        effect = "are not in order" if change_s < 0 else "have a gap"
        logger.warning("episode %d: %s; its recorded dates %s", self._claim.id, words, effect)
        self.event(CLOCK_SET, words)

    def close(self) -> None:
        """Close files and threads."""
        if self._worker is not None:
            self._worker.shutdown(wait=True)
        if self._sink is not None:
            self._sink.close()

    def _settle(self) -> None:
        """Wait until the last step is committed; raises its error."""
        pending, self._pending = self._pending, None
        if pending is not None:
            pending.result()

    def _write(self, step: Step) -> None:
        images = (
            self._images.write(step.index, step.observation, step.frames)
            if self._images
            else hash_images(step.observation)
        )
        record = record_of_step(step, images)
        self._journal.append_step(self._claim.id, record)
        further = {role.value: (seen.rgb_jpeg, seen.depth_png) for role, seen in images.cameras.items()}
        self._show(StepEntry(record, step.decision, images.rgb_jpeg, images.depth_png, images.film, further))

    def _show(self, entry: Entry) -> None:
        if self._sink is not None:
            self._sink.add(entry)

    def _geodesic_m(self, pose: Pose, *, ended: bool = False) -> float | None:
        if self._plan is None or len(legs_of(self._plan.site, self._plan.goal)) > 1:  # each leg has its own
            return None
        base, parameters = self._robot.base, self._plan.parameters
        space = free_space(self._plan.site, base.radius_m)
        measure = space.remaining_m if ended else space.geodesic_to_goal_m
        return measure(pose, self._plan.goal, parameters)


def record_of_step(step: Step, images: WrittenImages) -> StepRecord:
    """Return what the record has of a step with these images."""
    observation, decision = step.observation, step.decision
    rgb_file_digest, depth_file_digest = images.file_digests
    return StepRecord(
        number=step.index,
        action=decision.action,
        raw_action=decision.raw_action,
        result=step.result,
        refusal=step.refusal,
        movement=decision.movement,
        part=step.part,
        answer=step.answer,
        observed=observation.pose,
        stamp_s=observation.stamp_s,
        world=step.site_after,
        rgb_digest=images.rgb_digest,
        depth_digest=images.depth_digest,
        rgb_file_digest=rgb_file_digest,
        depth_file_digest=depth_file_digest,
        timings=step.timings,
        probabilities=decision.diagnostics.probabilities,
        details=diagnostics_to_details(decision.diagnostics) | sensing_details(observation, images),
    )


def sensing_details(observation: Observation, images: WrittenImages | None = None) -> dict[str, Any]:
    """Return how the observation was sensed, as part of a step's `details`; empty if nothing is known."""
    sensing: dict[str, Any] = dict(observation.sensing)
    if observation.depth_stamp_s is not None:
        sensing["depth_stamp_s"] = observation.depth_stamp_s
    if images is not None and images.film:
        sensing[FILM] = film_to_json(images.film)
    if images is not None and images.cameras:
        sensing[CAMERAS] = cameras_to_json(images.cameras)
    return {SENSING: sensing} if sensing else {}
