"""Two records of the same trials are compared step by step; the first difference is named."""

import json
from pathlib import Path

import cv2
import pytest

from tests.cli.test_record_verbs import vsnbench
from tests.evidence.verification.conftest import change
from tests.shared_records import SMALL
from vsnbench.errors import RecordError
from vsnbench.evidence.verification.checks import Check
from vsnbench.evidence.verification.verify import VerifyOptions, verify
from vsnbench.results.files.images import depth_path
from vsnbench.values.encoding.image_digest import file_digest


def against(record: Path, other: Path) -> Check:
    found = verify(record, lambda _what, _done, _of: None, VerifyOptions(against=other))
    (check,) = (check for check in found.checks if check.name == "against another record")
    return check


def test_records_of_the_same_trials_are_equal_and_the_command_says_so(recorded: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    assert vsnbench(again, "run", "--model", "random,oracle", *SMALL).returncode == 0
    done = vsnbench(again, "verify", str(recorded), "--against", str(again), "--json")
    assert done.returncode == 0, done.stdout
    (check,) = (each for each in json.loads(done.stdout)["checks"] if each["check"] == "against another record")
    assert (check["checked"], check["failed"], check["not_checked"]) == (4, 0, {})


def test_other_bytes_of_the_same_pixels_are_no_difference(results: Path, recorded: Path) -> None:
    file = depth_path(results / "episodes" / "000001", 1)
    pixels = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    assert pixels is not None
    assert cv2.imwrite(str(file), pixels, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    digest = file_digest(file.read_bytes())
    change(results, f"UPDATE step SET depth_file_digest = '{digest}' WHERE episode_id = 1 AND number = 1")
    check = against(results, recorded)
    assert (check.checked, check.failed) == (4, 0)


@pytest.mark.parametrize(
    ("statement", "where"),
    [
        ("UPDATE step SET world_x_m = world_x_m + 1e-9 WHERE episode_id = 2 AND number >= 3", "step 2/3: world_x_m"),
        ("UPDATE step SET depth_digest = 'blake3:0' WHERE episode_id = 1 AND number = 2", "step 1/2: depth_digest"),
        ("UPDATE step SET raw_action = 'x' WHERE episode_id = 4 AND number = 1", "step 4/1: raw_action"),
        ("DELETE FROM step WHERE episode_id = 1 AND number = (SELECT max(number) FROM step WHERE episode_id = 1)", ""),
        ("UPDATE episode SET end_reason = 'step_limit' WHERE id = 1", "episode 1: end_reason"),
    ],
)
def test_the_first_step_that_differs_is_named(recorded: Path, results: Path, statement: str, where: str) -> None:
    change(results, statement)
    check = against(recorded, results)
    assert (check.checked, check.failed) == (4, 1)
    (found,) = check.findings
    assert found.where == (where or "episode 1: actions")
    assert f"episode {found.where.split()[1].split('/')[0].rstrip(':')} of {results}" in found.text


def test_a_bundle_is_compared_and_trials_of_one_record_only_are_counted(bundled: Path, results: Path) -> None:
    assert against(results, bundled).failed == 0
    change(results, "UPDATE trial SET start = start + 100 WHERE start = 2")
    check = against(results, bundled)
    assert (check.checked, check.failed) == (2, 0)
    assert sorted(check.not_checked.values()) == [2, 2]


def test_records_without_a_common_trial_do_not_hold(recorded: Path, results: Path, tmp_path: Path) -> None:
    change(results, "UPDATE campaign SET key = key || 'x'")
    assert against(recorded, results).failed == 1
    with pytest.raises(RecordError):
        against(recorded, tmp_path / "nothing")
    assert against(recorded, recorded).failed == 0
