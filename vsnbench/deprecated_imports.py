"""Modules that were documented in version 0.1 and have moved: importing them works with a warning.

Removed in version 2, together with `vsnbench.models.duck_typed`.
"""

import sys
import warnings
from collections.abc import Mapping, Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType

_MOVED = {
    "vsnbench.models.weights": "vsnbench.models.checkpoints.weights",
    "vsnbench.protocol.actions": "vsnbench.values.action",
    "vsnbench.protocol.camera": "vsnbench.values.camera",
    "vsnbench.protocol.decision": "vsnbench.values.decision",
    "vsnbench.protocol.fix": "vsnbench.values.fix",
    "vsnbench.protocol.motion_result": "vsnbench.values.motion_result",
    "vsnbench.protocol.observation": "vsnbench.values.observation",
    "vsnbench.protocol.placement": "vsnbench.values.placement",
    "vsnbench.protocol.pose": "vsnbench.values.pose",
    "vsnbench.protocol.robot_identity": "vsnbench.values.robot_identity",
    "vsnbench.protocol.settings_file": "vsnbench.settings.yaml_file",
    "vsnbench.protocol.site": "vsnbench.sites.site",
}


class _Finder:
    """Finds moved modules, after every other finder has failed."""

    def __init__(self, public_names: Mapping[str, Sequence[str]]) -> None:
        self._public_names = public_names

    def find_spec(self, name: str, _path: object = None, _target: object = None) -> ModuleSpec | None:
        """Return a specification for a moved module."""
        return ModuleSpec(name, self) if name in _MOVED else None  # type: ignore[arg-type] # a loader by its methods

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        """Return None: the import system creates an empty module."""

    def exec_module(self, module: ModuleType) -> None:
        """Copy the names of the module's successor, and warn with the new import."""
        new = _MOVED[module.__name__]
        names = self._public_names.get(new)
        statement = f"from vsnbench import {', '.join(names)}" if names else f"import {new}"
        warnings.warn(f"{module.__name__} has moved: write `{statement}`", DeprecationWarning, stacklevel=2)
        vars(module).update({name: value for name, value in vars(import_module(new)).items() if name[:2] != "__"})


def install_finder(public_names: Mapping[str, Sequence[str]]) -> None:
    """Make moved modules importable.

    Args:
        public_names: names that `vsnbench` exports, by the module that defines them; for the warning.
    """
    sys.meta_path.append(_Finder(public_names))
