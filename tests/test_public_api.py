"""The names that `vsnbench` exports, and the imports of version 0.1 that still work."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import vsnbench
from vsnbench.deprecated_imports import _MOVED


def test_every_public_name_can_be_imported_and_is_the_one_its_module_defines() -> None:
    assert vsnbench.__all__ == sorted(name for names in vsnbench._NAMES.values() for name in names)
    for module, names in vsnbench._NAMES.items():
        for name in names:
            assert getattr(vsnbench, name) is getattr(importlib.import_module(module), name)
            assert name in dir(vsnbench)
    with pytest.raises(AttributeError):
        vsnbench.Unknown  # noqa: B018


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse(Path(vsnbench.__file__).read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    imported = {node.module: tuple(alias.name for alias in node.names) for node in block.body}
    assert imported == vsnbench._NAMES


def test_importing_the_package_loads_none_of_its_modules() -> None:
    code = "import sys, vsnbench; print(*(name for name in sys.modules if name.startswith(('vsnbench.', 'numpy'))))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["vsnbench.deprecated_imports"]


@pytest.mark.parametrize(("old", "new"), _MOVED.items())
def test_a_moved_module_still_imports_with_a_warning(old: str, new: str) -> None:
    sys.modules.pop(old, None)
    with pytest.warns(DeprecationWarning, match=f"{old} has moved") as caught:
        module = importlib.import_module(old)
    successor = importlib.import_module(new)
    names = [name for name in vars(successor) if not name.startswith("__")]
    assert [name for name in names if getattr(module, name) is not getattr(successor, name)] == []
    assert len(caught) == 1


def test_the_warning_names_the_public_import_at_the_line_of_the_old_one(tmp_path: Path) -> None:
    (tmp_path / "old.py").write_text("\nfrom vsnbench.protocol.actions import Action\nprint(Action.STOP)\n")
    done = subprocess.run(
        [sys.executable, "-W", "default", "old.py"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout == "STOP\n"
    assert "old.py:2: DeprecationWarning" in done.stderr
    assert "`from vsnbench import Action`" in done.stderr
