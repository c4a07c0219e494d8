"""Looks at comparisons: how often the outcomes of two conditions were compared, and what several looks mean.

A look is a comparison whose outcomes differ from those of every earlier look at it: printing the same results again is
none. Looks are in a file of the results directory, which has one JSON object per line and is only appended to. Another
program or person may have written it, so lines that are not looks are ignored.
"""

import contextlib
import hashlib
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from vsnbench.errors import RecordError
from vsnbench.files.bounded_json import parse_json
from vsnbench.files.regular import open_regular
from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.comparison.compare import Comparison, Looks
from vsnbench.statistics.clustered import Outcomes

LOOKS_FILE = "looks.jsonl"
_MAX_BYTES = 4_000_000
_MAX_EPISODES = 10**9
_DIGEST = 64
_SHOWN = 5
"""Number of earlier looks that a sentence lists."""


def with_looks(comparisons: Sequence[Comparison], directory: Path) -> tuple[tuple[Comparison, ...], str]:
    """Record a look at each comparison with new outcomes, and add all looks.

    Args:
        comparisons: comparisons that are shown; those with the paper on both sides have no looks.
        directory: the results directory.

    Returns:
        The comparisons, and why their looks were not recorded; empty if they were.

    Raises:
        RecordError: the file of looks cannot be read.
    """
    found, problem = [], ""
    for comparison in comparisons:
        sides = _sides(comparison)
        if comparison.first.published and comparison.second.published:
            found.append(comparison)
            continue
        identity, outcomes = _sha256([side[0] for side in sides]), _sha256(sides)
        episodes = (comparison.rates[0].first.episodes, comparison.rates[0].second.episodes)
        try:
            looks = _add(directory, identity, outcomes, episodes)
        except OSError as refused:
            problem = f"this look is not recorded: cannot write {directory}: {refused.strerror or refused}"
            looks = tuple((_recorded(directory, identity) | {outcomes: episodes}).values())
        found.append(replace(comparison, looks=looks))
    return tuple(found), problem


def looks_at(comparison: Comparison, directory: Path) -> Looks:
    """Return the recorded looks at a comparison; records none."""
    return tuple(_recorded(directory, _sha256([side[0] for side in _sides(comparison)])).values())


def looks_sentences(looks: Looks | None) -> tuple[str, ...]:
    """Return what several looks mean; nothing for the first."""
    if not looks or len(looks) < 2:
        return ()
    earlier = looks[:-1]
    shown = ", ".join(f"{first} : {second}" for first, second in earlier[-_SHOWN:])
    more = "" if len(earlier) <= _SHOWN else f"; the last {_SHOWN} of {len(earlier)}"
    what = f"Look {len(looks)} at these two with new results; earlier ones at {shown} episodes{more}"
    meaning = (
        "Test and interval are those of a single look: who looks again until a difference appears finds one too often. "
        "`vsnbench study` plans looks"
    )
    return (f"{what}. {meaning}.",)


def _sides(comparison: Comparison) -> list[tuple[str, list[Any]]]:
    """Return the identity and the outcomes of both conditions, whichever comes first."""
    rate = comparison.rates[0]
    sides = (comparison.first, rate.first.outcomes), (comparison.second, rate.second.outcomes)
    return sorted((_identity(condition), _listed(outcomes)) for condition, outcomes in sides)


def _identity(condition: Condition) -> str:
    """Return the SHA-256 of what makes a condition what it is, apart from its seeds and campaigns."""
    robot = (condition.robot, condition.kind, condition.site_sha256, condition.conditions)
    model = (condition.label, condition.weights_sha256, condition.settings, condition.source)
    return _sha256([*model, *robot, condition.protocol])


def _listed(outcomes: Outcomes) -> list[Any]:
    return sorted((cell.cluster, cell.successes, cell.trials) for cell in outcomes.cells)


def _sha256(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()


def _recorded(directory: Path, comparison: str) -> dict[str, tuple[int, int]]:
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


def _add(directory: Path, comparison: str, outcomes: str, episodes: tuple[int, int]) -> Looks:
    """Record a look if its outcomes are new, and return all looks at this comparison.

    Args:
        directory: the results directory.
        comparison: SHA-256 of what is compared, whatever the outcomes.
        outcomes: SHA-256 of the compared outcomes.
        episodes: compared episodes of both conditions.

    Raises:
        RecordError: the file exists and cannot be read.
        OSError: the look cannot be written; `_recorded` still tells the earlier ones.
    """
    known = _recorded(directory, comparison)
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
