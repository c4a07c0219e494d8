"""Every export takes numbers first and writes to --output."""

from pathlib import Path

import pytest

from tests.cli.test_record_verbs import vsnbench
from tests.web.results_browser.served_record import make_record


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("export") / "results"
    make_record(directory)
    return directory


@pytest.mark.parametrize(
    ("form", "output", "files"),
    [
        ("tum", "", ["000002.tum"]),
        ("mcap", "", ["000002.mcap"]),
        ("bag", "two.bag", ["two.bag"]),
        ("csv", "two.csv", ["two.csv"]),
        ("episodes", "two.csv", ["two.csv"]),
        ("video", "two.mp4", ["two.mp4"]),
    ],
)
def test_the_number_comes_before_the_output(
    results: Path, tmp_path: Path, form: str, output: str, files: list[str]
) -> None:
    done = vsnbench(results, "export", form, "2", "--output", str(tmp_path / output))
    assert (done.returncode, done.stderr) == (0, "") or "no images" in done.stderr
    assert sorted(file.name for file in tmp_path.iterdir()) == files
    if form == "episodes":
        _, *rows = (tmp_path / output).read_text().splitlines()
        assert [row.split(",")[0] for row in rows] == ["2"]


def test_videos_go_to_a_directory_whose_name_has_a_dot(results: Path, tmp_path: Path) -> None:
    done = vsnbench(results, "export", "video", "2", "--output", str(tmp_path / "videos-1.0"))
    assert done.returncode == 0, done.stderr
    assert [file.suffix for file in (tmp_path / "videos-1.0").iterdir()] == [".mp4"]
