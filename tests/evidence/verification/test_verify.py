"""A record that was changed by hand is found, and the finding names the file, or the table with row and column."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.test_record_verbs import vsnbench
from tests.evidence.verification.conftest import Change, change, lines, verified
from vsnbench.errors import RecordError
from vsnbench.evidence.bundle.archive import open_bundle
from vsnbench.evidence.verification.checks import Verification
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.second_judgements import Outcome
from vsnbench.results.writing.journal import Journal


def flip(path: Path, place: int = -3) -> None:
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)


def times_of_change(results: Path) -> dict[Path, int]:
    """When each file was written, without SQLite's shared memory (`-shm`): a reader notes in it how far it read."""
    return {path: path.stat().st_mtime_ns for path in results.rglob("*") if not path.name.endswith("-shm")}


def counts(found: Verification) -> dict[str, tuple[int, int]]:
    return {check.name: (check.checked, check.failed) for check in found.checks}


def test_an_intact_record_holds_and_episodes_driven_again_are_identical(recorded: Path) -> None:
    found = verified(recorded, replay=None)
    assert (lines(found), found.holds) == ([], True)
    assert counts(found)["replay"] == counts(found)["verdicts"] == (4, 0)
    images = len(list(recorded.glob("episodes/*/*/*.*")))
    assert counts(found)["files"] == (images + 4, 0)  # and four trajectories


def test_an_intact_bundle_holds_with_its_report_made_again(bundled: Path) -> None:
    found = verified(bundled, replay=2)
    assert (lines(found), found.holds) == ([], True)
    assert counts(found)["report"][0] > 5
    assert counts(found)["replay"] == (2, 0)


def test_verification_writes_nothing_and_needs_no_permission_to(results: Path) -> None:
    before = times_of_change(results)
    assert verified(results).holds
    assert times_of_change(results) == before


CELLS: tuple[dict[str, str], ...] = (
    {
        "UPDATE step SET turn_rad = 0.1 WHERE episode_id = 3 AND number = 1": "step 3/1: turn_rad",
        "UPDATE step SET rgb_digest = 'blake3:0' WHERE episode_id = 1 AND number = 2": "step 1/2: rgb",
        "UPDATE step SET depth_digest = 'blake3:0' WHERE episode_id = 2 AND number = 1": "episodes/000002/depth/0001",
        "UPDATE step SET world_x_m = world_x_m + 0.1 WHERE episode_id = 4 AND number = 1": (
            "episodes/000004/trajectory.tum"
        ),
    },
    {
        "UPDATE step SET rgb_file_digest = 'blake3:0' WHERE episode_id = 2 AND number = 1": (
            "episodes/000002/rgb/0001.jpg"
        ),
        "UPDATE step SET world_x_m = NULL WHERE episode_id = 1 AND number = 2": "step 1/2: world_x_m: missing",
        "DELETE FROM step WHERE episode_id = 4 AND number = 1": "step 4: number",
    },
    {
        "UPDATE episode SET end_reason = 'step_limit' WHERE id = 1": "episode 1: end_reason",
        "UPDATE episode SET actions = actions + 1 WHERE id = 2": "episode 2: actions",
        "UPDATE episode SET seed = seed + 1 WHERE id = 2": "episode 2: seed",
        "UPDATE episode SET distance_to_goal_m = 0.5 WHERE id = 4": "episode 4: distance_to_goal_m",
        "UPDATE episode SET final_x_m = final_x_m + 0.1 WHERE id = 4": "episode 4: final_x_m",
        "UPDATE episode SET path_length_m = 9 WHERE id = 1": "episode 1: path_length_m",
        "UPDATE episode SET geodesic_start_m = 9 WHERE id = 1": "episode 1: geodesic_start_m",
        "UPDATE episode SET duration_s = 9 WHERE id = 1": "episode 1: duration_s",
        "UPDATE episode SET thinking_s = 9 WHERE id = 1": "episode 1: thinking_s",
        "UPDATE episode SET state = 'void' WHERE id = 1": "episode 1: state",
    },
    {
        "UPDATE episode SET path_length_m = NULL WHERE id = 1": "episode 1: path_length_m: missing",
        "UPDATE episode SET geodesic_start_m = NULL WHERE id = 1": "episode 1: geodesic_start_m: missing",
        "UPDATE episode SET geodesic_end_m = NULL WHERE id = 1": "episode 1: geodesic_end_m: missing",
        "UPDATE episode SET duration_s = NULL WHERE id = 1": "episode 1: duration_s: missing",
        "UPDATE episode SET start_x_m = NULL WHERE id = 2": "episode 2: start_x_m: missing",
        "UPDATE episode SET final_x_m = NULL WHERE id = 3": "episode 3: final_x_m",
        "UPDATE episode SET path_length_m = NULL, geodesic_end_m = 0 WHERE id = 4": "episode 4: geodesic_end_m",
    },
    {
        "UPDATE verdict SET success = 1 - success WHERE episode_id = 3": "verdict 3: success",
        "UPDATE verdict SET distance_m = 0.1 WHERE episode_id = 4": "verdict 4: distance_m",
        "UPDATE verdict SET reason = 'success' WHERE episode_id = 4": "verdict 4: reason",
        "UPDATE verdict SET goal_instance = 'chair-9' WHERE episode_id = 4": "verdict 4: goal_instance",
        "DELETE FROM verdict WHERE episode_id = 1": "verdict of episode 1",
    },
    {
        "UPDATE episode SET started_at = '2026-13-41' WHERE id = 2": "episode 2: started_at",
        "UPDATE process SET vsnbench_version = x'00'": "process 1: vsnbench_version",
        "UPDATE process SET started_at = 'yesterday'": "process 1: started_at",
    },
    {
        "UPDATE site SET content = replace(content, '0.8', '0.9')": "site 1: content",
        "UPDATE robot SET profile = replace(profile, '0.177', '0.277')": "robot 1: profile",
        "UPDATE model SET name = 'vlv' WHERE id = 2": "model 2: sha256",
        "UPDATE campaign SET conditions = '{}' WHERE id = 1": "campaign 1: key",
        "UPDATE campaign SET seed = 7 WHERE id = 2": "campaign 2: key",
    },
    {"UPDATE campaign SET protocol = replace(protocol, '150', '250') WHERE id = 1": "campaign 1: protocol"},
)
"""Changes by the start of the line that names each; those of one record are named together."""


@pytest.mark.parametrize("cells", CELLS, ids=lambda cells: next(iter(cells.values())).partition(":")[0])
def test_changed_cells_that_other_rows_or_files_contradict_are_named(results: Path, cells: dict[str, str]) -> None:
    change(results, *cells)
    found = verified(results, replay=None if next(iter(cells)).startswith("UPDATE step") else 0)
    assert not found.holds
    named = lines(found)
    assert [where for where in cells.values() if not any(line.startswith(where) for line in named)] == [], named


FILES: dict[str, tuple[Change, str]] = {
    "colour": (lambda at: flip(at / "rgb/0001.jpg"), "rgb/0001.jpg: does not have the bytes"),
    "colour inside": (lambda at: flip(at / "rgb/0002.jpg", 700), "rgb/0002.jpg: does not have the bytes"),
    "depth": (lambda at: flip(at / "depth/0001.png", 60), "depth/0001.png: does not have the bytes"),
    "trajectory": (lambda at: flip(at / "trajectory.tum"), "trajectory.tum: line"),
    "more": (lambda at: (at / "rgb/0999.jpg").write_bytes(b"x"), "rgb/0999.jpg: no row describes it"),
    "link": (lambda at: (at / "notes").symlink_to("/etc/passwd"), "notes: is not a regular file"),
}
"""What can be wrong in one episode at once."""
PARTS: dict[str, tuple[Change, str]] = {
    "missing": (lambda at: (at / "rgb/0001.jpg").unlink(), "rgb/0001.jpg: is missing"),
    "folder": (lambda at: (at / "depth").rename(at / "d") and (at / "depth").symlink_to("d"), "depth: is a link"),
    "pipe": (lambda at: (at / "rgb/0001.jpg").unlink() or os.mkfifo(at / "rgb/0001.jpg"), "is not a regular file"),
    "all": (shutil.rmtree, "000004: is missing"),
}
"""What is wrong in an episode each."""


def test_changed_files_of_an_episode_are_named(results: Path) -> None:
    directory = results / "episodes/000001"
    for harm, _ in FILES.values():
        harm(directory)
    found = verified(results)
    assert not found.holds
    assert {line for _, line in FILES.values() if not _is_said(found, directory, line)} == set(), lines(found)


def test_each_episode_without_a_file_or_with_another_thing_in_its_place_is_named(results: Path) -> None:
    directories = [results / f"episodes/{number:06}" for number in range(1, 5)]
    for directory, (harm, _) in zip(directories, PARTS.values(), strict=True):
        harm(directory)
    (directories[2] / "trajectory.tum").unlink()
    found = verified(results)
    assert not found.holds
    assert _is_said(found, directories[2], "trajectory.tum: is missing")
    for directory, (_, line) in zip(directories, PARTS.values(), strict=True):
        assert _is_said(found, directory, line), (line, lines(found))


def _is_said(found: Verification, directory: Path, line: str) -> bool:
    return any(said.startswith(f"episodes/{directory.name}") and line in said for said in lines(found))


def test_a_directory_that_no_episode_has_is_named(results: Path) -> None:
    (results / "episodes/000099").mkdir()
    assert lines(verified(results)) == ["episodes/000099: no episode of the record has it"]


@pytest.mark.parametrize("name", ["vsnbench-bundle.txt", "README.md", "report/report.json", "tables/steps.csv"])
def test_a_flipped_byte_of_an_unpacked_bundle_is_named(bundled: Path, tmp_path: Path, name: str) -> None:
    directory = open_bundle(bundled, tmp_path / "bundle").directory
    flip(directory / name, -1 if name.endswith("README.md") else -4)
    if name == "vsnbench-bundle.txt":
        with pytest.raises(RecordError):
            verified(directory)
    else:
        assert f"{name}: changed" in lines(verified(directory))


def test_a_changed_cell_of_a_bundle_is_found_by_its_file_and_named_by_the_tables(bundled: Path, tmp_path: Path) -> None:
    directory = open_bundle(bundled, tmp_path / "bundle").directory
    change(directory / "results", "UPDATE process SET host = 'elsewhere'")
    found = lines(verified(directory))
    assert "results/vsnbench.db: changed" in found
    assert [line for line in found if line.startswith("environment.json: processes[0].host: ")]


def test_verdicts_of_people_are_counted_by_author(results: Path) -> None:
    with Journal.open(sqlite_url(results / "vsnbench.db")) as journal:
        journal.judge(1, Verdict(EndReason.ABORTED, None, "void: a door was open"), author="ada")
        journal.judge(1, Verdict(EndReason.STOP, True, "success"), author="grace")
        journal.judge_second(1, "eve", Outcome.FAILURE, "too far")
    found = verified(results)
    assert found.holds
    assert found.people == {"ada": 1, "grace": 1}
    assert [note for check in found.checks for note in check.notes] == [
        "judged a second time, by a person: 1 episode by eve"
    ]


def test_a_delay_of_the_model_counts_towards_the_limit_of_time(tmp_path: Path) -> None:
    (tmp_path / "short.yaml").write_text("name: short\nmax_time_s: 6\n")
    words = ["--model", "forward", "--goal", "chair", "--starts", "1", "--robot", "simulated:turtlebot2@64x48"]
    words += ["--protocol", "short.yaml", "--disturb", "latency=1.5", "--workers", "1", "--results", "results"]
    subprocess.run([sys.executable, "-m", "vsnbench", "run", *words], check=True, capture_output=True, cwd=tmp_path)
    found = verified(tmp_path / "results", replay=None)
    assert (lines(found), counts(found)["replay"]) == ([], (1, 0))
    change(tmp_path / "results", "UPDATE campaign SET conditions = replace(conditions, '1.5', '0.5')")
    assert any(line.startswith("episode 1: end_reason: time_limit") for line in lines(verified(tmp_path / "results")))


_SMALL = ("--robot", "simulated:turtlebot2@64x48", "--workers", "1", "--quiet")
_PUSHER = """
from vsnbench import Action, Decision, ModelCard, Policy, Sensor

class Pusher(Policy):
    card = ModelCard(name="pusher", sensors=frozenset({Sensor.RGB, Sensor.DEPTH}))

    def reset(self, goal, seed):
        self.left = 3

    def act(self, observation):
        self.left -= 1
        return Decision(Action.MOVE_FORWARD if self.left >= 0 else Action.STOP)
"""


def test_an_action_that_the_depth_guard_refused_is_driven_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pusher.py").write_text(_PUSHER)
    monkeypatch.syspath_prepend(str(tmp_path))
    done = vsnbench(
        tmp_path / "results", "run", "--model", "pusher:Pusher", "--goal", "chair", "--starts", "1", *_SMALL
    )
    assert done.returncode == 0, done.stderr
    found = verified(tmp_path / "results", replay=None)
    assert (lines(found), counts(found)["replay"]) == ([], (1, 0))
    change(tmp_path / "results", "UPDATE step SET refusal = 'obstacle' WHERE refusal LIKE 'obstacle %' AND number = 2")
    (finding,) = lines(verified(tmp_path / "results", replay=None))
    assert finding.startswith("step 1/2: refusal")
