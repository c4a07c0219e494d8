"""The disk cache is optional, and only complete entries are used."""

import hashlib
import os
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from tests.simulator.rendering.test_renderer import CAMERA, furnished
from vsnbench.files import disk_cache
from vsnbench.files.disk_cache import cache_directory, cached_array, key_of
from vsnbench.simulator.rendering import renderer as renderer_module
from vsnbench.simulator.rendering.renderer import Renderer
from vsnbench.simulator.scene import build_scene
from vsnbench.values.pose import Pose

GRID = np.arange(12, dtype=np.float32).reshape(3, 4)


class Work:
    """Counts its calls."""

    def __init__(self) -> None:
        self.times = 0

    def __call__(self) -> npt.NDArray[np.float32]:
        self.times += 1
        return GRID


@pytest.fixture(autouse=True)
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "vsnbench"


def fetch(work: Work) -> npt.NDArray[np.float32]:
    return cached_array("grids", key_of("a grid"), np.float32, (3, 4), work)


def the_file() -> Path:
    (file,) = (cache_directory() / "grids").iterdir()
    return file


def test_without_a_home_directory_the_cache_is_in_the_private_temporary_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", "~nosuchuser/cache")
    assert cache_directory() == tmp_path / f"vsnbench-{os.getuid()}" / "cache"


def test_work_is_done_once() -> None:
    work = Work()
    assert np.array_equal(fetch(work), GRID)
    assert np.array_equal(fetch(work), GRID)
    assert work.times == 1


@pytest.mark.parametrize("damage", ["cut", "flipped", "empty", "pickle", "shape", "type"])
def test_damaged_cache_entries_are_ignored(damage: str) -> None:
    work = Work()
    fetch(work)
    file = the_file()
    content = file.read_bytes()
    others = {"pickle": np.array([{}], object), "shape": GRID.T, "type": GRID.astype(np.int32)}
    if damage in others:
        with file.open("wb") as opened:
            np.save(opened, others[damage], allow_pickle=True)
        file.write_bytes(hashlib.sha256(file.read_bytes()).digest() + file.read_bytes())
    else:
        cut = {"cut": content[:-1], "empty": b"", "flipped": content[:-1] + bytes([content[-1] ^ 1])}
        file.write_bytes(cut[damage])
    assert np.array_equal(fetch(work), GRID)
    assert work.times == 2
    assert file.read_bytes() == content


def test_without_a_writable_directory_nothing_is_cached(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    empty_cache.write_text("a file where the directory would be")
    monkeypatch.setattr(disk_cache, "private_temporary_directory", lambda: None)
    work = Work()
    assert np.array_equal(fetch(work), GRID)
    assert np.array_equal(fetch(work), GRID)
    assert work.times == 2
    assert capfd.readouterr() == ("", "")


def test_without_a_home_the_cache_is_a_private_temporary_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "home").write_text("a file where the directory would be")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    private = tmp_path / f"vsnbench-{os.getuid()}"
    assert cache_directory() == private / "cache"
    assert private.stat().st_mode & 0o777 == 0o700
    private.chmod(0o777)
    assert cache_directory() == tmp_path / "home" / "vsnbench"
    private.rmdir()
    private.symlink_to(tmp_path)
    assert cache_directory() == tmp_path / "home" / "vsnbench"


def test_the_least_recently_used_entries_are_removed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(disk_cache, "_MOST_FILES", 2)
    for number in range(4):
        cached_array("grids", f"{number}", np.float32, (3, 4), lambda: GRID)
        os.utime(cache_directory() / "grids" / f"{number}.npy", (number, number))
    assert sorted(file.stem for file in (cache_directory() / "grids").iterdir()) == ["2", "3"]


def test_pictures_are_the_same_with_the_light_from_the_cache() -> None:
    def picture() -> npt.NDArray[np.uint8]:
        renderer_module._prepared.cache_clear()
        return Renderer(build_scene(furnished())).render(CAMERA, Pose(1.0, 1.0, 0.5)).rgb

    first = picture()
    assert len(list((cache_directory() / "light").iterdir())) == 1
    assert np.array_equal(picture(), first)


def test_another_value_is_another_key() -> None:
    assert (
        len({key_of(1.0), key_of(1), key_of(GRID), key_of(GRID.T), key_of("1"), key_of("1", ""), key_of(1.0, 2)}) == 7
    )
