"""Robots by name: simulated robots, plug-ins, and errors for other names."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.simulator.places import square_room
from vsnbench.errors import RobotError, UsageError, VsnbenchError
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.profiles import embedded_profiles, load_profile
from vsnbench.robots.registry import known_robots, open_robot
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.sites.site import Site
from vsnbench.values.observation import Sensor
from vsnbench.values.robot_identity import RobotIdentity

SITE = square_room(4.0)
PAPER = ProtocolParameters()


class OutsideRobot(SimulatedRobot):
    """A third-party robot, created from the site alone."""

    def __init__(self, site: Site) -> None:
        super().__init__(site, load_profile("lola2"))


class GreedyRobot(OutsideRobot):
    """Accepts all arguments."""

    def __init__(self, **offered: Any) -> None:
        self.offered = offered
        super().__init__(offered["site"])


class NoRobot:
    """Not a robot at all."""


class BrokenRobot:
    """Raises on creation."""

    def __init__(self) -> None:
        raise OSError("no such serial port")


class PassesForOurs(OutsideRobot):
    """Has the identity of the simulated robot."""

    identity = RobotIdentity(load_profile("lola2"), "simulated", simulated=True)


HERE = __name__


def test_the_default_robot_is_a_simulated_turtlebot2_without_noise() -> None:
    robot = open_robot("simulated", SITE, PAPER)
    assert isinstance(robot, SimulatedRobot)
    assert robot.profile.name == "turtlebot2"
    assert robot.noise is None


@pytest.mark.parametrize("name", ["lola2", "turtlebot2"])
def test_a_profile_is_named_after_a_colon(name: str) -> None:
    assert open_robot(f"simulated:{name}", SITE, PAPER).profile.name == name


def test_a_profile_can_be_a_file(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text(embedded_profiles()["lola2"].read_text().replace("name: lola2", "name: mine"))
    assert open_robot(f"simulated:{mine}", SITE, PAPER).profile.name == "mine"


def test_the_protocols_lengths_reach_the_motion() -> None:
    robot = open_robot("simulated", SITE, ProtocolParameters(forward_m=0.5))
    assert isinstance(robot, SimulatedRobot)
    assert robot.settings.forward_m == 0.5


def test_noise_is_turned_on_by_asking_for_it() -> None:
    robot = open_robot("simulated", SITE, PAPER, noise=True)
    assert isinstance(robot, SimulatedRobot)
    assert robot.noise is not None


def test_a_third_partys_class_is_named_by_its_module() -> None:
    assert isinstance(open_robot(f"{HERE}:OutsideRobot", SITE, PAPER), OutsideRobot)
    greedy = open_robot(f"{HERE}:GreedyRobot", SITE, PAPER)
    assert isinstance(greedy, GreedyRobot)
    assert greedy.offered == {"site": SITE, "parameters": PAPER}


def test_a_plug_in_is_found_by_its_entry_point(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    info = tmp_path / "outside-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: outside\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[vsnbench.robots]\noutside = {HERE}:OutsideRobot\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert "outside" in known_robots()
    assert isinstance(open_robot("outside", SITE, PAPER), OutsideRobot)


@pytest.mark.parametrize(
    ("name", "kind", "code"),
    [
        ("warp-drive", UsageError, "unknown-robot"),
        ("simulated:roomba", UsageError, "unknown-robot"),
        ("no.such.module:Robot", RobotError, "import-failed"),
        (f"{HERE}:Missing", RobotError, "import-failed"),
        (f"{HERE}:HERE", RobotError, "not-callable"),
        (f"{HERE}:NoRobot", RobotError, "not-a-robot"),
        (f"{HERE}:PassesForOurs", RobotError, "wrong-robot-kind"),
        (f"{HERE}:BrokenRobot", RobotError, "robot-not-created"),
    ],
)
def test_a_name_that_is_not_a_robot_is_refused(name: str, kind: type[VsnbenchError], code: str) -> None:
    with pytest.raises(kind) as raised:
        open_robot(name, SITE, PAPER)
    assert raised.value.code == code


def test_a_misspelt_robot_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(UsageError) as raised:
        open_robot("turtelbot2", SITE, PAPER)
    assert raised.value.advice.startswith("did you mean turtlebot2?")


def test_a_robot_that_is_not_simulated_has_no_noise_to_turn_on() -> None:
    with pytest.raises(UsageError):
        open_robot(f"{HERE}:OutsideRobot", SITE, PAPER, noise=True)


def test_a_profile_counts_by_its_content_wherever_its_file_lies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "tb.yaml").write_text("# a copy\n" + embedded_profiles()["turtlebot2"].read_text())
    monkeypatch.chdir(tmp_path)
    names = ["simulated", "simulated:turtlebot2", "simulated:tb.yaml", f"simulated:{tmp_path / 'tb.yaml'}"]
    assert len({open_robot(name, SITE, PAPER).identity.sha256 for name in names}) == 1


def test_two_classes_of_one_module_are_two_robots() -> None:
    ours, theirs, others = (
        open_robot(name, SITE, PAPER).identity
        for name in ("simulated:lola2", f"{HERE}:OutsideRobot", f"{HERE}:GreedyRobot")
    )
    assert ours.profile.sha256 == theirs.profile.sha256 == others.profile.sha256
    assert len({ours.sha256, theirs.sha256, others.sha256}) == 3
    assert theirs.kind == f"{HERE}:OutsideRobot"


def test_a_rehearsal_and_the_real_robot_are_not_one() -> None:
    profile = load_profile("turtlebot2")
    assert RobotIdentity(profile, "ros1", simulated=True).sha256 != RobotIdentity(profile, "ros1", False).sha256


def test_profiles_keep_the_hash_by_which_older_records_know_them() -> None:
    assert load_profile("turtlebot2").sha256 == "8e520b9cdb3ae97f59e8c396156fefb69694d5f67075bbb87164e749d48f09f6"
    assert load_profile("lola2").sha256 == "0c3a03a568222b36a836cf08ab077e81a94eb246489be3a97a8f662b364a039a"


def test_a_cameras_size_makes_another_robot_that_sees_the_middle_at_that_size() -> None:
    whole, cut = open_robot("simulated", SITE, PAPER), open_robot("simulated:turtlebot2@256x256", SITE, PAPER)
    camera, middle = whole.identity.profile.camera, cut.identity.profile.camera
    assert (middle.width, middle.height) == (256, 256)
    assert middle.focal_px / 256 == pytest.approx(camera.focal_px / camera.height)
    assert whole.identity.sha256 != cut.identity.sha256
    cut.begin(SITE.starts[0], seed=1)
    assert cut.observe().rgb.shape == (256, 256, 3)


@pytest.mark.parametrize("size", ["256", "0x256", "256x256x3", "9999x16", "axb", "-1x20", "1e2x100"])
def test_a_size_that_is_none_is_refused_in_one_line(size: str) -> None:
    with pytest.raises(UsageError) as raised:
        open_robot(f"simulated:turtlebot2@{size}", SITE, PAPER)
    assert raised.value.code == "invalid-image-size"


def test_labels_are_drawn_only_for_whoever_reads_them() -> None:
    blind = open_robot("simulated", SITE, PAPER, read=frozenset({Sensor.RGB}))
    seeing = open_robot("simulated", SITE, PAPER)
    for robot in (blind, seeing):
        robot.begin(SITE.starts[0], seed=1)
    less, all_of_it = blind.observe(), seeing.observe()
    assert less.instances is None
    assert all_of_it.instances is not None
    assert np.array_equal(less.rgb, all_of_it.rgb)
    assert np.array_equal(less.depth_m, all_of_it.depth_m, equal_nan=True)
