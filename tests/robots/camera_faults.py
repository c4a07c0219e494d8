"""What `doctor` says of a camera with a frozen image, missing depth, few or late images; for ROS 1 and ROS 2."""

import re
from collections.abc import Callable

from tests.robots.client import Client, ClientError

Checks = dict[str, tuple[str, str]]
"""Health and finding by check."""
DEPTH = "/camera/depth/image_raw"


def require_frozen_half(found: Checks) -> None:
    """Require the findings of `--move` about frozen colours and depth without its left half."""
    assert found["colour changes"][0] == "failed"
    assert found["depth changes"][0] == "ok"
    for what in ("depth invalid", "depth region"):
        health, seen = found[what]
        assert health == "failed"
        assert "the left half of the depth image is always invalid" in seen


def require_slow_and_late(found: Checks) -> None:
    """Require the findings about one image per second, 0.3 s after its stamp: five within 3.17 s need 1.6 Hz."""
    health, seen = found[DEPTH]
    assert health == "failed"
    assert "an observation needs 1.6 Hz" in seen
    health, seen = found["delay"]
    assert health == "warning"
    assert re.search(r" arrives 0\.[3-9]\d s after its stamps", seen)
    assert "clocks" not in found
    assert "stamps" not in found


def require_slow_camera_ends(client: Client, begin_fault: Callable[[], object]) -> None:
    """Require that an observation names the rate of a slow camera as the reason of its end."""
    client("begin")
    begin_fault()
    client("execute", "TURN_LEFT")
    lost: list[ClientError] = []
    for _ in range(3):  # images from before the fault may serve one observation
        try:
            client("observe")
            client("execute", "TURN_LEFT")
        except ClientError as error:
            lost.append(error)
            break
    assert [error.code for error in lost] == ["slow-camera"]
    assert re.search(r"has (0\.\d|1\.[0-5]) Hz, and 5 images within 3\.2 s after a motion need 1\.6 Hz", str(lost[0]))
