"""The layers of the package, and limits on its files."""

import ast
import re
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "vsnbench"


def test_imports_point_downward() -> None:
    # In another process, because import-linter disables the loggers of the present one.
    code = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
    done = subprocess.run([sys.executable, "-c", code], cwd=PACKAGE.parent, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_every_file_of_the_package_opens_by_saying_its_job() -> None:
    files = list(PACKAGE.rglob("*.py"))
    assert [str(file) for file in files if not ast.get_docstring(ast.parse(file.read_text(encoding="utf-8")))] == []


def test_the_protocol_names_no_topic_or_message_of_ros() -> None:
    spoken = re.compile(r"\b(geometry|nav|sensor|std|kobuki)_msgs\b|cmd_vel|\bRos[A-Z1]|rospy|\"/[a-z_]+/[a-z_]+\"")
    for file in (PACKAGE / "protocol").rglob("*.py"):
        assert not spoken.search(file.read_text(encoding="utf-8")), file


ALONE = PACKAGE / "models" / "remote" / "vsnbench_policy.py"
"""Is copied to other machines as one file, so it cannot be several."""


def test_every_console_is_the_one_that_sanitizes_text() -> None:
    own = re.compile(r"rich\.console import [^#\n]*\bConsole\b|rich\.console\.Console|from rich import print")
    files = [file for file in PACKAGE.rglob("*.py") if file != PACKAGE / "text" / "terminal.py"]
    assert [str(file) for file in files if own.search(file.read_text(encoding="utf-8"))] == []


def test_no_file_has_grown_into_two() -> None:
    lengths = {file: len(file.read_text(encoding="utf-8").splitlines()) for file in PACKAGE.rglob("*.py")}
    assert {str(file): length for file, length in lengths.items() if length > 350 and file != ALONE} == {}


def test_the_name_of_a_class_is_used_once() -> None:
    texts = [file.read_text(encoding="utf-8") for file in PACKAGE.rglob("*.py") if file != ALONE]
    names = Counter(name for text in texts for name in re.findall(r"^ *class (\w+)", text, re.MULTILINE))
    assert [name for name, count in names.items() if count > 1] == []


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


def test_the_architecture_page_names_every_package_and_only_existing_files() -> None:
    page = (PACKAGE.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    packages = {name for layer in _layers() for name in layer}
    assert [name for name in packages if not re.search(rf"`{name}`", page)] == []
    named = set(re.findall(r"`([a-z0-9_]+/[a-z0-9_/]+\.py)`", page))
    assert len(named) > 20
    outside = {name for name in named if name.startswith(("tests/", "scripts/"))}
    assert [name for name in named - outside if not (PACKAGE / name).is_file()] == []
    assert [name for name in outside if not (PACKAGE.parent / name).is_file()] == []


def test_the_table_of_layers_on_the_architecture_page_is_the_contract() -> None:
    page = (PACKAGE.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`[a-z0-9_`, ]+`) \|", page, re.MULTILINE)
    assert [set(re.findall(r"`(\w+)`", row)) for row in rows[: len(_layers())]] == _layers()


def test_no_folder_holds_more_than_fifteen_modules() -> None:
    counts = {
        str(folder): len([file for file in folder.glob("*.py") if file.name != "__init__.py"])
        for folder in [PACKAGE, *(path for path in PACKAGE.rglob("*") if path.is_dir())]
    }
    assert {folder: count for folder, count in counts.items() if count > 15} == {}


def _layers() -> list[set[str]]:
    """Return the packages of each layer, top to bottom, as the import contract in pyproject.toml lists them."""
    config = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text(encoding="utf-8"))
    return [set(layer.split(" | ")) for layer in config["tool"]["importlinter"]["contracts"][0]["layers"]]
