"""The workflows and the issue form of .github: they name targets and commands that exist, and ask for few rights."""

import re
import shlex
import tomllib
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from tests.docs.pages import understand
from tests.long_tests import LONG
from tests.slow_tests import SLOW

ROOT = Path(__file__).resolve().parents[1]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def read(path: Path) -> Any:
    return YAML(typ="safe").load(path.read_text(encoding="utf-8"))


def scripts(path: Path) -> list[str]:
    """Return the lines of all `run` steps."""
    steps = [step for job in read(path)["jobs"].values() for step in job["steps"]]
    return [line.strip() for step in steps for line in step.get("run", "").splitlines()]


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_reads_only_unless_a_guarded_job_publishes(path: Path) -> None:
    workflow = read(path)
    assert workflow["permissions"] == {"contents": "read"}
    for name, job in workflow["jobs"].items():
        assert 0 < job["timeout-minutes"] <= 120
        assert ("permissions" in job) == (name == "publish")
        assert name != "publish" or re.search(r"vars\.PUBLISH_\w+ == 'true'", job["if"])


def test_a_pushed_tag_is_published_without_a_stored_token_after_its_archives_were_tried() -> None:
    workflow = read(ROOT / ".github" / "workflows" / "wheels.yml")
    publish = workflow["jobs"]["publish"]
    assert workflow["on"]["push"]["tags"] == ["v*"]
    assert publish["if"].startswith("startsWith(github.ref, 'refs/tags/v')")
    assert (publish["needs"], workflow["jobs"]["smoke"]["needs"]) == ("smoke", "build")
    assert publish["permissions"] == {"id-token": "write"}
    (upload,) = [step for step in publish["steps"] if "pypi-publish" in step["uses"]]
    assert "with" not in upload, "no password"


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_make_targets_and_vsnbench_commands_of_a_workflow_exist(path: Path) -> None:
    targets = set(re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    lines = scripts(path)
    assert {line.split()[1] for line in lines if line.startswith("make ")} <= targets
    for line in lines:
        if command := re.search(r"bin/vsnbench (.*)", line):
            understand(shlex.split(command[1]))


def test_both_lanes_run_and_both_archives_are_tried_on_every_supported_python() -> None:
    lines = scripts(ROOT / ".github" / "workflows" / "ci.yml")
    assert {"make check-fast", "make test"} <= set(lines)
    matrix = read(ROOT / ".github" / "workflows" / "wheels.yml")["jobs"]["smoke"]["strategy"]["matrix"]
    assert matrix["archive"] == ["dist/*.whl", "dist/*.tar.gz"]
    tried = matrix["python"]
    classifiers = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["classifiers"]
    versions = {match[1] for text in classifiers if (match := re.fullmatch(r"Programming .* :: (3\.\d+)", text))}
    assert versions <= set(tried)


def test_the_form_for_bugs_requires_the_doctors_report() -> None:
    fields = {part.get("id"): part for part in read(ROOT / ".github" / "ISSUE_TEMPLATE" / "bug.yml")["body"]}
    assert "vsnbench doctor --json" in fields["doctor"]["attributes"]["label"]
    assert fields["doctor"]["validations"]["required"]
    assert fields["command"]["validations"]["required"]


def is_there(name: str) -> bool:
    """Tell whether a test exists: `file`, `file::name` or `file::name[id]`, from `tests`."""
    place, _, test = name.partition("[")[0].partition("::")
    file = ROOT / "tests" / place
    return file.exists() and (not test or f"def {test}(" in file.read_text(encoding="utf-8"))


def test_every_test_that_the_fast_ones_leave_out_exists() -> None:
    assert [name for name in SLOW if not is_there(name)] == []


def test_every_test_of_the_night_exists_and_so_does_the_cheaper_one_of_every_day() -> None:
    cheaper = [name for text in LONG.values() for name in re.findall(r"[\w/]+\.py(?:::\w+)?", text)]
    assert [name for name in (*LONG, *cheaper) if not is_there(name)] == []
    assert len(cheaper) > 20
    assert [name for name in cheaper if name in LONG] == []
    cases = {
        f"{key.partition('[')[0]}{case}"
        for key, text in LONG.items()
        for case in re.findall(r"its case (\[.*?\])", text)
    }
    assert sorted(cases & LONG.keys()) == []
