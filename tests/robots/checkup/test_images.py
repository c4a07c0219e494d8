"""The check-up detects depth images that are invalid, in another unit, or frozen."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vsnbench.robots.checkup.images import image_results, turned_results
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


@pytest.mark.parametrize(
    ("calibrated", "health"),
    [((424, 240), "ok"), ((640, 480), "failed"), (None, "failed")],
    ids=["for this size", "for another size", "not calibrated"],
)
def test_depth_of_another_size_needs_its_calibration(calibrated: tuple[int, int] | None, health: str) -> None:
    depth = message(np.full((240, 424), 2000, np.uint16), "16UC1")
    heard = {topic: TopicMessages() for topic in ("/camera/color/image_raw", "/camera/color/camera_info")}
    heard |= {"/camera/depth/image_raw": TopicMessages([0.0], [0.0], [b"depth"], {"/driver"})}
    heard |= {"/camera/depth/camera_info": TopicMessages([0.0], [0.0], [b"info"] if calibrated else [], {"/driver"})}
    width, height = calibrated or (0, 0)
    k = [210.0, 0.0, (width - 1) / 2, 0.0, 210.0, (height - 1) / 2, 0.0, 0.0, 1.0]
    info = SimpleNamespace(width=width, height=height, distortion_model="plumb_bob", K=k, D=[], P=[])
    results = image_results(TURTLEBOT2, heard, lambda _kind, data: info if data == b"info" else depth)
    found = {result.what: result for result in results}
    assert found["depth image"].health == health
    assert ("depth invalid" in found) is (health == "ok")
    if health == "ok":
        assert "640x480" in found["depth image"].seen
        assert found["depth invalid"].health == "ok"


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


def turned(before: dict[str, Any], after: dict[str, Any]) -> dict[str, str]:
    return {result.what: str(result.health) for result in turned_results(TURTLEBOT2, before, after)}


def colours(seed: int) -> Any:
    return message(np.random.default_rng(seed).integers(0, 255, (480, 640, 3)).astype(np.uint8), "rgb8")


@pytest.mark.parametrize(
    ("depth", "colour", "health"),
    [
        (wall(2001), colours(1), {"colour changes": "ok", "depth changes": "ok"}),
        (wall(2000), colours(1), {"colour changes": "ok", "depth changes": "failed"}),
        (wall(2001), colours(0), {"colour changes": "failed", "depth changes": "ok"}),
    ],
    ids=["live", "depth frozen", "colour frozen"],
)
def test_an_image_that_a_turn_does_not_change_is_frozen(depth: np.ndarray, colour: Any, health: dict[str, str]) -> None:
    before = {"depth": message(wall(2000), "16UC1"), "colour": colours(0)}
    assert turned(before, {"depth": message(depth, "16UC1"), "colour": colour}) == health


def test_images_that_did_not_arrive_are_not_compared() -> None:
    assert turned({"colour": colours(0)}, {"depth": message(wall(2000), "16UC1")}) == {}


def without_left_half(mm: int) -> np.ndarray:
    depth = wall(mm)
    depth[:, :320] = 0
    return depth


def test_a_region_without_depth_before_and_after_a_turn_fails_by_name() -> None:
    before, after = (message(without_left_half(mm), "16UC1") for mm in (2000, 2100))
    results = {result.what: result for result in turned_results(TURTLEBOT2, {"depth": before}, {"depth": after})}
    assert results["depth region"].health == "failed"
    assert results["depth region"].seen.startswith("the left half of the depth image is always invalid")
    moved = np.ascontiguousarray(without_left_half(2100)[:, ::-1])
    assert "depth region" not in turned({"depth": before}, {"depth": message(moved, "16UC1")})


def test_half_of_the_depth_missing_fails_by_name_without_a_movement() -> None:
    found = depth_results(without_left_half(2000))["depth invalid"]
    assert found.health == "failed"
    assert "the left half of the depth image is always invalid" in found.seen
