"""Files of killed runs are removed, and no others."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.runner.stand_ins import PLAN, PROFILE
from vsnbench.files.atomic import part_path
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.files.images import depth_path, rgb_path
from vsnbench.results.writing.campaigns import CampaignPlan, Trial
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.setup.cleanup import sweep_results
from vsnbench.values.model.card import ModelCard
from vsnbench.values.robot_identity import RobotIdentity


@pytest.fixture
def dead() -> int:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_uncommitted_images_and_incomplete_files_are_removed(tmp_path: Path, dead: int) -> None:
    results = ResultsDirectory.locate(tmp_path, None)
    results.prepare()
    plan = CampaignPlan(
        PLAN.site,
        RobotIdentity(PROFILE, "simulated", True),
        ModelCard("scripted"),
        PLAN.parameters,
        0,
        [Trial(PLAN.goal, 1)],
    )
    with Journal.open(results.database_url) as journal:
        campaign = journal.find_or_create_campaign(plan)
        claim = journal.claim_next(campaign.id, [campaign.trials[0].id])
        assert claim is not None
        void = Verdict(EndReason.INTERRUPTED, None, "void")
        journal.end_episode(claim.id, EpisodeEnd(void, 2))
        folder = results.episode_directory(claim.images_directory)
        other = results.path / "episodes" / "000099"
        kept = [rgb_path(folder, 1), rgb_path(folder, 2), depth_path(folder, 2), part_path(other / "episode.rrd")]
        lost = [
            rgb_path(folder, 3),
            depth_path(folder, 3),
            folder / "rgb" / f".0003.jpg.{dead}.part",
            folder / "episode.rrd.part",
            other / f".episode.rrd.{dead}.part",
        ]
        for path in (*kept, *lost):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(b"x")
        sweep_results(results, journal)
    assert all(path.exists() for path in kept)
    assert not [path for path in lost if path.exists()]


def test_paths_outside_the_results_directory_are_left_alone(tmp_path: Path) -> None:
    results = ResultsDirectory.locate(tmp_path / "results", None)
    results.prepare()
    precious = tmp_path / "rgb" / "0001.jpg"
    precious.parent.mkdir()
    precious.write_bytes(b"x")
    (results.path / "episodes" / "000001").symlink_to(tmp_path)
    with Journal.open(results.database_url) as journal:
        sweep_results(results, journal)
    assert precious.exists()
