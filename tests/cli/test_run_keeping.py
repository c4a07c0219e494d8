"""`vsnbench run --record`: what is kept differs, what happened does not; and who reads it later is told."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.cli.console import vsnbench
from tests.cli.test_run import STORY, rows
from vsnbench.errors import UsageError
from vsnbench.record.results import Kept, ResultsDirectory
from vsnbench.runner.attendance import TerminalAttendance
from vsnbench.runner.launch import launch
from vsnbench.runner.request import RunRequest

WORDS = ("--model", "oracle", "--goal", "bed", "--starts", "2", "--max-steps", "5", "--workers", "1")


def test_what_is_kept_changes_nothing_that_happened(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    tmp_path: Path,
) -> None:
    stories = {}
    for kept in Kept:
        results = tmp_path / kept
        answer = vsnbench(monkeypatch, capsys, "run", *WORDS, "--record", kept, "--results", str(results))
        assert answer.code == 0, answer.err
        stories[kept] = rows(results, STORY)
        files = sorted(path.suffix for path in (results / "episodes").rglob("*.*"))
        images = [] if kept is Kept.NUMBERS else [*[".jpg"] * 5, *[".png"] * 5, ".tum"]
        assert files == sorted([*images, *([".rrd"] if kept is Kept.FULL else [])])
    assert len(stories[Kept.FULL]) == 5
    assert stories[Kept.FULL] == stories[Kept.LEAN]
    # The oracle reads no colours, and nobody keeps them: they are not drawn, so that there is nothing to hash.
    *same, rgb_digest, depth_digest = zip(*stories[Kept.FULL], strict=True)
    assert [*same, (None,) * 5, depth_digest] == list(zip(*stories[Kept.NUMBERS], strict=True))
    assert None not in (*rgb_digest, *depth_digest)
    assert rows(tmp_path / "numbers", "SELECT images_directory FROM episode") == [("",)]
    for kept, told in ((Kept.LEAN, 0), (Kept.NUMBERS, 1)):
        place = ("--results", str(tmp_path / kept))
        viewed = vsnbench(monkeypatch, capsys, "view", "1", "--path", *place)
        assert (viewed.code, caplog.text.count("episode 1 keeps no images")) == (0, told)
        assert Path(viewed.out.strip()).stat().st_size > 10_000
    bag = vsnbench(
        monkeypatch, capsys, "export", "bag", "1", str(tmp_path / "e.bag"), "--results", str(tmp_path / "numbers")
    )
    assert (bag.code, caplog.text.count("keeps no images: the bag")) == (0, 1)
    report = vsnbench(
        *(monkeypatch, capsys, "report", "--output", str(tmp_path / "pages"), "--results", str(tmp_path / "numbers"))
    )
    assert report.code == 0
    assert "1 of all keep no images." in (tmp_path / "pages" / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("usual", "somebody"),
    [
        (Kept.LEAN, {}),
        (Kept.LEAN, {"robot": "simulated:lola2", "noise": True}),
        (Kept.FULL, {"attended": True}),
        (Kept.FULL, {"pretend_real": True}),
        (Kept.FULL, {"robot": "lola2"}),
        (Kept.FULL, {"robot": "mylab.robot:Robot"}),
    ],
)
def test_copies_for_rerun_are_made_at_once_only_where_somebody_is_beside_the_robot(
    usual: Kept, somebody: dict[str, Any]
) -> None:
    request = RunRequest("oracle", ("bed",), ResultsDirectory.locate(), **somebody)
    assert request.keeps is usual
    assert [replace(request, kept=kept).keeps for kept in Kept] == list(Kept)


def test_a_run_says_what_it_keeps(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for words, said in (
        ((), "--record lean: images are kept"),
        (("--record", "numbers"), "--record numbers: no images"),
    ):
        answer = vsnbench(monkeypatch, capsys, "run", *WORDS, *words, "--results", str(tmp_path / str(len(words))))
        assert answer.code == 0
        assert answer.err.count(said) == 1


@pytest.mark.parametrize(
    ("words", "reason"), [(("--record", "some"), "full, lean, numbers"), (("--record", "lean", "--live"), "--live")]
)
def test_what_cannot_be_kept_is_refused_in_one_line(
    words: tuple[str, ...],
    reason: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    answer = vsnbench(monkeypatch, capsys, "run", *WORDS, *words, "--results", str(tmp_path / "new"))
    assert answer.code == 2
    assert reason in answer.err
    assert not (tmp_path / "new").exists()


def test_a_real_robots_images_are_always_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tests.robots import test_registry

    name = f"{test_registry.__name__}:OutsideRobot"
    real = test_registry.RobotIdentity(test_registry.load_profile("lola2"), name, simulated=False)
    monkeypatch.setattr(test_registry.OutsideRobot, "identity", real)
    request = RunRequest(
        model="forward",
        goals=("bed",),
        results=ResultsDirectory.locate(tmp_path / "new"),
        robot=name,
        kept=Kept.NUMBERS,
    )
    with pytest.raises(UsageError, match="cannot be drawn again"):
        launch(request, TerminalAttendance(unattended=True))
    assert not (tmp_path / "new").exists()
