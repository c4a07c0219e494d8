"""A small synthetic episode with all kinds of entries and diagnostics."""

import math
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from sqlalchemy import update

from tests.shared_records import write_copy
from vsnbench.protocol.judge import EndReason, GoalDistance, judge
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.files.episode_entries import Entry, EpisodeHeader, EventEntry, StepEntry
from vsnbench.results.files.images import depth_path, rgb_path
from vsnbench.results.schema.tables import EpisodeRow
from vsnbench.results.writing.campaigns import CampaignPlan, Trial
from vsnbench.results.writing.entries import EpisodeBegin, EpisodeEnd
from vsnbench.results.writing.journal import Journal
from vsnbench.robots.profiles import load_profile
from vsnbench.sites.site import load_site
from vsnbench.values.decision import Box, Decision, Diagnostics, GridMap
from vsnbench.values.encoding.codec import diagnostics_to_details
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.model.card import ModelCard
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose
from vsnbench.values.robot_identity import RobotIdentity
from vsnbench.values.step import StepRecord, StepTimings
from vsnbench.viewer.recording import EpisodeRecording

UUID = "6f0e9a52-0000-4000-8000-000000000017"


def header() -> EpisodeHeader:
    site = load_site("apartment")
    begin = Fix(site.start(1).pose, PoseSource.SIMULATED)
    return EpisodeHeader(17, UUID, "chair", "vlv (stand-in weights)", "turtlebot2", site, 1, begin)


def entries(count: int, *, diagnostics: bool = True) -> Iterator[Entry]:
    """Yield `count` steps (the second one blocked), an event and the end."""
    about = header()
    pose = about.begin.pose
    rng = np.random.default_rng(0)
    for index in range(1, count + 1):
        blocked = index == 2
        action = Action.STOP if index == count else Action.MOVE_FORWARD if index % 3 else Action.TURN_LEFT
        local = {Action.MOVE_FORWARD: Pose(0.25, 0), Action.TURN_LEFT: Pose(0, 0, math.radians(30))}
        after = pose if blocked else pose.compose(local.get(action, Pose(0, 0)))
        decision = Decision(action, diagnostics=_diagnostics(rng) if diagnostics else Diagnostics())
        recorded = decision.diagnostics
        step = StepRecord(
            number=index,
            action=action,
            raw_action=decision.raw_action,
            result=None if blocked else MotionResult(True, 0.25, 0.0, 1.0),
            stamp_s=100 + 1.2 * index,
            world=Fix(after, PoseSource.SIMULATED),
            timings=StepTimings(infer_s=0.031),
            probabilities=recorded.probabilities,
            details=diagnostics_to_details(recorded),
        )
        yield StepEntry(step, decision, _picture(index), _depth())
        if blocked:
            yield EventEntry(index, "blocked", "action 2: 812 pixels nearer than 0.40 m")
        pose = after
    distance = GoalDistance(0.62, PoseSource.SIMULATED, "chair-2")
    yield EpisodeEnd(judge(EndReason.STOP, count, distance, about.parameters), count, path_m=5.25, duration_s=61.2)


def record(results: ResultsDirectory, count: int = 6, *, ended: bool = True) -> int:
    """Write the episode into a results directory as a run does, without its Rerun file; returns its number."""
    write_copy(results.path, _write_record, count, ended)
    return 1


def _write_record(path: Path, count: int, ended: bool) -> None:
    results, about = ResultsDirectory.locate(path, environment={}), header()
    profile = load_profile("turtlebot2")
    model = ModelCard("vlv", weights_label="stand-in weights")
    plan = CampaignPlan(
        about.site, RobotIdentity(profile, "simulated", True), model, about.parameters, 0, [Trial("chair", 1)]
    )
    results.prepare()
    with Journal.open(results.database_url) as journal:
        trial = journal.find_or_create_campaign(plan).trials[0]
        handle = journal.claim_next(trial.campaign_id, [trial.id])
        assert handle is not None
        with journal.engine.begin() as connection:
            connection.execute(update(EpisodeRow).values(uuid=UUID))
        journal.place(handle.id, about.begin)
        journal.begin(handle.id, EpisodeBegin())
        directory = results.episode_directory(handle.images_directory)
        for entry in entries(count):
            match entry:
                case StepEntry():
                    _keep_images(directory, entry)
                    journal.append_step(handle.id, entry.step)
                case EventEntry():
                    journal.add_event(entry.kind, entry.text, episode_id=handle.id, step_number=entry.step)
                case EpisodeEnd() if ended:
                    journal.end_episode(handle.id, entry)


def _keep_images(directory: Path, entry: StepEntry) -> None:
    for path, content in (
        (rgb_path(directory, entry.step.number), entry.rgb_jpeg),
        (depth_path(directory, entry.step.number), entry.depth_png),
    ):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content or b"")


def write(path: Path, count: int = 6, *, diagnostics: bool = True) -> str:
    with EpisodeRecording(header(), path, rebuilding=True) as recording:
        for entry in entries(count, diagnostics=diagnostics):
            recording.add(entry)
    return recording.close()


def _picture(index: int) -> bytes:
    rows, columns = np.mgrid[0:480, 0:640]
    picture = np.stack([rows // 2, columns // 3, np.full_like(rows, 20 * index % 255)], axis=-1).astype(np.uint8)
    return cv2.imencode(".jpg", picture)[1].tobytes()


def _depth() -> bytes:
    depth_mm = np.tile(np.linspace(500, 5000, 640).astype(np.uint16), (480, 1))
    return cv2.imencode(".png", depth_mm)[1].tobytes()


def _diagnostics(rng: np.random.Generator) -> Diagnostics:
    cells = np.zeros((60, 80), np.uint8)
    cells[10:50, 10:70] = 1
    cells[10:12, 10:70] = 2
    return Diagnostics(
        probabilities=dict(
            zip(["STOP", "MOVE_FORWARD", "TURN_LEFT", "TURN_RIGHT"], rng.dirichlet([1.0] * 4).tolist(), strict=True)
        ),
        boxes=(Box(100, 150, 300, 400, "chair", 0.91), Box(400, 150, 500, 300, "sofa", 0.4)),
        map=GridMap(cells, -1.5, -1.5, 0.05),
        sub_goal=(1.0, 1.0),
        path=((0, 0), (0.5, 0.2), (1, 1)),
        nodes=((0, 0), (0.5, 0.5)),
        scalars={"value": float(rng.random())},
        note="driving to view 7 of node 2",
    )
