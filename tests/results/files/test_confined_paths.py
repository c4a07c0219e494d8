import os
from pathlib import Path

import pytest

from vsnbench.errors import RecordError
from vsnbench.results.files import confined_paths as room
from vsnbench.results.files.confined_paths import confined, read_confined
from vsnbench.results.files.directory import ResultsDirectory


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "results" / "episodes").mkdir(parents=True)
    (tmp_path / "private").write_bytes(b"key")
    return tmp_path / "results"


@pytest.mark.parametrize("named", ["..", "../private", "episodes/../../private", "/etc/passwd", "a/" * 3000, "a\0b"])
def test_a_path_that_leads_out_is_refused(root: Path, named: str) -> None:
    with pytest.raises(RecordError, match="nothing was changed"):
        confined(root, named)
    with pytest.raises(RecordError, match="nothing was changed"):
        ResultsDirectory.locate(root, environment={}).episode_directory(named)


def test_a_link_in_an_archive_leads_nowhere_else(root: Path) -> None:
    (root / "episodes" / "000001").symlink_to(root.parent)
    (root / "picture.jpg").symlink_to(root.parent / "private")
    for named in ("episodes/000001", "episodes/000001/private", "picture.jpg"):
        with pytest.raises(RecordError, match="leads out"):
            read_confined(root, named)


def test_the_results_directory_may_itself_be_reached_through_a_link(root: Path, tmp_path: Path) -> None:
    (root / "episodes" / "note").write_bytes(b"kept")
    (tmp_path / "short").symlink_to(root)
    assert read_confined(tmp_path / "short", "episodes/note") == b"kept"


def test_only_an_ordinary_file_is_read(root: Path) -> None:
    os.mkfifo(root / "pipe")
    for named in ("pipe", "episodes", "nothing"):
        assert read_confined(root, named) is None


def test_a_file_that_is_no_image_by_its_size_is_refused(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "LARGEST_FILE_BYTES", 8)
    (root / "large").write_bytes(b"123456789")
    with pytest.raises(RecordError, match="larger than"):
        read_confined(root, "large")
