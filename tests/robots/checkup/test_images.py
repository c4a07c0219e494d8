"""The check-up detects depth images that are invalid, in another unit, or frozen."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vsnbench.robots.checkup.images import frozen_result, image_results
from vsnbench.robots.checkup.result import CheckResult
from vsnbench.robots.profiles import load_profile
from vsnbench.sensing.topic_monitor import TopicMessages

TURTLEBOT2 = load_profile("turtlebot2")
STRETCH = load_profile("stretch")


def message(pixels: np.ndarray, encoding: str) -> Any:
    height, width = pixels.shape[:2]
    return SimpleNamespace(
        height=height, width=width, encoding=encoding, is_bigendian=0, step=pixels[0].nbytes, data=pixels.tobytes()
    )


def depth_results(depth: np.ndarray, encoding: str = "16UC1") -> dict[str, CheckResult]:
    heard = {topic: TopicMessages() for topic in ("/camera/color/image_raw", "/camera/color/camera_info")}
    heard |= {"/camera/depth/image_raw": TopicMessages([0.0], [0.0], [b"depth"], {"/driver"})}
    heard |= {"/camera/depth/camera_info": TopicMessages()}
    results = image_results(TURTLEBOT2, heard, lambda _kind, _data: message(depth, encoding))
    return {result.what: result for result in results}


def wall(mm: int) -> np.ndarray:
    return np.full((480, 640), mm, np.uint16)


def with_hidden_part(mm: int) -> np.ndarray:
    depth = wall(mm)
    depth[240:, 250:350] = 0
    return depth


@pytest.mark.parametrize(
    ("depth", "encoding", "health"),
    [
        (wall(2000), "16UC1", {"depth invalid": "ok"}),
        (with_hidden_part(2000), "16UC1", {"depth invalid": "warning"}),
        (wall(0), "16UC1", {"depth invalid": "failed"}),
        (np.full((480, 640), np.nan, np.float32), "32FC1", {"depth invalid": "failed"}),
        (np.full((480, 640), 2.0, np.float32), "32FC1", {"depth invalid": "ok"}),
        (np.full((480, 640), 2000.0, np.float32), "32FC1", {"depth range": "failed", "depth invalid": "failed"}),
        (wall(2), "16UC1", {"depth range": "failed", "depth invalid": "failed"}),
    ],
    ids=["right", "a part hidden", "all zero", "all NaN", "metres", "millimetres as metres", "metres as millimetres"],
)
def test_depth_without_evidence_of_free_space_fails(depth: np.ndarray, encoding: str, health: dict[str, str]) -> None:
    results = depth_results(depth, encoding)
    found = {what: str(result.health) for what, result in results.items() if what in ("depth range", "depth invalid")}
    assert found == health
    assert all(result.advice for result in results.values() if result.health != "ok")


def test_depth_of_a_rotated_camera_is_checked_upright() -> None:
    """The lower half, where the floor is, is the left one of the image as it is sent."""
    sent = np.full((360, 640), 2000, np.uint16)
    sent[:, 320:] = 0
    heard = {topic: TopicMessages() for topic in ("/camera/color/image_raw", "/camera/color/camera_info")}
    heard |= {"/camera/aligned_depth_to_color/camera_info": TopicMessages()}
    heard |= {"/camera/aligned_depth_to_color/image_raw": TopicMessages([0.0], [0.0], [b"depth"], {"/driver"})}
    health = []
    for turns in (1, 3):
        results = image_results(STRETCH, heard, lambda _kind, _data: message(sent, "16UC1"), turns)
        health += [str(result.health) for result in results if result.what == "depth invalid"]
    assert sorted(health) == ["failed", "warning"]


def test_a_depth_image_that_a_turn_does_not_change_is_frozen() -> None:
    before, after = message(wall(2000), "16UC1"), message(wall(2001), "16UC1")
    assert frozen_result(before, after).health == "ok"
    assert frozen_result(before, before).health == "failed"
    assert frozen_result(message(wall(0), "16UC1"), message(wall(0), "16UC1")) is None
