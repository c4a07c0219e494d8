"""`vsnbench run --keep`: the files differ, the steps do not, and later readers see which files are missing."""

from pathlib import Path
from typing import Any

import pytest

from tests.cli.console import Typed, vsnbench
from tests.cli.running.test_run import STORY, rows
from vsnbench.cli.support.options import what_to_keep
from vsnbench.errors import UsageError
from vsnbench.results.files.directory import KeepFiles, ResultsDirectory
from vsnbench.results.files.images import depth_path, rgb_path
from vsnbench.runner.operator.provider import OperatorProvider
from vsnbench.runner.setup.launch import launch
from vsnbench.runner.setup.request import RunRequest
from vsnbench.runner.setup.trial_setup import TrialSetupSpec
from vsnbench.sites.site import load_site
from vsnbench.values.encoding.image_digest import file_digest

FILE_DIGESTS = "SELECT number, rgb_file_digest, depth_file_digest FROM step ORDER BY number"
WORDS = ("--model", "oracle", "--goal", "bed", "--starts", "2", "--max-steps", "5", "--workers", "1")


def test_what_is_kept_changes_nothing_that_happened(
    typed: Typed,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    tmp_path: Path,
) -> None:
    stories = {}
    for kept in KeepFiles:
        results = tmp_path / kept
        answer = typed("run", *WORDS, "--keep", kept, "--results", str(results))
        assert answer.code == 0, answer.err
        stories[kept] = rows(results, STORY)
        files = sorted(path.suffix for path in (results / "episodes").rglob("*.*"))
        images = [] if kept is KeepFiles.NONE else [*[".jpg"] * 5, *[".png"] * 5, ".tum"]
        assert files == sorted([*images, *([".rrd"] if kept is KeepFiles.ALL else [])])
    assert len(stories[KeepFiles.ALL]) == 5
    assert stories[KeepFiles.ALL] == stories[KeepFiles.IMAGES]
    # The oracle reads no colour images and none are kept, so none are rendered or hashed.
    *same, rgb_digest, depth_digest = zip(*stories[KeepFiles.ALL], strict=True)
    assert [*same, (None,) * 5, depth_digest] == list(zip(*stories[KeepFiles.NONE], strict=True))
    assert None not in (*rgb_digest, *depth_digest)
    for kept in KeepFiles:
        for number, *digests in rows(tmp_path / kept, FILE_DIGESTS):
            files = (
                rgb_path(tmp_path / kept / "episodes/000001", number),
                depth_path(tmp_path / kept / "episodes/000001", number),
            )
            assert digests == [file_digest(file.read_bytes()) if kept is not KeepFiles.NONE else None for file in files]
    assert rows(tmp_path / KeepFiles.NONE, "SELECT images_directory FROM episode") == [("",)]
    for kept, told in ((KeepFiles.IMAGES, 0), (KeepFiles.NONE, 1)):
        place = ("--results", str(tmp_path / kept))
        viewed = typed("view", "1", "--path", *place)
        assert (viewed.code, caplog.text.count("episode 1 has no recorded images")) == (0, told)
        assert Path(viewed.out.strip()).stat().st_size > 10_000
    bag = vsnbench(
        monkeypatch,
        capsys,
        "export",
        "bag",
        "1",
        "-o",
        str(tmp_path / "e.bag"),
        "--results",
        str(tmp_path / KeepFiles.NONE),
    )
    assert (bag.code, caplog.text.count("keeps no images: the bag")) == (0, 1)
    report = typed(
        *(
            "report",
            "--output",
            str(tmp_path / "pages"),
            "--results",
            str(tmp_path / KeepFiles.NONE),
        )
    )
    assert report.code == 0
    assert "1 episodes have no images." in (tmp_path / "pages" / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("usual", "options"),
    [
        (KeepFiles.IMAGES, {"robot": "simulated"}),
        (KeepFiles.IMAGES, {"robot": "simulated:lola2"}),
        (KeepFiles.ALL, {"robot": "simulated", "has_operator": True}),
        (KeepFiles.ALL, {"robot": "lola2"}),
        (KeepFiles.ALL, {"robot": "mylab.robot:Robot"}),
    ],
)
def test_rerun_copies_are_made_at_once_only_with_an_operator(usual: KeepFiles, options: dict[str, Any]) -> None:
    assert what_to_keep("", **options) is usual
    assert [what_to_keep(keep, **options) for keep in KeepFiles] == list(KeepFiles)


def test_a_run_says_what_it_keeps_in_a_new_record_or_that_it_keeps_nothing(typed: Typed, tmp_path: Path) -> None:
    results = str(tmp_path / "results")
    for words, said in (
        ((), ["--keep images: images are kept; `vsnbench view` makes Rerun's copy"]),
        (("--repetitions", "2"), []),
        (("--repetitions", "3", "--keep", "none"), ["--keep none: no images are kept"]),
    ):
        answer = typed("run", *WORDS, *words, "--results", results)
        assert answer.code == 0
        assert [line for line in answer.err.splitlines() if line.startswith("--keep")] == said


def test_a_real_robots_images_are_always_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tests.robots import test_registry

    name = f"{test_registry.__name__}:OutsideRobot"
    real = test_registry.RobotIdentity(test_registry.load_profile("lola2"), name, simulated=False)
    monkeypatch.setattr(test_registry.OutsideRobot, "identity", real)
    setup = TrialSetupSpec(load_site("apartment"), "forward", ("bed",), robot=name, keep=KeepFiles.NONE)
    request = RunRequest(setup, ResultsDirectory.locate(tmp_path / "new"))
    with pytest.raises(UsageError, match="cannot be rendered again"):
        launch(request, OperatorProvider(unattended=True))
    assert not (tmp_path / "new").exists()
