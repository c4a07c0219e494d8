"""Looks at a comparison: what identifies it, whether its outcomes are new, and what several looks mean."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.comparison.compare import Comparison
from vsnbench.results.looks import Looks, add_look, recorded_looks
from vsnbench.statistics.clustered import Outcomes

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
            looks = add_look(directory, identity, outcomes, episodes)
        except OSError as refused:
            problem = f"this look is not recorded: cannot write {directory}: {refused.strerror or refused}"
            looks = tuple((recorded_looks(directory, identity) | {outcomes: episodes}).values())
        found.append(replace(comparison, looks=looks))
    return tuple(found), problem


def looks_at(comparison: Comparison, directory: Path) -> Looks:
    """Return the recorded looks at a comparison; records none."""
    return tuple(recorded_looks(directory, _sha256([side[0] for side in _sides(comparison)])).values())


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
