"""Further cameras over ROS 2: images of one moment are paired by their stamps, others are refused."""

import json
import sqlite3
import time
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from tests.processes import wait_until
from tests.robots.client import ClientError
from tests.robots.test_cameras import with_left_camera, written
from tests.ros.ros2.graph import HERE, PROFILE, client_of, live_graph, send_line

pytestmark = pytest.mark.ros2

ATTEMPTS = 4
"""On a machine with other work a sensor may fall silent for a second: the episode is void, and is run again."""


def test_images_30_ms_apart_are_paired_and_60_ms_apart_refused(tmp_path: Path) -> None:
    with live_graph(tmp_path) as graph:
        robot = graph.start(HERE / "nodes" / "robot.py")
        wait_until(lambda: "up" in robot.output, "the robot is up")
        send_line(robot, "apart 0.03")
        client = client_of(graph, with_left_camera(tmp_path / "left.yaml", PROFILE))
        try:
            client("begin", 0.0, 0.0, 0.0)
            ((apart_s, shape, depth_m),) = client("observe")["cameras"].values()
            assert apart_s == pytest.approx(-0.03, abs=0.002)
            assert (shape, depth_m) == ([48, 64, 3], pytest.approx(2.0, abs=0.01))
            send_line(robot, "apart 0.06")
            time.sleep(1)  # the images from before are no longer the newest
            with pytest.raises(ClientError, match="left camera is 60 ms from that of the front camera") as far:
                client("observe")
            assert (far.value.code, far.value.end_reason) == ("cameras-apart", "sensor_lost")
            send_line(robot, "apart 0.0 5")  # one image a second from the left camera, five from the front one

            def refused() -> str:
                try:
                    client("observe")
                except ClientError as error:
                    return error.code
                return ""

            wait_until(lambda: refused() == "cameras-apart", "an image of the front camera has none beside it")
            send_line(robot, "blind")
            with pytest.raises(ClientError):
                client("observe")
        finally:
            client.close()


@pytest.mark.long
def test_a_simulated_robot_has_its_cameras_over_ros(tmp_path: Path) -> None:
    profile = written(tmp_path)
    yaml = YAML()
    content = yaml.load(profile.read_text(encoding="utf-8"))
    names = {"color": "image", "color_info": "info", "depth": "depth", "depth_info": "depth_info"}
    content["interface"] |= {"camera_rate_hz": 10, "depth_frames": 3} | {
        "cameras": {role: {key: f"{role}/{name}" for key, name in names.items()} for role in ("left", "rear")}
    }
    yaml.dump(content, profile)
    words = ["--model", "tests.robots.test_cameras:LooksLeft", "--goal", "chair", "--starts", "1"]
    seen = {}
    with live_graph(tmp_path, shares_memory=True) as graph:
        played = graph.vsnbench("robots", "simulate", profile)
        wait_until(lambda: "simulating" in played.output, "the robot is simulated", 150)
        for name, robot in (("ros", profile), ("simulated", f"simulated:{profile}")):
            results = tmp_path / name
            for _ in range(ATTEMPTS):
                done = graph.vsnbench("run", "--robot", robot, *words, "--results", results)
                if done.wait(200) == 0 or "the same command resumes" not in done.output:
                    break
            assert done.popen.returncode == 0, done.output
            with sqlite3.connect(results / "vsnbench.db") as connection:
                query = """select number, details from step join episode on episode.id = episode_id
                           where state = 'judged' order by number"""
                steps = {number: json.loads(details) for number, details in connection.execute(query)}
            seen[name] = {number: details["sensing"]["cameras"] for number, details in steps.items()}
    assert sorted(seen["ros"]) == sorted(seen["simulated"]) == [1, 2, 3, 4]
    first = {name: {role: images["rgb"] for role, images in steps[1].items()} for name, steps in seen.items()}
    assert first["ros"] == first["simulated"], "the pixels from the start"
