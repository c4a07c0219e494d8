"""The floors of the house: imports point downward only."""

import ast
import re
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "vsnbench"

_PURE = {"protocol", "statistics"}
_MACHINERY = {"motion", "sensing", "simulator", "placement", "scan_matching", "ros1", "ros2"}
_RESOURCES = {"models", "robots", "database", "record", "study"}

MAY_IMPORT: dict[str, set[str]] = {
    "protocol": set(),
    "statistics": set(),
    "motion": {"protocol"},
    "sensing": {"protocol", "motion"},
    "simulator": {"protocol", "motion"},
    "placement": {"protocol", "simulator"},
    "scan_matching": {"protocol"},
    "ros1": {"protocol", "motion", "sensing", "simulator"},
    "ros2": {"protocol", "motion", "sensing", "simulator"},
    "database": {"protocol"},
    "record": {"protocol"},
    "models": {"protocol", "sensing"},
    "robots": {"protocol"} | _MACHINERY,
    "study": _PURE,
    "viewer": {"protocol", "database", "record"},
    "report": _PURE | {"database", "record", "study"},
    "exchange": {"protocol", "sensing", "database", "record"},
    "runner": {"protocol"} | _MACHINERY | _RESOURCES,
    "console": {"protocol", "simulator", "sensing"} | _RESOURCES | {"viewer", "report", "exchange", "runner"},
    "cli": _PURE | _MACHINERY | _RESOURCES | {"viewer", "report", "exchange", "runner", "console"},
}
GROUND = {
    "compilation",
    "compute_threads",
    "database_url",
    "end_signals",
    "errors",
    "git_checkout",
    "harmless_text",
    "lab_file",
    "loopback",
    "machine_cache",
    "plugins",
    "resources",
    "ros_generation",
    "whole_files",
    "scratch",
    "workers",
}
"""Modules beside the rooms that every room may import."""


def imported_rooms(file: Path) -> set[str]:
    rooms: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{file}: relative import"
            names = [f"vsnbench.{alias.name}" for alias in node.names] if node.module == "vsnbench" else [node.module]
        rooms |= {name.split(".")[1] for name in names if name.startswith("vsnbench.")}
    return {room for room in rooms if (PACKAGE / room).is_dir() or (PACKAGE / f"{room}.py").is_file()}


def test_every_package_stands_on_a_floor() -> None:
    packages = {path.name for path in PACKAGE.iterdir() if path.is_dir() and (path / "__init__.py").is_file()}
    assert packages == set(MAY_IMPORT)


@pytest.mark.parametrize("room", sorted(MAY_IMPORT))
def test_a_room_imports_only_from_the_floors_below(room: str) -> None:
    allowed = MAY_IMPORT[room] | GROUND | {room}
    wrong = {
        str(file.relative_to(PACKAGE.parent)): climbs
        for file in sorted((PACKAGE / room).rglob("*.py"))
        if (climbs := imported_rooms(file) - allowed)
    }
    assert not wrong


def test_the_ground_imports_no_room() -> None:
    for name in GROUND:
        assert imported_rooms(PACKAGE / f"{name}.py") <= GROUND


def test_the_check_notices_an_import_that_climbs(tmp_path: Path) -> None:
    file = tmp_path / "climber.py"
    file.write_text("from vsnbench.cli import main\nimport vsnbench.runner.selection\n")
    assert imported_rooms(file) == {"cli", "runner"}


def test_every_file_of_the_package_opens_by_saying_its_job() -> None:
    files = list(PACKAGE.rglob("*.py"))
    assert [str(file) for file in files if not ast.get_docstring(ast.parse(file.read_text(encoding="utf-8")))] == []


def test_the_protocol_names_no_topic_or_message_of_ros() -> None:
    spoken = re.compile(r"\b(geometry|nav|sensor|std|kobuki)_msgs\b|cmd_vel|\bRos[A-Z1]|rospy|\"/[a-z_]+/[a-z_]+\"")
    for file in (PACKAGE / "protocol").rglob("*.py"):
        assert not spoken.search(file.read_text(encoding="utf-8")), file


ALONE = PACKAGE / "models" / "remote" / "vsnbench_policy.py"
"""Is copied to other machines as one file, so it cannot be several."""


def test_no_file_has_grown_into_two() -> None:
    lengths = {file: len(file.read_text(encoding="utf-8").splitlines()) for file in PACKAGE.rglob("*.py")}
    assert {str(file): length for file, length in lengths.items() if length > 350 and file != ALONE} == {}


def test_no_module_imports_itself_through_others() -> None:
    imports = {_dotted(file): _imported_when_loaded(file) for file in PACKAGE.rglob("*.py")}
    left = {name: {other for other in others if other in imports} for name, others in imports.items()}
    while free := {name for name, others in left.items() if not others}:
        left = {name: others - free for name, others in left.items() if name not in free}
    assert left == {}


def _dotted(file: Path) -> str:
    return ".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")


def _imported_when_loaded(file: Path) -> set[str]:
    """Return the modules of ours that are imported at the top of a file."""
    found: set[str] = set()
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return {name for name in found if name.startswith("vsnbench.")} - {_dotted(file)}


def test_the_drawing_of_the_house_names_every_room_and_only_files_that_there_are() -> None:
    drawing = (PACKAGE.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert [room for room in {*MAY_IMPORT, *GROUND} if not re.search(rf"\b{room}\b", drawing)] == []
    named = set(re.findall(r"`([a-z0-9_]+/[a-z0-9_/]+\.py)`", drawing))
    assert len(named) > 20
    beside = {name for name in named if name.startswith(("tests/", "scripts/"))}
    assert [name for name in named - beside if not (PACKAGE / name).is_file()] == []
    assert [name for name in beside if not (PACKAGE.parent / name).is_file()] == []
