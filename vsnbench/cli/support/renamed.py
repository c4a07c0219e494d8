"""Spellings of the previous version: a command line that uses one gets the new spelling as its answer."""

from collections.abc import Mapping, Sequence
from itertools import takewhile

from vsnbench.errors import UsageError

_CONSOLE = {
    "--console-address": "--console ADDRESS:PORT, or `address` in section [console] of vsnbench.toml",
    "--console-port": "--console ADDRESS:PORT, or `port` in section [console] of vsnbench.toml",
    "--console-certificate": "`certificate` in section [console] of vsnbench.toml",
    "--console-key": "`key` in section [console] of vsnbench.toml",
}
_NODES = {
    f"{ros} {old}": f"robots {new} NAME"
    for ros in ("ros", "ros1", "ros2")
    for old, new in {"simulate": "simulate", "discrete-move": "serve", "undock": "undock"}.items()
}
RENAMED: Mapping[str, str] = {
    **_NODES,
    "ros": "robots",
    "ros1": "robots",
    "ros2": "robots",
    "import withdraw": "db remove-import",
    "sites look": "sites render",
    "run --sites": "--site",
    "run --seeds": "--seed",
    "run --pretend-real": "--rehearse",
    "run --record full": "--keep all",
    "run --record lean": "--keep images",
    "run --record numbers": "--keep none",
    "run --record": "--keep",
    "run --cluster": "--workers ray://HEAD:PORT",
    "run --gpus": "`gpus_per_worker` in section [cluster] of vsnbench.toml",
    "run --act-timeout": "`act_timeout_s` in section [models] of vsnbench.toml",
    "run --device": "`device` in section [models] of vsnbench.toml",
    "run --python": "--isolate PYTHON",
    "run --isolate-memory": "`memory_gib` in section [isolation] of vsnbench.toml",
    "run --shuffle": "",
    "run --yes": "",
    "run -y": "",
    **{f"run {old}": new for old, new in _CONSOLE.items()},
    **{f"study run {old}": new for old, new in _CONSOLE.items()},
    "study run --model-memory": "`model_memory_gib` in section [study] of vsnbench.toml",
    "study new --pretend-real": "--rehearse",
    "study new --open": "--no-blind",
    "--site twins:": "flat:",
    "--site twin:": "flat:",
    "--keep full": "all",
    "--keep lean": "images",
    "--keep numbers": "none",
}
"""Command, command with option, or option with value -> new spelling; an empty one was removed without a successor."""


def refuse_renamed(words: Sequence[str]) -> None:
    """Refuse commands and options of the previous version.

    Args:
        words: the command line without the name of the program.

    Raises:
        UsageError: one is used; the advice is the new spelling.
    """
    typed = list(takewhile(lambda word: word != "--", words))
    verb, *rest = typed or [""]
    commands = [verb, f"{verb} {rest[0]}"] if rest and not rest[0].startswith("-") else [verb]
    for old in reversed(commands):
        if old in RENAMED:
            raise _renamed(f"`vsnbench {old}`", f"`vsnbench {RENAMED[old]}`")
    for place, word in enumerate(rest):
        name, equals, value = word.partition("=")
        if name.startswith("-"):
            value = value if equals else "".join(rest[place + 1 : place + 2])
            keys = [key for command in commands for key in (f"{command} {name} {value}", f"{command} {name}")]
            if old := next((key for key in keys if key in RENAMED), ""):
                option = f"{name} {value}" if old.endswith(f"{name} {value}") else name
                raise _renamed(option, RENAMED[old])


def refuse_renamed_value(option: str, value: str) -> None:
    """Refuse a value with a prefix of the previous version.

    Raises:
        UsageError: it has one; the advice is the new spelling.
    """
    for old, new in RENAMED.items():
        name, _, prefix = old.partition(" ")
        if name == option and value.startswith(prefix):
            raise _renamed(f"{option} {value}", f"{option} {new}{value.removeprefix(prefix)}")


def _renamed(old: str, new: str) -> UsageError:
    if not new:
        return UsageError(f"{old} was removed", advice="leave it out", code="removed-spelling")
    return UsageError(f"{old} was renamed", advice=f"use {new}", code="renamed-spelling")
