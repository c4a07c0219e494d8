"""Looks at comparisons: how often the outcomes of two conditions were compared, in a file of the results directory.

A look is a comparison whose outcomes differ from those of every earlier look at it: printing the same results again is
none. The file has one JSON object per line and is only appended to. Another program or person may have written it, so
lines that are not looks are ignored.
"""

import contextlib
import json
import os
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from vsnbench.errors import RecordError
from vsnbench.files.bounded_json import parse_json
from vsnbench.files.regular import open_regular

LOOKS_FILE = "looks.jsonl"
_MAX_BYTES = 4_000_000
_MAX_EPISODES = 10**9
_DIGEST = 64

Looks = tuple[tuple[int, int], ...]
"""Episodes of both conditions at each look, in order; the newest is last."""


def recorded_looks(directory: Path, comparison: str) -> dict[str, tuple[int, int]]:
    """Return the looks at a comparison: digest of the outcomes -> episodes of both conditions, in order.

    Args:
        directory: the results directory.
        comparison: SHA-256 of what is compared.

    Raises:
        RecordError: the file exists and cannot be read.
    """
    path = directory / LOOKS_FILE
    try:
        with open_regular(path) as file:
            content = file.read(_MAX_BYTES + 1)
    except FileNotFoundError:
        return {}
    except OSError as problem:
        raise RecordError(f"cannot read {path}: {problem.strerror or problem}", advice="move it away") from problem
    if len(content) > _MAX_BYTES:
        raise RecordError(f"{path} is longer than {_MAX_BYTES:,} bytes", advice="move it away", code="looks-too-long")
    found: dict[str, tuple[int, int]] = {}
    for own, outcomes, episodes in _looks_of(content):
        if own == comparison:
            found.setdefault(outcomes, episodes)
    return found


def _looks_of(content: bytes) -> Iterator[tuple[str, str, tuple[int, int]]]:
    """Yield comparison, digest of the outcomes and episodes of each line that is a look."""
    for line in content.splitlines():
        with contextlib.suppress(ValueError, TypeError, KeyError, RecursionError):
            look = parse_json(line)
            comparison, outcomes, episodes = look["comparison"], look["outcomes"], look["episodes"]
            first, second = episodes
            if all(isinstance(word, str) and len(word) == _DIGEST for word in (comparison, outcomes)) and all(
                type(number) is int and 0 <= number <= _MAX_EPISODES for number in (first, second)
            ):
                yield comparison, outcomes, (first, second)


def add_look(directory: Path, comparison: str, outcomes: str, episodes: tuple[int, int]) -> Looks:
    """Record a look if its outcomes are new, and return all looks at this comparison.

    Args:
        directory: the results directory.
        comparison: SHA-256 of what is compared, whatever the outcomes.
        outcomes: SHA-256 of the compared outcomes.
        episodes: compared episodes of both conditions.

    Raises:
        RecordError: the file exists and cannot be read.
        OSError: the look cannot be written; `recorded_looks` still tells the earlier ones.
    """
    known = recorded_looks(directory, comparison)
    if outcomes not in known:
        known[outcomes] = episodes
        at = datetime.now(UTC).isoformat(timespec="seconds")
        look = {"at": at, "comparison": comparison, "outcomes": outcomes, "episodes": episodes}
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
        descriptor = os.open(directory / LOOKS_FILE, flags, 0o666)
        try:
            os.write(descriptor, (json.dumps(look) + "\n").encode())  # one write, so that lines of two processes stay
        finally:
            os.close(descriptor)
    return tuple(known.values())
