"""`robots calibrate` and `doctor` with the camera of `floor_images`, over ROS 1 or ROS 2."""

import json
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from tests.docs.json_outputs import faults
from tests.robots.floor_images import FISHEYE_FOV_DEG, FOV_DEG, HEIGHT_M, ROLL_DEG, TILT_DEG, write_profile
from vsnbench.robots.profiles import load_profile
from vsnbench.values.camera import CameraRole

Typed = Callable[..., "subprocess.CompletedProcess[str]"]
COMPRESSED = {"color": "/camera/color/image_raw/compressed", "depth": "/camera/depth/image_raw/compressedDepth"}
REFUSED = {
    "another codec": ({"depth": "/camera/rvl/image_raw/compressedDepth"}, "rvl"),
    "no depth": ({"depth": "/camera/nothing"}, "no depth images on /camera/nothing"),
}
"""Other topics of the profile, and what the refusal names."""


def typed(environment: Mapping[str, str], *words: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "vsnbench.cli.main", *words]
    return subprocess.run(command, env=dict(environment), capture_output=True, text=True, timeout=120)


def corrects_the_profile(environment: Mapping[str, str], path: Path, kind: str, **topics: str) -> None:
    """Calibrate a profile, and check that its file has the true camera and keeps comments."""
    profile = write_profile(path / "robot.yaml", kind, **topics)
    done = typed(environment, "robots", "calibrate", str(profile), "--yes", "--json")
    assert done.returncode == 0, done.stderr
    printed = json.loads(done.stdout)
    assert printed["written"]
    assert faults("robots-calibrate", printed) == []
    corrected = load_profile(profile)
    for camera in (corrected.camera, corrected.cameras[CameraRole.LEFT]):
        assert camera.mount_height_m == pytest.approx(HEIGHT_M, abs=0.01)
        assert camera.tilt_deg == pytest.approx(TILT_DEG, abs=0.3)
        assert camera.roll_deg == pytest.approx(ROLL_DEG, abs=0.3)
        assert camera.horizontal_fov_deg == pytest.approx(FOV_DEG, abs=0.01)
    assert {"tilt_deg", "left.tilt_deg"} <= set(printed["corrections"])
    assert "# measured by eye" in profile.read_text()


def is_refused_in_one_line(environment: Mapping[str, str], path: Path, kind: str, what: str) -> None:
    topics, words = REFUSED[what]
    profile = write_profile(path / "robot.yaml", kind, **topics)
    before = profile.read_text()
    done = typed(environment, "robots", "calibrate", str(profile), "--yes")
    assert done.returncode == 1
    assert words in done.stderr
    assert len([line for line in done.stderr.splitlines() if "error:" in line]) == 1
    assert "Traceback" not in done.stderr
    assert profile.read_text() == before


def doctor(environment: Mapping[str, str], path: Path, kind: str, **fields: object) -> dict[str, tuple[str, str]]:
    """Return health and message of each check of `doctor`."""
    profile = write_profile(path / "robot.yaml", kind, **fields)
    done = typed(environment, "doctor", "--robot", str(profile), "--results", str(path / "results"), "--json")
    assert "Traceback" not in done.stderr
    assert faults("doctor", json.loads(done.stdout)) == []
    return {line["what"]: (line["health"], line["seen"]) for line in json.loads(done.stdout)["checks"]}


def finds_the_camera_askew(environment: Mapping[str, str], path: Path, kind: str) -> None:
    found = doctor(environment, path, kind)
    assert {found[what][0] for what in ("camera height", "camera tilt", "camera roll")} == {"failed"}
    assert found["camera height"][1].startswith("0.5")
    assert found["camera tilt"][1].startswith(("-5.", "-4.9"))
    assert found["/camera/depth/camera_info"][0] == "warning"
    assert "58.0°; the profile has 60°" in found["/camera/depth/camera_info"][1]
    assert {found[f"left camera {what}"][0] for what in ("height", "tilt", "roll")} == {"failed"}
    assert found["left camera forward"][1].startswith("0 m, 0.1 m to the left, turned by 90°")
    others = ("/camera_left/depth/camera_info", "left colour image", "left depth invalid", "left pairs")
    assert {found[what][0] for what in others} == {"ok"}


def names_a_contradiction(environment: Mapping[str, str], path: Path, kind: str) -> None:
    found = doctor(environment, path, kind, fov_deg=80)
    assert found["/camera/color/camera_info"][0] == "failed"
    assert "58.0°, the profile 80°" in found["/camera/color/camera_info"][1]


def crops_the_view_from_a_fisheye_lens(environment: Mapping[str, str], path: Path, kind: str) -> None:
    found = doctor(environment, path, kind, fov_deg=90, depth_info="/camera/fisheye/camera_info")
    health, seen = found["/camera/fisheye/camera_info"]
    assert health == "ok"
    assert f"field of view of {FISHEYE_FOV_DEG:.1f}°; images are cropped to the profile's 90°" in seen


def survives_an_unnamed_compressed_topic(environment: Mapping[str, str], path: Path, kind: str) -> None:
    found = doctor(environment, path, kind, color="/camera/unnamed")
    assert found["/camera/unnamed"][0] == "failed"
    assert "CompressedImage" in found["/camera/unnamed"][1]
