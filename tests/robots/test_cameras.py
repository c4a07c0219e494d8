"""Further cameras of a robot, by role: what they see, what a model gets of them, and what the record has."""

import hashlib
import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
from pydantic import ValidationError
from ruamel.yaml import YAML

from tests.cli.console import vsnbench
from tests.cli.test_record_verbs import vsnbench as record_verb
from tests.models.remote.servers import stub_server
from tests.runner.episode.test_continuous import LANE, TURTLEBOT, Record
from vsnbench.errors import RobotError
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.contract_check import check_policy
from vsnbench.models.remote import vsnbench_policy
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.serving import ServedPolicy
from vsnbench.models.remote.vsnbench_policy import WireError
from vsnbench.models.synthetic import synthetic_observation
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.robots.profiles import load_profile, profile_path
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.episode.step import EpisodePlan
from vsnbench.runner.operator.contract import AbsentOperator
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.simulator.dynamics.noise import NoiseSettings
from vsnbench.values.camera import CameraRole
from vsnbench.values.decision import Decision
from vsnbench.values.encoding.codec import observation_to_message
from vsnbench.values.encoding.image_digest import rgb_digest
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Attitude, Pose
from vsnbench.values.robot_profile import RobotProfile
from vsnbench.viewer.replay import read_episode

SENSORS = frozenset({Sensor.RGB, Sensor.DEPTH, Sensor.ODOMETRY})
SMALL = TURTLEBOT.camera.model_copy(update={"width": 64, "height": 48, "mount_forward_m": 0.0})
CAMERAS = {
    CameraRole.LEFT: SMALL.model_copy(update={"yaw_deg": 90.0}),
    CameraRole.RIGHT: SMALL.model_copy(update={"yaw_deg": -90.0}),
    CameraRole.REAR: SMALL.model_copy(update={"yaw_deg": 180.0}),
}
FOUR = TURTLEBOT.model_copy(update={"camera": SMALL, "cameras": CAMERAS})


@dataclass
class Turner(Policy):
    """Turns to the left three times, and keeps what it has seen."""

    cameras: frozenset[CameraRole] = frozenset()
    seen: list[Observation] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.card = ModelCard("turner", sensors=SENSORS, cameras=self.cameras)

    def reset(self, goal: str, seed: int) -> None:
        self.seen = []

    def act(self, observation: Observation) -> Decision:
        self.seen.append(observation)
        return Decision(Action.TURN_LEFT if len(self.seen) < 4 else Action.STOP)


class LooksLeft(Turner):
    """Asks for the cameras to the left and at the rear."""

    def __init__(self) -> None:
        super().__init__(frozenset({CameraRole.LEFT, CameraRole.REAR}))


def ran(policy: Policy, profile: RobotProfile = FOUR, noise: NoiseSettings | None = None) -> Record:
    parameters = ProtocolParameters()
    robot = SimulatedRobot(LANE, profile, parameters, noise)
    record = Record()
    plan = EpisodePlan(LANE, "chair", LANE.starts[0], 7, parameters)
    run_episode(robot, policy, plan, record, AbsentOperator(), StopRequests())
    return record


def begun(profile: RobotProfile, pose: Pose) -> Observation:
    robot = SimulatedRobot(LANE, profile, ProtocolParameters())
    robot.begin(LANE.starts[0].model_copy(update={"position": pose.position, "heading_deg": pose.heading_deg}), 1)
    return robot.observe()


@pytest.mark.parametrize("role", CAMERAS)
@pytest.mark.parametrize("forward_m", [0.0, 0.12])
def test_a_camera_sees_what_the_main_camera_sees_from_its_place(role: CameraRole, forward_m: float) -> None:
    yaw_deg = CAMERAS[role].yaw_deg
    camera = SMALL.model_copy(update={"yaw_deg": yaw_deg, "mount_forward_m": forward_m, "mount_left_m": 0.05})
    here = LANE.starts[0].pose
    view = begun(FOUR.model_copy(update={"cameras": {role: camera}}), here).cameras[role]
    there = here.compose(Pose(forward_m, 0.05, math.radians(yaw_deg)))
    same = begun(FOUR, there)
    assert np.mean(view.rgb != same.rgb) < 0.01
    assert np.allclose(view.depth_m, same.depth_m, atol=1e-4, equal_nan=True)
    points, expected = view.camera.points_in_base(view.depth_m), same.camera.points_in_base(same.depth_m)
    cos, sin = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    turned = expected[..., :2] @ np.array([[cos, sin], [-sin, cos]]) + [forward_m, 0.05]
    assert np.allclose(points[..., :2], turned, atol=1e-3, equal_nan=True)
    assert np.allclose(points[..., 2], expected[..., 2], atol=1e-4, equal_nan=True)


def test_the_level_camera_of_a_pitching_body_looks_the_same_way() -> None:
    camera, attitude = CAMERAS[CameraRole.LEFT], Attitude(roll_rad=0.1, pitch_rad=0.0)
    level = camera.on(attitude)
    assert level.axes()[2] == pytest.approx(camera.axes(attitude)[2])
    assert level.tilt_deg == pytest.approx(math.degrees(0.1)), "rolling to the right lifts the left side"
    assert level.yaw_deg == pytest.approx(90)


def test_a_model_gets_the_cameras_that_its_card_asks_for() -> None:
    policy = LooksLeft()
    record = ran(policy)
    for seen, step in zip(policy.seen, record.steps, strict=True):
        assert sorted(seen.cameras) == [CameraRole.LEFT, CameraRole.REAR]
        for role, view in seen.cameras.items():
            assert rgb_digest(view.rgb) == rgb_digest(step.observation.cameras[role].rgb)
            assert view.camera.yaw_deg == CAMERAS[role].yaw_deg
            assert view.sensors == SENSORS
            assert not view.rgb.flags.writeable
    assert len({rgb_digest(view.rgb) for view in (policy.seen[0], *policy.seen[0].cameras.values())}) == 3
    unasked = Turner()
    ran(unasked)
    assert all(not seen.cameras for seen in unasked.seen)
    assert "cameras" not in observation_to_message(unasked.seen[0])
    asked, not_asked = (
        ModelCard("m", cameras=cameras).recorded({}, {}).settings for cameras in (policy.cameras, frozenset())
    )
    assert (asked, not_asked) == ({"cameras": ["left", "rear"]}, {})


def test_further_cameras_change_nothing_for_the_main_one_and_have_noise_of_their_own() -> None:
    noise = NoiseSettings()
    alone, four = Turner(), Turner(frozenset({CameraRole.LEFT}))
    ran(alone, FOUR.model_copy(update={"cameras": {}}), noise)
    ran(four, FOUR, noise)
    for one, other in zip(alone.seen, four.seen, strict=True):
        assert np.array_equal(one.rgb, other.rgb)
        assert np.array_equal(one.depth_m, other.depth_m, equal_nan=True)
    again = Turner(frozenset({CameraRole.LEFT}))
    ran(again, FOUR, noise)
    views = [each.cameras[CameraRole.LEFT].depth_m for seen in (four.seen, again.seen) for each in seen]
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(views[:4], views[4:], strict=True))


SERVED = """
import hashlib

class Model:
    card = {"name": "wide", "sensors": ["rgb", "depth"], "cameras": ["left", "rear"]}

    def reset(self, goal, seed):
        pass

    def act(self, observation):
        seen = {
            role: [hashlib.sha256(view.rgb.tobytes()).hexdigest(), view.camera.yaw_deg, list(view.depth_m.shape)]
            for role, view in observation.cameras.items()
        }
        return {"action": "STOP", "diagnostics": {"details": {"seen": seen}}}
"""


def test_the_cameras_arrive_over_the_wire(tmp_path: Path) -> None:
    with stub_server(SERVED, tmp_path) as (address, _):
        policy = RemotePolicy(address)
        try:
            assert policy.card.cameras == {CameraRole.LEFT, CameraRole.REAR}
            record = ran(policy)
        finally:
            policy.close()
    step = record.steps[0]
    expected = {
        role.value: [hashlib.sha256(view.rgb.tobytes()).hexdigest(), view.camera.yaw_deg, [48, 64]]
        for role, view in step.observation.cameras.items()
        if role is not CameraRole.RIGHT
    }
    assert json.loads(json.dumps(step.decision.diagnostics.details["seen"])) == expected


def test_a_policy_of_vsnbench_gets_its_cameras_from_its_own_server_and_in_a_check() -> None:
    policy = LooksLeft()
    served = ServedPolicy(policy, "looks-left", {})
    sent = msgpack.unpackb(msgpack.packb(observation_to_message(synthetic_observation(policy, 0))))
    policy.reset("chair", 0)
    served.act(vsnbench_policy.observation_of(sent))
    assert sorted(policy.seen[-1].cameras) == [CameraRole.LEFT, CameraRole.REAR]
    assert policy.seen[-1].cameras[CameraRole.LEFT].rgb.std() > 1
    wrong = [finding for finding in check_policy(policy, steps=3) if not finding.passed]
    assert not wrong or all("camera" not in finding.seen for finding in wrong)


@pytest.mark.parametrize("cameras", [[], {"up": {}}, {"left": 1}])
def test_cameras_of_a_message_are_checked(cameras: Any) -> None:
    message = {"stamp_s": 0.0, "camera": {}, "cameras": cameras}
    if cameras:
        with pytest.raises(WireError, match="`cameras`"):
            vsnbench_policy.observation_of(message)
    else:
        assert vsnbench_policy.observation_of(message).cameras == {}


def written(directory: Path) -> Path:
    """Write a profile with small cameras ahead, to the left and at the rear."""
    yaml = YAML()
    content = yaml.load(profile_path("turtlebot4").read_text(encoding="utf-8"))
    content["camera"] |= {"width": 160, "height": 120}
    side = {**content["camera"], "mount_left_m": 0.1, "mount_forward_m": 0.0}
    content["cameras"] = {"left": {**side, "yaw_deg": 90}, "rear": {**side, "yaw_deg": 180}}
    path = directory / "three.yaml"
    yaml.dump(content, path)
    return path


def record_of_cameras(directory: Path) -> None:
    """Write an episode of four steps with cameras ahead, to the left and at the rear."""
    robot = f"simulated:{written(directory)}"
    model = "tests.robots.test_cameras:LooksLeft"
    done = record_verb(directory, "run", "--robot", robot, "--goal", "chair", "--starts", "1", "--model", model, "-q")
    assert done.returncode == 0, done.stderr


def with_left_camera(path: Path, source: Path) -> Path:
    """Write a profile with a camera that looks to the left, on the topics of the tests' nodes."""
    yaml = YAML()
    content = yaml.load(source.read_text(encoding="utf-8"))
    content["cameras"] = {"left": {**content["camera"], "yaw_deg": 90}}
    names = {"color": "camera_left/color/image_raw", "depth": "camera_left/depth/image_raw"}
    slash = "/" if content["interface"]["kind"] == "ros1" else ""
    content["interface"]["cameras"] = {"left": {part: slash + name for part, name in names.items()}}
    yaml.dump(content, path)
    return path


def test_a_run_records_every_camera(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    results = tmp_path / "results"
    words = ["run", "--robot", f"simulated:{written(tmp_path)}", "--goal", "chair", "--starts", "1"]
    model = "tests.robots.test_cameras:LooksLeft"
    done = vsnbench(monkeypatch, capsys, *words, "--model", model, "--results", str(results))
    assert done.code == 0, done
    replay = read_episode(ResultsDirectory.locate(results), 1)
    assert replay.image_faults == ()
    steps = [entry for entry in replay.entries if hasattr(entry, "cameras")]
    assert [sorted(step.cameras) for step in steps] == [["left", "rear"]] * 4
    assert all(rgb and depth for step in steps for rgb, depth in step.cameras.values())
    assert vsnbench(monkeypatch, capsys, "verify", str(results)).code == 0
    file = next(replay.directory.glob("rgb/0002-left.jpg"))
    file.write_bytes(steps[0].cameras["rear"][0])
    changed = vsnbench(monkeypatch, capsys, "verify", str(results))
    assert changed.code == 1
    assert "rgb/0002-left.jpg" in changed.out
    file.unlink()
    (fault,) = read_episode(ResultsDirectory.locate(results), 1).image_faults
    assert str(fault) == "rgb/0002-left.jpg is missing"


def test_a_role_that_the_robot_lacks_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    words = ["run", "--robot", "simulated", "--goal", "chair", "--starts", "1", "--results", str(tmp_path / "r")]
    done = vsnbench(monkeypatch, capsys, *words, "--model", "tests.robots.test_cameras:LooksLeft")
    assert done.code == 2, done
    assert "needs a left and a rear camera, which robot" in " ".join(done.err.split())


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"cameras": {"up": SMALL.model_dump()}}, "'front', 'left', 'right' or 'rear'"),
        ({"cameras": {"front": SMALL.model_dump()}}, "`front` is the main camera"),
        ({"camera": {**SMALL.model_dump(), "yaw_deg": 10}}, "the main camera looks ahead"),
        (
            {"cameras": {role: {**SMALL.model_dump(), "width": 4096, "height": 1024} for role in ("left", "right")}},
            "fit",
        ),
    ],
)
def test_impossible_cameras_of_a_profile_are_refused(change: dict[str, Any], says: str) -> None:
    with pytest.raises(ValidationError, match=says):
        RobotProfile.model_validate({**TURTLEBOT.content(), **change})


def test_profiles_without_further_cameras_keep_their_hash() -> None:
    assert "cameras" not in TURTLEBOT.camera.model_dump()
    assert TURTLEBOT.model_copy(update={"cameras": {}}).sha256 == TURTLEBOT.sha256 != FOUR.sha256


def test_topics_of_a_camera_that_the_profile_lacks_are_refused(tmp_path: Path) -> None:
    yaml = YAML()
    content = yaml.load(profile_path("turtlebot2").read_text(encoding="utf-8"))
    content["interface"]["cameras"] = {"left": {"color": "/left/image"}}
    yaml.dump(content, tmp_path / "robot.yaml")
    with pytest.raises(RobotError, match="has topics of a left camera"):
        load_profile(tmp_path / "robot.yaml")
