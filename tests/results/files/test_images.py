from pathlib import Path

import cv2
import numpy as np
import pytest

from vsnbench.errors import RecordError
from vsnbench.results.files.images import (
    EpisodeImages,
    StampedPose,
    depth_path,
    hash_images,
    rgb_path,
    trajectory_text,
)
from vsnbench.values.camera import Camera
from vsnbench.values.encoding.image_digest import depth_digest, rgb_digest
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose

CAMERA = Camera(width=64, height=48, horizontal_fov_deg=60, mount_height_m=0.3)


def look(*, depth: bool = True) -> Observation:
    rows, columns = np.mgrid[0:48, 0:64]
    rgb = np.stack([rows * 5, columns * 3, np.full_like(rows, 90)], axis=-1).astype(np.uint8)
    depth_m = (0.5 + rows / 20).astype(np.float32)
    depth_m[:5, :5] = np.nan
    return Observation(rgb, depth_m if depth else None, Pose(0, 0), 0.0, CAMERA)


def read_rgb(path: Path) -> np.ndarray:
    return cv2.cvtColor(cv2.imread(str(path), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)


def read_depth(path: Path) -> np.ndarray:
    millimetres = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return np.where(millimetres == 0, np.nan, millimetres / np.float32(1000)).astype(np.float32)


def test_what_the_robot_saw_can_be_looked_at_again(tmp_path: Path) -> None:
    seen = look()
    EpisodeImages(tmp_path).write(17, seen)
    assert [path.name for path in (tmp_path / "rgb").iterdir()] == ["0017.jpg"]
    assert [path.name for path in (tmp_path / "depth").iterdir()] == ["0017.png"]
    colours = read_rgb(rgb_path(tmp_path, 17))
    assert np.abs(colours.astype(int) - seen.rgb).mean() < 3
    assert seen.depth_m is not None
    depth_m = read_depth(depth_path(tmp_path, 17))
    assert np.array_equal(np.isnan(depth_m), np.isnan(seen.depth_m))
    assert np.nanmax(np.abs(depth_m - seen.depth_m)) <= 0.0005 + 1e-6


def test_digests_are_of_the_pixels_and_of_the_depth_that_the_file_holds(tmp_path: Path) -> None:
    seen = look()
    written = EpisodeImages(tmp_path).write(1, seen)
    assert written.rgb_digest == rgb_digest(seen.rgb)
    kept = cv2.imread(str(depth_path(tmp_path, 1)), cv2.IMREAD_UNCHANGED)
    assert written.depth_digest == depth_digest(kept)
    hashed = hash_images(seen)
    assert (hashed.rgb_digest, hashed.depth_digest) == (written.rgb_digest, written.depth_digest)


def test_the_same_look_twice_has_the_same_digests_and_another_one_has_not(tmp_path: Path) -> None:
    images = EpisodeImages(tmp_path)
    first, second = images.write(1, look()), images.write(2, look())
    assert (first.rgb_digest, first.depth_digest) == (second.rgb_digest, second.depth_digest)
    other = look()
    other.rgb[0, 0, 0] ^= 1
    assert images.write(3, other).rgb_digest != first.rgb_digest


def test_a_view_of_a_larger_array_is_written_like_its_copy(tmp_path: Path) -> None:
    wide = np.repeat(look().rgb, 2, axis=1)
    view = Observation(wide[:, ::2], None, Pose(0, 0), 0.0, CAMERA)
    assert EpisodeImages(tmp_path).write(1, view).rgb_digest == EpisodeImages(tmp_path).write(2, look()).rgb_digest


def test_without_depth_there_is_no_depth_image(tmp_path: Path) -> None:
    written = EpisodeImages(tmp_path).write(1, look(depth=False))
    assert (written.depth_digest, written.depth_png) == (None, None)
    assert not depth_path(tmp_path, 1).exists()


def test_a_trajectory_is_in_tum_format(tmp_path: Path) -> None:
    (tmp_path / "trajectory.tum").write_text(trajectory_text([StampedPose(1.5, Pose(1.0, -2.0, np.pi / 2))]))
    numbers = np.loadtxt(tmp_path / "trajectory.tum")
    assert numbers == pytest.approx([1.5, 1.0, -2.0, 0, 0, 0, np.sqrt(0.5), np.sqrt(0.5)])


def test_a_directory_that_cannot_be_made_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "episodes").write_text("a file in the way")
    with pytest.raises(RecordError, match="cannot write"):
        EpisodeImages(tmp_path / "episodes" / "000001")
