"""Observations between the decisions of a model whose card asks for them."""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from tests.models.looks import look
from tests.models.remote.servers import stub_server
from tests.runner.episode.test_continuous import LANE, TURTLEBOT, Record
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.remote import vsnbench_policy
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.serving import ServedPolicy
from vsnbench.models.remote.vsnbench_policy import WireError
from vsnbench.protocol.execution import Execution
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.episode.step import EpisodePlan
from vsnbench.runner.operator.contract import AbsentOperator
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.values.camera import Camera
from vsnbench.values.decision import Decision
from vsnbench.values.encoding.codec import observation_to_message
from vsnbench.values.encoding.image_digest import rgb_digest
from vsnbench.values.movement import Action, ActionKind, Chunk, Movement, Velocity, Waypoint
from vsnbench.values.observation import MAX_PIXEL_BYTES, Observation, Sensor, newest_of, with_changes
from vsnbench.values.pose import Pose

TURNS = 12
KINDS = frozenset({ActionKind.DISCRETE, ActionKind.CHUNK, ActionKind.WAYPOINT, ActionKind.VELOCITY})
SENSORS = frozenset({Sensor.RGB, Sensor.ODOMETRY})


@dataclass
class Scripted(Policy):
    """Gives its answers in turn, then STOP, and keeps what it has seen."""

    answers: list[Movement | Chunk]
    history: int = 50
    seen: list[Observation] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.card = ModelCard("scripted", sensors=SENSORS, action_kinds=KINDS, history=self.history)

    def reset(self, goal: str, seed: int) -> None:
        self.seen = []

    def act(self, observation: Observation) -> Decision:
        self.seen.append(observation)
        number = len(self.seen) - 1
        return Decision(self.answers[number] if number < len(self.answers) else Action.STOP)


def ran(policy: Policy, execution: Execution | None = None) -> Record:
    parameters = ProtocolParameters()
    if execution is not None:
        parameters = parameters.executed(execution)
    profile = TURTLEBOT.model_copy(update={"camera": TURTLEBOT.camera.model_copy(update={"width": 64, "height": 48})})
    robot = SimulatedRobot(LANE, profile, parameters, read=frozenset({Sensor.DEPTH, Sensor.RGB}))
    record = Record()
    plan = EpisodePlan(LANE, "chair", LANE.starts[0], 7, parameters)
    run_episode(robot, policy, plan, record, AbsentOperator(), StopRequests())
    return record


def turns() -> Chunk:
    return Chunk((Action.TURN_LEFT,) * TURNS)


def digests(observations: tuple[Observation, ...]) -> list[str]:
    return [rgb_digest(each.rgb) for each in observations]


def test_a_chunk_of_twelve_turns_gives_twelve_images_with_their_poses() -> None:
    policy = Scripted([turns()])
    record = ran(policy)
    first, last = policy.seen
    assert first.history == ()
    views = (*last.history, last)
    assert len(views) == TURNS
    turned = [math.degrees(view.pose.heading_rad) % 360 for view in views]
    assert turned == pytest.approx([*(30 * k for k in range(1, TURNS)), 0], abs=0.5) or turned[-1] > 359.5
    recorded = [step.observation for step in record.steps][1:]
    assert [view.stamp_s for view in views] == [observation.stamp_s for observation in recorded]
    assert digests(views) == digests(tuple(recorded))
    assert len(set(digests(views))) == TURNS
    assert all(view.sensors == SENSORS and not view.rgb.flags.writeable for view in views)


def test_the_newest_images_are_kept_and_only_as_many_as_the_card_asks_for() -> None:
    policy = Scripted([turns(), turns()], history=4)
    ran(policy)
    assert [len(observation.history) for observation in policy.seen] == [0, 4, 4]
    last = policy.seen[1]
    turned = [round(math.degrees(view.pose.heading_rad)) for view in last.history]
    assert turned == [-120, -90, -60, -30]
    assert policy.seen[2].history[0].stamp_s > last.stamp_s


def test_a_model_that_does_not_ask_has_no_history() -> None:
    policy = Scripted([turns()], history=0)
    ran(policy)
    assert [observation.history for observation in policy.seen] == [(), ()]
    assert "history" not in observation_to_message(policy.seen[1])
    asked, unasked = (ModelCard("m", history=count).recorded({}, {}).settings for count in (4, 0))
    assert (asked, unasked) == ({"history": 4}, {})


def test_waypoints_of_a_chunk_end_in_an_image_each_also_before_a_blocked_one() -> None:
    policy = Scripted([Chunk((Waypoint(0.3, 0.0), Waypoint(0.3, 0.0), Waypoint(5.0, 0.0), Waypoint(0.3, 0.0)))])
    record = ran(policy)
    assert [step.blocked for step in record.steps] == [False, False, True, False]
    history = policy.seen[1].history
    assert [view.pose.x_m for view in history] == pytest.approx([0.3, 0.6], abs=0.02)


def test_a_robot_that_drives_on_has_the_images_of_its_film_since_the_last_answer() -> None:
    policy = Scripted([Velocity(0.2, 0.0, 2.0)] * 3)  # type: ignore[list-item]
    record = ran(policy, Execution(latency_s=0.4, max_rate_hz=1, frames_hz=5))
    assert [len(step.frames) for step in record.steps[:2]] != [0, 0]
    times_s = [observation.stamp_s for observation in policy.seen]
    for before, observation in zip(policy.seen, policy.seen[1:], strict=False):
        between = [view.stamp_s for view in observation.history]
        assert 2 <= len(between) <= 5, "the film begins with the first answer"
        assert before.stamp_s < between[0] < between[-1] < observation.stamp_s
        assert np.diff(between) == pytest.approx(0.2, abs=0.03)
        ways = [view.pose.x_m for view in (before, *observation.history, observation)]
        assert ways == sorted(ways)
    assert len(times_s) == 4
    film = {round(frame.stamp_s, 2): frame.rgb for step in record.steps for frame in step.frames}
    for view in policy.seen[2].history:
        assert np.array_equal(film[round(view.stamp_s, 2)], view.rgb), "the recorded image"


def test_without_a_film_a_robot_that_drives_on_has_no_history() -> None:
    policy = Scripted([Velocity(0.2, 0.0, 2.0)] * 2)  # type: ignore[list-item]
    ran(policy, Execution(latency_s=0.4, max_rate_hz=1))
    assert {observation.history for observation in policy.seen} == {()}


SERVED = """
import hashlib

class Model:
    card = {"name": "panorama", "sensors": ["rgb", "odometry"], "action_kinds": ["chunk", "discrete"], "history": 50}

    def reset(self, goal, seed):
        self.calls = 0

    def act(self, observation):
        self.calls += 1
        if self.calls == 1:
            assert observation.history == ()
            return {"parts": ["TURN_LEFT"] * 12}
        views = [*observation.history, observation]
        seen = [[view.stamp_s, view.pose.heading_rad, hashlib.sha256(view.rgb.tobytes()).hexdigest()] for view in views]
        return {"action": "STOP", "diagnostics": {"details": {"seen": seen}}}
"""


def test_the_twelve_images_arrive_over_the_wire(tmp_path: Path) -> None:
    import hashlib

    with stub_server(SERVED, tmp_path) as (address, _):
        policy = RemotePolicy(address)
        try:
            assert policy.card.history == 50
            record = ran(policy)
        finally:
            policy.close()
    seen = record.steps[-1].decision.diagnostics.details["seen"]
    recorded = [step.observation for step in record.steps][1:]
    assert len(seen) == TURNS
    assert json.loads(json.dumps(seen)) == [
        [view.stamp_s, view.pose.heading_rad, hashlib.sha256(view.rgb.tobytes()).hexdigest()] for view in recorded
    ]


@pytest.mark.parametrize(("size", "kept"), [((640, 480), 26), ((1280, 720), 8), ((1920, 1080), 3), ((4096, 2048), 0)])
def test_images_of_a_history_fit_into_a_message(size: tuple[int, int], kept: int) -> None:
    width, height = size
    rgb, depth_m = np.zeros((height, width, 3), np.uint8), np.zeros((height, width), np.float32)
    camera = Camera(width=width, height=height, horizontal_fov_deg=60, mount_height_m=0.5)
    views = [Observation(rgb, depth_m, Pose(0.0, 0.0), float(k), camera) for k in range(51)]
    history = newest_of(views[:-1], views[-1], 50)
    assert [view.stamp_s for view in history] == [float(50 - kept + k) for k in range(kept)]
    message = observation_to_message(with_changes(views[-1], history=history))
    pixels = sum(
        len(image["data"]) for each in (message, *message.get("history", ())) for image in (each["rgb"], each["depth"])
    )
    assert pixels <= MAX_PIXEL_BYTES < vsnbench_policy.MAX_MESSAGE_BYTES


def _received(change: Callable[[dict[str, object]], object]) -> vsnbench_policy.Observation:
    seen = look()
    message = observation_to_message(with_changes(seen, history=(seen, seen)))
    change(message)
    return vsnbench_policy.observation_of(vsnbench_policy.unpack(vsnbench_policy.pack({"type": "act", **message})))


def test_a_received_history_has_the_camera_of_its_observation() -> None:
    received = _received(lambda message: None)
    assert [len(received.history), received.history[0].history] == [2, ()]
    assert np.array_equal(received.history[1].rgb, received.rgb)
    assert received.history[0].camera.width == received.camera.width


def test_a_policy_that_vsnbench_serves_has_the_history_with_the_sensors_on_its_card() -> None:
    policy = Scripted([turns()])
    answer = ServedPolicy(policy).act(_received(lambda message: None))
    assert answer["parts"] == ["TURN_LEFT"] * TURNS
    assert [view.sensors for view in policy.seen[0].history] == [SENSORS] * 2


@pytest.mark.parametrize(
    "history", ["all", [1], [{}], [{"stamp_s": math.nan}], [{"stamp_s": 1.0, "rgb": b""}], [{"stamp_s": 1.0}] * 51]
)
def test_a_history_that_is_none_is_refused(history: object) -> None:
    with pytest.raises(WireError):
        _received(lambda message: message.update(history=history))
