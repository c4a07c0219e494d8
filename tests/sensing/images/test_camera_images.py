"""Images are matched, decoded from every layout, and filtered as by numpy's median."""

import time
import warnings
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from vsnbench.errors import ImageError
from vsnbench.sensing.images.camera_images import (
    MotionEnd,
    Stamped,
    beyond_range,
    decode_color,
    decode_depth,
    decode_labels,
    match_images,
    median_depth_m,
    share_invalid,
)

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


def test_there_is_no_match_until_all_depth_images_arrived() -> None:
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
def test_every_match_is_fresh_complete_and_close_in_time(colors: list[float], depths: list[float], count: int) -> None:
    look = match_images(frames(*colors), frames(*depths), END, count, max_skew_s=0.1)
    if look is not None:
        assert look.color.stamp_s > END.stamp_s
        assert len(look.depths) == count
        assert all(frame.stamp_s > END.stamp_s for frame in look.depths)
        assert abs(look.skew_s) <= 0.1


@dataclass
class Image:
    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    data: bytes


def message(pixels: np.ndarray, encoding: str, *, padding: int = 0, big_endian: bool = False) -> Image:
    height, width = pixels.shape[:2]
    stored = pixels.astype(pixels.dtype.newbyteorder(">" if big_endian else "<"))
    rows = [row.tobytes() + b"\xaa" * padding for row in stored]
    return Image(height, width, encoding, int(big_endian), len(rows[0]), b"".join(rows))


RGB = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)


@pytest.mark.parametrize("padding", [0, 5])
def test_colour_is_decoded_as_rgb_from_every_order(padding: int) -> None:
    alpha = np.full((2, 3, 1), 255, np.uint8)
    assert np.array_equal(decode_color(message(RGB, "rgb8", padding=padding)), RGB)
    assert np.array_equal(decode_color(message(RGB[..., ::-1], "bgr8", padding=padding)), RGB)
    assert np.array_equal(decode_color(message(np.dstack([RGB, alpha]), "rgba8", padding=padding)), RGB)
    assert np.array_equal(decode_color(message(np.dstack([RGB[..., ::-1], alpha]), "bgra8", padding=padding)), RGB)


def test_a_grey_image_has_three_equal_channels() -> None:
    grey = RGB[..., 0]
    assert np.array_equal(decode_color(message(grey, "mono8")), np.dstack([grey] * 3))


@settings(deadline=None, max_examples=60)
@given(
    height=st.integers(1, 5),
    width=st.integers(1, 7),
    padding=st.integers(0, 9),
    big_endian=st.booleans(),
    kind=st.sampled_from([("16UC1", np.uint16), ("mono16", np.uint16), ("32FC1", np.float32)]),
)
def test_depth_survives_padding_and_byte_order(height, width, padding, big_endian, kind) -> None:
    encoding, dtype = kind
    pixels = (np.arange(height * width).reshape(height, width) * 257 % 60000).astype(dtype)
    depth = decode_depth(message(pixels, encoding, padding=padding, big_endian=big_endian))
    assert depth.dtype == dtype
    assert np.array_equal(depth, pixels)


def test_the_last_row_may_have_no_padding() -> None:
    image = message(np.array([[1, 2], [3, 4]], np.uint16), "16UC1", padding=4)
    image.data = image.data[:-4]
    assert decode_depth(image).tolist() == [[1, 2], [3, 4]]


@pytest.mark.parametrize(("encoding", "dtype"), [("16UC1", np.uint16), ("32SC1", np.int32)])
def test_instance_labels_are_integers_of_either_width(encoding, dtype) -> None:
    labels = decode_labels(message(np.array([[0, 7], [1, 65535]], dtype), encoding))
    assert labels.dtype == np.int32
    assert labels.tolist() == [[0, 7], [1, 65535]]


def test_an_unknown_encoding_is_named() -> None:
    with pytest.raises(ImageError, match="'yuv422', not rgb8"):
        decode_color(message(RGB, "yuv422"))
    with pytest.raises(ImageError, match="'rgb8', not 16UC1"):
        decode_depth(message(RGB, "rgb8"))
    with pytest.raises(ImageError, match="'rgb8', not 16UC1, 32SC1"):
        decode_labels(message(RGB, "rgb8"))


def test_a_message_with_too_few_bytes_is_an_error() -> None:
    image = message(RGB, "rgb8")
    image.data = image.data[:-1]
    with pytest.raises(ImageError, match="has 17 bytes, expected 18"):
        decode_color(image)


def test_a_step_shorter_than_a_row_is_an_error() -> None:
    image = message(RGB, "rgb8")
    image.step = 8
    with pytest.raises(ImageError, match="rows of 8 bytes, expected at least 9"):
        decode_color(image)


def test_an_empty_image_is_refused() -> None:
    with pytest.raises(ImageError, match="0x0"):
        decode_color(Image(0, 0, "rgb8", 0, 0, b""))


def nan_median(frames_m: np.ndarray) -> np.ndarray:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.nanmedian(frames_m, axis=0)


@settings(deadline=None, max_examples=80)
@given(
    arrays.arrays(
        np.uint16,
        st.tuples(st.integers(1, 12), st.integers(1, 4), st.integers(1, 5)),
        elements=st.sampled_from([0, 0, 1, 399, 400, 1200, 1201, 8000, 8001, 65534, 65535]),
    )
)
def test_the_median_of_millimetres_is_that_of_the_valid_frames(frames: np.ndarray) -> None:
    metres = frames.astype(np.float64) / 1000
    metres[(frames < 400) | (frames > 8000)] = np.nan
    assert np.allclose(median_depth_m(list(frames), 0.4, 8.0), nan_median(metres), atol=1e-6, equal_nan=True)


@settings(deadline=None, max_examples=80)
@given(
    arrays.arrays(
        np.float32,
        st.tuples(st.integers(1, 11), st.integers(1, 4), st.integers(1, 5)),
        elements=st.sampled_from([np.nan, np.inf, -np.inf, -1.0, 0.0, 0.5, 1.25, 2.5, 9.0]),
    )
)
def test_the_median_of_metres_is_that_of_the_valid_frames(frames: np.ndarray) -> None:
    metres = frames.astype(np.float64)
    metres[~np.isfinite(frames) | (frames < 0.4) | (frames > 8.0)] = np.nan
    assert np.allclose(median_depth_m(list(frames), 0.4, 8.0), nan_median(metres), atol=1e-6, equal_nan=True)


def test_images_larger_than_a_block_are_filtered_completely() -> None:
    rng = np.random.default_rng(3)
    frames = rng.integers(0, 5000, (7, 97, 131)).astype(np.uint16)
    metres = np.where(frames == 0, np.nan, frames / 1000)
    assert np.allclose(median_depth_m(list(frames)), nan_median(metres), atol=1e-6, equal_nan=True)


def test_a_pixel_never_measured_is_nan_and_is_counted() -> None:
    depth_m = median_depth_m([np.array([[0, 900]], np.uint16), np.array([[0, 0]], np.uint16)])
    assert np.isnan(depth_m[0, 0])
    assert depth_m[0, 1] == pytest.approx(0.9)
    assert share_invalid(depth_m) == 0.5


@pytest.mark.parametrize(
    "frame",
    [
        np.array([[0, 1000, 5000, 5001, 65534, 65535]], np.uint16),
        np.array([[np.nan, 1.0, 5.0, 5.001, np.inf, 0.0]], np.float32),
    ],
)
def test_pixels_beyond_the_range_are_distinguished_from_missing_ones(frame: np.ndarray) -> None:
    depth_m = median_depth_m([frame], 0.5, 5.0)
    assert beyond_range(frame, depth_m, 5.0).tolist() == [[False, False, False, True, True, False]]


def test_one_outlier_among_ten_frames_moves_nothing() -> None:
    frames = [np.full((3, 3), 1500, np.uint16) for _ in range(9)] + [np.full((3, 3), 7000, np.uint16)]
    assert np.all(median_depth_m(frames) == np.float32(1.5))


def test_the_input_frames_are_not_changed() -> None:
    frame = np.array([[3, 1, 2]], np.uint16)
    median_depth_m([frame, frame[:, ::-1].copy()])
    assert frame.tolist() == [[3, 1, 2]]


def test_frames_that_differ_in_size_or_encoding_are_refused() -> None:
    with pytest.raises(ValueError, match="same size and encoding"):
        median_depth_m([np.zeros((2, 2), np.uint16), np.zeros((2, 3), np.uint16)])
    with pytest.raises(ValueError, match="same size and encoding"):
        median_depth_m([np.zeros((2, 2), np.uint16), np.zeros((2, 2), np.float32)])
    with pytest.raises(ValueError, match="at least one"):
        median_depth_m([])


def test_ten_frames_are_filtered_faster_than_by_numpy() -> None:
    rng = np.random.default_rng(1)
    frames = list(rng.integers(0, 4000, (10, 480, 640)).astype(np.uint16))
    metres = np.stack(frames).astype(np.float32)
    metres[metres == 0] = np.nan
    median_depth_m(frames)

    def shortest(work) -> float:
        durations = []
        for _ in range(3):
            began = time.perf_counter()
            work()
            durations.append(time.perf_counter() - began)
        return min(durations)

    assert shortest(lambda: median_depth_m(frames)) < shortest(lambda: np.nanmedian(metres, axis=0)) / 4
