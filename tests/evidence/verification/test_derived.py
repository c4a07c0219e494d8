"""The report and the tables of a bundle are made again and compared; a bundle of another version may lack keys."""

import csv
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.evidence.verification.conftest import verified
from vsnbench.evidence.bundle.archive import open_bundle
from vsnbench.evidence.verification.checks import Check

Change = Callable[[], None]


@pytest.fixture(scope="module")
def unpacked(bundled: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return open_bundle(bundled, tmp_path_factory.mktemp("unpacked") / "bundle").directory


@pytest.fixture
def bundle(unpacked: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(unpacked, tmp_path / "bundle"))


def derived(directory: Path) -> Check:
    return next(check for check in verified(directory).checks if check.unit == "tables")


def edit_json(file: Path, change: Callable[[dict], object]) -> None:
    content = json.loads(file.read_text(encoding="utf-8"))
    change(content)
    file.write_text(json.dumps(content), encoding="utf-8")


def make_of_another_version(directory: Path) -> None:
    """Remove what a later version could add, and change words."""
    edit_json(directory / "environment.json", lambda content: content.update(made_by_vsnbench="0.9.0"))
    edit_json(directory / "report" / "report.json", lambda content: content["models"][0]["total"].pop("spl"))
    edit_json(directory / "report" / "report.json", lambda content: content["models"][0].update(name="its old name"))
    with (directory / "tables" / "episodes.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    with (directory / "tables" / "episodes.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(row[:3] + row[4:] for row in rows)
    (directory / "tables" / "verdicts.csv").unlink()
    (directory / "report" / "report.md").write_text("other words", encoding="utf-8")


def test_an_intact_bundle_is_compared_completely(bundle: Path) -> None:
    check = derived(bundle)
    assert (check.failed, check.findings, dict(check.not_checked)) == (0, [], {})
    assert check.checked > 8


def test_a_bundle_of_another_version_may_lack_keys_columns_and_files(bundle: Path) -> None:
    make_of_another_version(bundle)
    check = derived(bundle)
    assert check.findings == []
    assert dict(check.not_checked) == {"text of vsnbench 0.9.0": 2}


@pytest.mark.parametrize(
    ("name", "before", "after"),
    [
        ("report/report.json", '"successes": ', '"successes": 1'),
        ("tables/steps.csv", "MOVE_FORWARD", "TURN_LEFT"),
        ("tables/campaigns.csv", "oracle", "random"),
    ],
)
def test_a_changed_value_of_a_bundle_of_another_version_is_found(
    bundle: Path, name: str, before: str, after: str
) -> None:
    make_of_another_version(bundle)
    text = (bundle / name).read_text(encoding="utf-8")
    assert before in text
    (bundle / name).write_text(text.replace(before, after, 1), encoding="utf-8")
    assert [found.where.split(":")[0].split(" row ")[0] for found in derived(bundle).findings] == [name]


def test_a_bundle_of_this_version_must_have_every_key_column_file_and_word(bundle: Path) -> None:
    make_of_another_version(bundle)
    edit_json(bundle / "environment.json", lambda content: content.pop("made_by_vsnbench"))
    places = {found.where.split(":")[0] for found in derived(bundle).findings}
    assert places == {
        "report/report.json",
        "report/report.md line 1",
        "tables/episodes.csv row 0",
        "tables/verdicts.csv",
    }
