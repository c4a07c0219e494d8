"""A look at the world is made of images taken after the motion ended, colour and depth close in time."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsnbench.sensing.pairing import MotionEnd, Stamped, match_images

END = MotionEnd(stamp_s=100.0, arrival_s=5.0)


def frames(*stamps: float, late: float = 0.01) -> list[Stamped[str]]:
    return [Stamped(f"{stamp:g}", stamp, stamp - 95.0 + late) for stamp in stamps]


def test_images_from_before_the_end_of_the_motion_are_never_used() -> None:
    colors, depths = frames(99.9, 100.0, 100.05), frames(99.95, 100.0, 100.04, 100.07)
    look = match_images(colors, depths, END, depth_frames=2, max_skew_s=0.1)
    assert look is not None
    assert [frame.payload for frame in look.depths] == ["100.04", "100.07"]
    assert look.color.payload == "100.05"
    assert look.skew_s == pytest.approx(-0.02)


def test_an_old_image_with_a_stamp_from_the_future_is_not_used() -> None:
    stale = [Stamped("future", 200.0, 4.9)]
    assert match_images(stale, frames(100.1), END, 1, max_skew_s=1000) is None


def test_no_look_until_every_depth_frame_has_come() -> None:
    assert match_images(frames(100.1), frames(100.1, 100.13), END, depth_frames=3, max_skew_s=0.1) is None
    assert match_images([], frames(100.1, 100.13), END, depth_frames=2, max_skew_s=0.1) is None


def test_colour_too_far_from_depth_in_time_is_waited_for() -> None:
    assert match_images(frames(100.1), frames(100.5), END, depth_frames=1, max_skew_s=0.1) is None
    look = match_images(frames(100.1, 100.48), frames(100.5), END, depth_frames=1, max_skew_s=0.1)
    assert look is not None
    assert look.color.payload == "100.48"


def test_a_robot_without_depth_needs_only_a_fresh_colour_image() -> None:
    look = match_images(frames(100.1, 100.2), [], END, depth_frames=0, max_skew_s=0.1)
    assert look is not None
    assert look.color.payload == "100.2"
    assert look.skew_s == 0.0


@settings(deadline=None)
@given(
    st.lists(st.floats(99, 102), max_size=20).map(sorted),
    st.lists(st.floats(99, 102), max_size=20).map(sorted),
    st.integers(0, 5),
)
def test_every_look_is_fresh_complete_and_close(colors: list[float], depths: list[float], count: int) -> None:
    look = match_images(frames(*colors), frames(*depths), END, count, max_skew_s=0.1)
    if look is not None:
        assert look.color.stamp_s > END.stamp_s
        assert len(look.depths) == count
        assert all(frame.stamp_s > END.stamp_s for frame in look.depths)
        assert abs(look.skew_s) <= 0.1
