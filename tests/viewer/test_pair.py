"""Two episodes in one recording."""

from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from tests.cli.test_record_verbs import vsnbench


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short failure (1), a success (2) and another failure (3)."""
    folder = tmp_path_factory.mktemp("recorded")
    for model, steps in (("random", "3"), ("oracle", "150"), ("random", "2")):
        words = ["--model", model, "--goal", "chair", "--starts", "5", "--max-steps", steps, "-q"]
        assert vsnbench(folder, "run", *words).returncode == 0
    return folder


def rows_by_entity(path: Path) -> dict[str, int]:
    found: dict[str, int] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        found[chunk.entity_path] = found.get(chunk.entity_path, 0) + chunk.to_record_batch().num_rows
    return found


def test_both_are_on_one_timeline_under_their_own_entities(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    done = vsnbench(results, "view", "1", "2", "--path")
    assert done.returncode == 0, done.stderr
    path = Path(done.stdout.strip())
    assert path.is_relative_to(tmp_path)
    found = rows_by_entity(path)
    for side, number in (("left", 1), ("right", 2)):
        images = len(list((results / "episodes" / f"{number:06d}" / "rgb").iterdir()))
        assert found[f"/{side}/camera/rgb"] == images
        assert found[f"/{side}/verdict"] >= 1
        assert f"/{side}/plan/trajectory" in found or number == 1
    entities = [entity for entity in found if not entity.startswith(("/left", "/right", "/__"))]
    assert entities == []


def test_the_next_failure_is_chosen(results: Path) -> None:
    def opened(*words: str) -> str:
        return vsnbench(results, "view", *words, "--next-failure", "--path").stdout.strip()

    assert opened().endswith("000001/episode.rrd")
    assert opened("1").endswith("000003/episode.rrd")


@pytest.mark.parametrize(
    "words", [[], ["1", "2", "3"], ["1", "2", "--next-failure"], ["3", "--next-failure"], ["1", "9"]]
)
def test_what_cannot_be_opened_is_said_in_one_line(results: Path, words: list[str]) -> None:
    done = vsnbench(results, "view", *words, "--path")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
