"""A robot with CycloneDDS and the serializer of rosbags, without rclpy, works like any other."""

import pytest

from tests.ros.ros1.network import wait_until
from tests.ros.ros2.graph import HERE, client_of, live_graph

pytestmark = pytest.mark.ros2

LOCALHOST = """
<CycloneDDS><Domain>
<General><AllowMulticast>false</AllowMulticast><Interfaces><NetworkInterface name='lo'/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers></Discovery>
<Compatibility><IgnoreTypeInformation>1.15</IgnoreTypeInformation></Compatibility>
</Domain></CycloneDDS>
"""
"""Settings that rmw_cyclonedds makes: unicast peers on this machine, as ROS_AUTOMATIC_DISCOVERY_RANGE requires,
and types matched by name, because CycloneDDS 11 rejects the type descriptions of vendor 1.15 (Fast DDS)."""


def test_a_robot_of_another_vendors_dds_sees_and_drives(tmp_path) -> None:
    with live_graph(tmp_path) as graph:
        robot = graph.start(HERE / "nodes" / "cyclonedds_robot.py", CYCLONEDDS_URI=LOCALHOST)
        wait_until(lambda: "up" in robot.output or robot.popen.poll() is not None, "the robot is up")
        client = client_of(graph)
        try:
            assert client("begin")["simulated"] is False
            assert client("observe")["rgb"] == [48, 64, 3]
            moved = client("execute", "MOVE_FORWARD")
            assert moved["failure"] == ""
            assert moved["displacement_m"] == pytest.approx(0.25, abs=0.005)
            assert client("execute", "TURN_LEFT")["failure"] == ""
            assert robot.popen.poll() is None, robot.output
        finally:
            client.close()
