"""Further cameras over ROS 1: images of one moment are paired by their stamps, others are refused."""

import time
from pathlib import Path

import pytest

from tests.robots.client import Client, ClientError
from tests.robots.ros1_rig import PROFILE, start_base, start_camera, start_server
from tests.robots.test_cameras import with_left_camera
from tests.ros.ros1.network import PYTHON_OF_ROS1, Probe, live_network

pytestmark = pytest.mark.ros


def test_images_30_ms_apart_are_paired_and_60_ms_apart_refused(tmp_path: Path) -> None:
    with live_network(tmp_path) as network:
        start_base(network)
        start_camera(network)
        start_server(network)
        probe = Probe(network)
        probe.tell("/camera/fault", "apart 0.03")
        client = Client(network, PYTHON_OF_ROS1, with_left_camera(tmp_path / "left.yaml", PROFILE), 6.0)
        try:
            client("begin", 0.0, 0.0, 0.0)
            ((apart_s, shape, depth_m),) = client("observe")["cameras"].values()
            assert apart_s == pytest.approx(-0.03, abs=0.002)
            assert (shape, depth_m) == ([48, 64, 3], pytest.approx(2.0, abs=0.01))
            probe.tell("/camera/fault", "apart 0.06")
            time.sleep(1)  # the images from before are no longer the newest
            with pytest.raises(ClientError, match="left camera is 60 ms from that of the front camera") as far:
                client("observe")
            assert (far.value.code, far.value.end_reason) == ("cameras-apart", "sensor_lost")
        finally:
            client.close()
            probe.close()
