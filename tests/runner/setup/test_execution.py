"""Which robots a stack can drive: refused in one line before the first trial."""

from pathlib import Path

import pytest

from vsnbench.errors import UsageError
from vsnbench.models.stack.policy import StackPolicy
from vsnbench.protocol.disturbances import NONE
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.setup.execution import check_execution, rules_for
from vsnbench.sites.site import load_site
from vsnbench.values.observation import Sensor


def stack(tmp_path: Path, guard: str = "") -> str:
    file = tmp_path / "stack.yaml"
    file.write_text(f"name: theirs\nversion: '1'\nannounce: {{operator: go}}\narrived: {{rest_s: 5}}\n{guard}")
    return f"stack:{file}"


@pytest.mark.parametrize(
    ("guard", "is_on"), [("", False), ("depth_guard: false\n", False), ("depth_guard: true\n", True)]
)
def test_the_file_turns_the_depth_guard_on_and_the_record_says_so(tmp_path: Path, guard: str, is_on: bool) -> None:
    rules = rules_for(stack(tmp_path, guard), ProtocolParameters())
    assert rules.depth_guard.enabled is is_on
    assert rules.model_dump()["depth_guard"]["distance_m"] == ProtocolParameters().depth_guard.distance_m


@pytest.mark.parametrize(
    ("can_be_watched", "has_depth", "code"),
    [(False, True, "no-velocity-commands"), (True, False, "guard-without-depth"), (True, True, "")],
)
def test_a_robot_that_cannot_be_watched_is_refused(
    tmp_path: Path, can_be_watched: bool, has_depth: bool, code: str
) -> None:
    model = stack(tmp_path, "depth_guard: true\n")
    rules = rules_for(model, ProtocolParameters())
    robot = SimulatedRobot(load_site("apartment"), load_profile("turtlebot2"), rules, read=frozenset())
    robot.can_be_watched = can_be_watched
    robot.sensors = frozenset({Sensor.RGB, Sensor.ODOMETRY} | ({Sensor.DEPTH} if has_depth else set()))
    card = StackPolicy(Path(model.partition(":")[2])).card
    if not code:
        check_execution(rules, NONE, robot, card)
        return
    with pytest.raises(UsageError) as refusal:
        check_execution(rules, NONE, robot, card)
    assert refusal.value.code == code
    assert "\n" not in str(refusal.value)
