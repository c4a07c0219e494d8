"""A record of two trials with films: of a model while the robot drives on, and of a stack."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from tests.results.records_of_a_lab import begun, plan, stopped
from vsnbench.protocol.execution import Execution
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.film import RecordedFrame, StampedPose, film_path, film_to_json
from vsnbench.results.files.images import rgb_path
from vsnbench.results.writing.journal import Journal
from vsnbench.sites.site import load_site
from vsnbench.values.decision_check import SENSING
from vsnbench.values.encoding.image_digest import file_digest
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action, Waypoint
from vsnbench.values.pose import Pose
from vsnbench.values.step import AnswerTiming, StepRecord

CAPTURES_S = (100.0, 100.6, 101.0)
"""Times of the images that the model answers. An answer takes effect 0.4 s later; the second one is dropped."""
FILM_S = ((100.6, 100.8), (101.2,), (101.6,))
"""Times of the images after each of these answers took effect."""
END_S = 101.8
SPEED_M_S = 0.5
COMMANDED = (0.3, 0.0, 0.5)


def pose_at(time_s: float) -> Pose:
    """Return the robot's pose at a time: it drives straight on from when the first answer takes effect."""
    return Pose(1.0 + SPEED_M_S * max(0.0, time_s - CAPTURES_S[0] - 0.4), 1.0, 0.0)


def _odometry(time_s: float) -> Pose:
    return pose_at(time_s).relative_to(pose_at(CAPTURES_S[0]))


def make_filmed_record(directory: Path) -> None:
    """Write episode 1, of a model, and episode 2, the same drive by a stack."""
    directory.mkdir(exist_ok=True)
    driving = ProtocolParameters().executed(Execution(latency_s=0.4, frames_hz=5))
    with Journal.open(sqlite_url(directory / "vsnbench.db")) as journal:
        for seed, protocol in enumerate((driving, ProtocolParameters().driven_by_stack())):
            trials = journal.find_or_create_campaign(
                replace(plan(seed=seed), site=load_site("apartment"), protocol=protocol)
            ).trials
            claim = begun(journal, trials[0])
            folder = directory / claim.images_directory
            for step in _steps(folder, by_stack=seed == 1):
                journal.append_step(claim.id, step)
            journal.end_episode(claim.id, stopped(success=True))


def _steps(folder: Path, *, by_stack: bool) -> list[StepRecord]:
    effects = [time_s + 0.4 for time_s in CAPTURES_S]
    steps = []
    for k, (stamp_s, effect_s, until_s) in enumerate(zip(CAPTURES_S, effects, [*effects[1:], END_S], strict=True)):
        number, is_last = k + 1, k == 2
        _write(rgb_path(folder, number), 40 * number)
        frames = [
            RecordedFrame(
                StampedPose(time_s, pose_at(time_s)),
                file_digest(_write(film_path(folder, number, place), 50 * number)),
                commanded=COMMANDED if by_stack else None,
            )
            for place, time_s in enumerate(FILM_S[k], start=1)
        ]
        going_on = Action.NOOP if by_stack else Action.WAYPOINT
        waits_s = 0.4 if k == 0 else 0.1 if k == 1 else 0.0
        began_s = stamp_s if k == 0 else effect_s
        steps.append(
            StepRecord(
                number=number,
                action=Action.STOP if is_last else going_on,
                movement=None if by_stack or is_last else Waypoint(1.0, 0.0),
                result=MotionResult(
                    True, 0.2, 0.0, until_s - began_s, pose=_odometry(until_s), path_m=0.2, waiting_s=waits_s
                ),
                answer=AnswerTiming(effect_s, effect_s - stamp_s, until_s, stale=k == 1 and not by_stack),
                observed=_odometry(stamp_s),
                stamp_s=stamp_s,
                world=Fix(pose_at(until_s), PoseSource.SIMULATED),
                rgb_digest="blake3:" + "0" * 64,
                details={SENSING: {"film": film_to_json(frames)}},
            )
        )
    return steps


def _write(path: Path, brightness: int) -> bytes:
    path.parent.mkdir(parents=True, exist_ok=True)
    made, jpeg = cv2.imencode(".jpg", np.full((48, 64, 3), brightness, np.uint8))
    assert made
    path.write_bytes(jpeg.tobytes())
    return jpeg.tobytes()
