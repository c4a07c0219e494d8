import hashlib
import os
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from vsnbench.errors import RecordError
from vsnbench.protocol.camera import Camera
from vsnbench.protocol.observation import Observation
from vsnbench.protocol.pose import Pose
from vsnbench.record.images import (
    EpisodeImages,
    StampedPose,
    depth_millimetres,
    depth_path,
    read_depth,
    read_rgb,
    rgb_path,
    write_trajectory,
    write_whole,
)

CAMERA = Camera(width=64, height=48, horizontal_fov_deg=60, mount_height_m=0.3)


def look(*, depth: bool = True) -> Observation:
    rows, columns = np.mgrid[0:48, 0:64]
    rgb = np.stack([rows * 5, columns * 3, np.full_like(rows, 90)], axis=-1).astype(np.uint8)
    depth_m = (0.5 + rows / 20).astype(np.float32)
    depth_m[:5, :5] = np.nan
    return Observation(rgb, depth_m if depth else None, Pose(0, 0), 0.0, CAMERA)


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


def test_hashes_are_of_the_pixels(tmp_path: Path) -> None:
    seen = look()
    written = EpisodeImages(tmp_path).write(1, seen)
    assert seen.depth_m is not None
    assert written.rgb_sha256 == hashlib.sha256(seen.rgb.tobytes()).hexdigest()
    kept = (np.nan_to_num(read_depth(depth_path(tmp_path, 1))) * 1000).round().astype("<u2")
    assert written.depth_sha256 == hashlib.sha256(kept.tobytes()).hexdigest()


def test_the_same_look_twice_has_the_same_hashes_and_another_one_has_not(tmp_path: Path) -> None:
    images = EpisodeImages(tmp_path)
    first, second = images.write(1, look()), images.write(2, look())
    assert (first.rgb_sha256, first.depth_sha256) == (second.rgb_sha256, second.depth_sha256)
    other = look()
    other.rgb[0, 0, 0] ^= 1
    assert images.write(3, other).rgb_sha256 != first.rgb_sha256


def test_a_view_of_a_larger_array_is_written_like_its_copy(tmp_path: Path) -> None:
    wide = np.repeat(look().rgb, 2, axis=1)
    view = Observation(wide[:, ::2], None, Pose(0, 0), 0.0, CAMERA)
    assert EpisodeImages(tmp_path).write(1, view).rgb_sha256 == EpisodeImages(tmp_path).write(2, look()).rgb_sha256


def test_without_depth_there_is_no_depth_image(tmp_path: Path) -> None:
    written = EpisodeImages(tmp_path).write(1, look(depth=False))
    assert (written.depth_sha256, written.depth_png) == (None, None)
    assert not depth_path(tmp_path, 1).exists()


@pytest.mark.parametrize(
    ("metres", "millimetres"),
    [(np.nan, 0), (0.0, 0), (-1.0, 0), (np.inf, 0), (1.2344, 1234), (65.535, 65535), (65.6, 0), (0.0004, 0)],
)
def test_depth_becomes_millimetres_with_zero_for_invalid(metres: float, millimetres: int) -> None:
    assert depth_millimetres(np.array([[metres]], np.float32))[0, 0] == millimetres


def test_a_damaged_image_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "broken.png").write_bytes(b"no image")
    for read in (read_rgb, read_depth):
        with pytest.raises(RecordError, match="missing or damaged"):
            read(tmp_path / "broken.png")


def test_a_trajectory_is_in_tum_format(tmp_path: Path) -> None:
    write_trajectory(tmp_path / "trajectory.tum", [StampedPose(1.5, Pose(1.0, -2.0, np.pi / 2))])
    numbers = np.loadtxt(tmp_path / "trajectory.tum")
    assert numbers == pytest.approx([1.5, 1.0, -2.0, 0, 0, 0, np.sqrt(0.5), np.sqrt(0.5)])


FULL_DISK = """
import resource, sys
from pathlib import Path
from vsnbench.errors import RecordError
from vsnbench.record.images import write_whole
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
try:
    write_whole(Path(sys.argv[1]), bytes(5000))
except RecordError as error:
    print(error)
"""


def test_a_file_that_does_not_fit_is_not_there_at_all(tmp_path: Path) -> None:
    target = tmp_path / "0001.jpg"
    root = Path(__file__).parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(target)], capture_output=True, text=True, env=environment
    )
    assert done.stdout.startswith(f"cannot write {target}: ")
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_replaced_whole(tmp_path: Path) -> None:
    write_whole(tmp_path / "file", b"one")
    write_whole(tmp_path / "file", b"two")
    assert (tmp_path / "file").read_bytes() == b"two"
    assert stat.S_ISREG((tmp_path / "file").stat().st_mode)
    assert len(list(tmp_path.iterdir())) == 1


def test_a_directory_that_cannot_be_made_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "episodes").write_text("a file in the way")
    with pytest.raises(RecordError, match="cannot write"):
        EpisodeImages(tmp_path / "episodes" / "000001")
