"""A merge accepts only intact image sets, reports damaged ones, and repairs them from copies."""

import json
import os
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from tests.cli.test_record_verbs import vsnbench
from tests.interop.test_merge import content, copy_of, everything, lab, merged_into
from tests.results.records_of_a_lab import plan
from vsnbench.errors import RecordError
from vsnbench.results.files.images import depth_path, rgb_path
from vsnbench.values.encoding.images import encode_depth_png


@pytest.fixture(scope="module")
def intact(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return lab(tmp_path_factory.mktemp("lab") / "intact", plan())


def episode_directory(results: Path) -> Path:
    """Files of the first episode, which has three steps."""
    with closing(sqlite3.connect(results / "vsnbench.db")) as database:
        (named,) = database.execute("SELECT images_directory FROM episode WHERE actions = 3 LIMIT 1").fetchone()
    return results / named


def truncate(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-20])


def link(file: Path) -> None:
    shutil.move(file, file.with_name("elsewhere"))
    file.symlink_to(file.with_name("elsewhere"))


def become_pipe(file: Path) -> None:
    file.unlink()
    os.mkfifo(file)


def flip(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[-9] ^= 1
    file.write_bytes(content)


DAMAGES: dict[str, tuple[Callable[[Path], None], Callable[[Path], Path], str]] = {
    "deleted colour": (Path.unlink, lambda folder: rgb_path(folder, 2), "rgb/0002.jpg is missing"),
    "deleted depth": (Path.unlink, lambda folder: depth_path(folder, 2), "depth/0002.png is missing"),
    "truncated": (truncate, lambda folder: rgb_path(folder, 1), "rgb/0001.jpg is incomplete"),
    "empty": (lambda file: file.write_text("") and None, lambda folder: depth_path(folder, 3), "0003.png is empty"),
    "link": (link, lambda folder: depth_path(folder, 1), "depth/0001.png is not a regular file"),
    "pipe": (become_pipe, lambda folder: rgb_path(folder, 1), "rgb/0001.jpg is not a regular file"),
    "flipped": (flip, lambda folder: rgb_path(folder, 1), "rgb/0001.jpg does not have the bytes that were written"),
    "other depth": (
        lambda file: file.write_bytes(encode_depth_png(np.ones((6, 8), np.uint16))) and None,
        lambda folder: depth_path(folder, 1),
        "depth/0001.png does not match its digest",
    ),
}


def damage(results: Path, kind: str) -> Path:
    harm, which, _ = DAMAGES[kind]
    file = which(episode_directory(results))
    harm(file)
    return file


@pytest.mark.parametrize("kind", DAMAGES)
def test_damaged_images_are_named_and_nothing_comes_in(tmp_path: Path, intact: Path, kind: str) -> None:
    there = copy_of(intact, tmp_path / "there")
    damage(there, kind)
    with pytest.raises(RecordError) as caught:
        merged_into(tmp_path / "here", there)
    assert DAMAGES[kind][2] in str(caught.value)
    assert not (tmp_path / "here").exists()
    merged = merged_into(tmp_path / "here", there, without_images=True)
    assert merged.without_files == 1


@pytest.mark.parametrize("kind", sorted(set(DAMAGES) - {"other depth", "flipped"}))
def test_an_intact_copy_repairs_damaged_images(tmp_path: Path, intact: Path, kind: str) -> None:
    here = copy_of(intact, tmp_path / "here")
    damage(here, kind)
    would = merged_into(here, intact, dry_run=True)
    assert len(would.files.repairs) == 1
    assert merged_into(here, intact).files.file_count == 1
    assert content(here) == content(intact)
    assert not depth_path(episode_directory(here), 1).is_symlink()
    assert not merged_into(here, intact).changes


def test_an_intact_copy_completes_an_episode_that_came_without_images(tmp_path: Path, intact: Path) -> None:
    there = copy_of(intact, tmp_path / "there")
    damage(there, "truncated")
    here = tmp_path / "here"
    merged_into(here, there, without_images=True)
    assert len(merged_into(here, intact).files.repairs) == 1
    assert content(here) == content(intact)
    assert not merged_into(here, intact).changes
    assert not list(here.rglob(".arriv*"))


@pytest.mark.parametrize("intact_first", [True, False])
def test_of_two_copies_in_one_merge_the_intact_one_is_taken(tmp_path: Path, intact: Path, intact_first: bool) -> None:
    there = copy_of(intact, tmp_path / "there")
    damage(there, "deleted depth")
    merged_into(tmp_path / "here", *([intact, there] if intact_first else [there, intact]))
    assert content(tmp_path / "here") == content(intact)


def test_damage_here_that_no_copy_repairs_is_reported(tmp_path: Path, intact: Path) -> None:
    here, there = copy_of(intact, tmp_path / "here"), copy_of(intact, tmp_path / "there")
    damage(here, "truncated")
    damage(there, "deleted colour")
    before = everything(here / "episodes")
    done = vsnbench(tmp_path, "db", "merge", str(there), "--results", str(here), "--json")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert len(said["damaged_here"]) == 1
    assert "rgb/0001.jpg is incomplete" in said["damaged_here"][0]
    assert everything(here / "episodes") == before
