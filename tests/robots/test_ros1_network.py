"""A robot on a faulty network: late parts, duplicate nodes, a new master; and a robot that is carried."""

import time
from collections.abc import Iterator

import pytest

from tests.robots.client import ClientError, can
from tests.robots.ros1_rig import PROFILE, Rig, live_rig
from tests.ros.ros1.network import HERE, PATIENCE_S, wait_until

pytestmark = pytest.mark.ros

UPSTREAM_LIKE = HERE / "nodes" / "upstream_like_server.py"


@pytest.fixture(scope="module")
def shared_rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with live_rig(tmp_path_factory.mktemp("ros")) as rig:
        yield rig


@pytest.fixture
def rig(shared_rig: Rig) -> Rig:
    """The shared robot, in a new episode."""
    shared_rig.make_good()
    return shared_rig


def refusal(rig: Rig) -> ClientError:
    """Return the error of the start of an episode."""
    with pytest.raises(ClientError) as refused:
        rig.client("begin")
    return refused.value


@pytest.mark.long
def test_a_robot_that_is_carried_repeatedly_never_loses_its_first_action(rig) -> None:
    """This base resets its odometry as a Kobuki does: heading and position, some time after the request."""
    for _ in range(4):
        rig.client("begin")
        result = rig.client("execute", "TURN_LEFT")
        assert result["completed"], result["failure"]
        assert result["pose"]["heading_rad"] == pytest.approx(0.5236, abs=0.01)


@pytest.mark.parametrize("part", ["server", "odometry"])
def test_a_part_that_returns_while_an_episode_begins_is_waited_for(rig, part) -> None:
    rig.restart_client(patience_s=PATIENCE_S)
    if part == "server":
        rig.server.end()
    else:
        rig.fault("base", "silent")
        wait_until(lambda: not can(lambda: rig.client("observe")), "the silence is detected")
    log = rig.network.directory / "client.log"
    logged = len(log.read_text())
    begun = rig.client.later("begin")
    wait_until(lambda: "waiting: " in log.read_text()[logged:], "the wait is logged")
    assert not begun.done()
    if part == "server":
        rig.start_server()
    else:
        rig.fault("base", "good")
    assert begun.result(PATIENCE_S)
    rig.restart_client()


def test_a_server_that_drives_too_far_is_stopped_after_10_cm(rig) -> None:
    rig.server.end()
    other = rig.network.start(UPSTREAM_LIKE, FORWARD_M="1.5")
    try:
        rig.network.wait_for_service("/discrete_move")
        rig.restart_client()
        rig.client("begin")
        result = rig.client("execute", "MOVE_FORWARD")
        assert result["completed"] is False
        assert "where 25 cm were requested" in result["failure"]
        assert 0.35 <= result["displacement_m"] < 0.6
    finally:
        other.end()


def test_a_server_that_replaces_ours_is_another_campaign(rig) -> None:
    rig.client("begin")
    other = rig.network.start(UPSTREAM_LIKE)
    try:
        assert rig.server.wait() == 1
        assert "another node called /discrete_move was started" in rig.server.output
        rig.network.wait_for_service("/discrete_move")
        wait_until(lambda: refusal(rig).code == "server-changed", "the change is reported")
    finally:
        other.end()


def test_a_server_that_steers_another_topic_is_refused_with_both_topics(rig) -> None:
    rig.server.end()
    other = rig.network.start(UPSTREAM_LIKE, "/cmd_vel:=/elsewhere")
    try:
        rig.network.wait_for_service("/discrete_move")
        refused = refusal(rig)
        assert refused.code == "steers-another-topic"
        assert "/elsewhere" in str(refused)
    finally:
        other.end()


def test_a_second_server_of_another_name_is_refused_and_names_the_first(rig) -> None:
    words = ["robots", "serve", str(PROFILE), "__name:=another"]
    second = rig.network.start("-m", "vsnbench.cli.main", *words)
    assert second.wait() == 1
    first = rig.server.popen.pid
    assert f"/discrete_move is already served by /discrete_move (process {first}" in second.output
    assert second.output.count("\n") == 1


@pytest.mark.long
def test_two_bases_on_one_network_are_named(rig) -> None:
    rig.client("begin")
    second = rig.network.start(HERE / "nodes" / "kinematic_base.py", "__name:=second_base", "_heading_deg:=100")
    try:
        wait_until(lambda: "/second_base" in rig.network.master.state().publishers["/odom"], "the second publishes")
        result = rig.client("execute", "TURN_LEFT")
        assert result["completed"] is False
        assert "/kinematic_base and /second_base both publish /odom" in result["failure"]
        assert refusal(rig).code == "two-publishers"
    finally:
        second.end()
    wait_until(lambda: can(lambda: rig.client("begin")), "one base is left")


def test_a_restarted_master_is_reported_at_once(rig) -> None:
    """Must be the last test of this rig, because the nodes are not registered at the new master."""
    rig.client("begin")
    rig.network.roscore.end()
    assert rig.undisturbed("execute", "TURN_LEFT")["completed"], "a running episode continues"
    rig.network.start_master()
    began_s = time.monotonic()
    assert refusal(rig).code == "master-restarted"
    assert time.monotonic() - began_s < 5, "waiting does not help"
    wait_until(lambda: "was restarted and has lost this node" in rig.server.output, "the server logs it too")
