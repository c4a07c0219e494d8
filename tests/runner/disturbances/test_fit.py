import logging

import pytest

from tests.runner.stand_ins import PLAN, ScriptedPolicy, StandInRobot
from vsnbench.errors import UsageError
from vsnbench.models.loaded import LoadedPolicy
from vsnbench.protocol.disturbances import parse_disturbances
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.disturbances.fit import check_before_opening, check_disturbances, warn_of_unused
from vsnbench.runner.setup.trial_setup import TrialSetupSpec, prepare_setup
from vsnbench.sites.site import load_site
from vsnbench.values.movement import Action
from vsnbench.values.observation import Sensor

TILTED = parse_disturbances(["camera_tilt"])
BLURRED = parse_disturbances(["blur,latency"])


def test_a_moved_camera_is_refused_where_it_cannot_be_rendered() -> None:
    for robot, rehearsal in (("turtlebot2", False), ("turtlebot4@robot1", False), ("simulated", True)):
        with pytest.raises(UsageError) as refused:
            check_before_opening(TILTED, robot, rehearsal=rehearsal)
        assert refused.value.code == "geometry-disturbance"
        check_before_opening(BLURRED, robot, rehearsal=rehearsal)
    check_before_opening(TILTED, "simulated:lola2", rehearsal=False)
    with pytest.raises(UsageError) as refused:
        check_disturbances(TILTED, StandInRobot())
    assert refused.value.code == "geometry-disturbance"
    check_disturbances(BLURRED, StandInRobot())


@pytest.mark.parametrize("text", ["camera_height=-0.6", "camera_height=2", "camera_height=-2"])
def test_a_camera_below_the_floor_or_above_every_robot_is_refused(text: str) -> None:
    robot = SimulatedRobot(
        load_site("apartment"),
        load_profile("turtlebot2").model_copy(update={"camera": load_profile("turtlebot2").camera.resized(64, 48)}),
    )
    chosen = parse_disturbances([text])
    if text == "camera_height=2":  # 2.6 m: high, but a mount that a profile may have
        check_disturbances(chosen, robot)
        return
    with pytest.raises(UsageError) as refused:
        check_disturbances(chosen, robot)
    assert refused.value.code == "invalid-disturbance"


def test_disturbances_are_conditions_and_none_leaves_the_conditions_as_they_were() -> None:
    robot = StandInRobot(conditions={"simulator": "7"})
    policy = LoadedPolicy(ScriptedPolicy([Action.STOP]))

    def conditions(*texts: str) -> dict[str, object]:
        spec = TrialSetupSpec(PLAN.site, "scripted", ("chair",), disturbances=parse_disturbances(texts))
        return dict(prepare_setup(spec, policy, robot).description.conditions)

    assert conditions() == {"simulator": "7"}
    assert conditions("blur=2") == {"simulator": "7", "disturbances": {"blur": 2.0}, "disturbances_edition": 1}


def test_a_disturbance_of_an_unused_sensor_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        warn_of_unused(parse_disturbances(["depth_holes,blur"]), "pirlnav", {Sensor.RGB, Sensor.ODOMETRY})
    assert [record.args for record in caplog.records] == [("depth_holes", "pirlnav")]
