"""The names that `vsnbench` exports."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import vsnbench


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
    assert done.stdout.split() == []
