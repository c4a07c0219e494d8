"""Success, oracle success and progress of sequences, and of their goals by position."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

from sqlalchemy import Engine, select

from vsnbench.protocol.metrics import spl
from vsnbench.report.analysis.activity import Rows
from vsnbench.report.analysis.conditions import Condition
from vsnbench.report.analysis.courses import course_map, oracle_of_legs, oracle_of_sequence
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.reading import read_courses
from vsnbench.results.reading.read_model import COUNTS
from vsnbench.results.schema.engine import record_errors
from vsnbench.results.schema.tables import EpisodeRow, GoalRow, TrialRow
from vsnbench.results.writing.entries import SequenceLeg
from vsnbench.statistics.rates import Proportion
from vsnbench.values.goal import GoalKind

_PART = 100
"""Courses in memory at a time."""
_Given = tuple[SequenceLeg, bool | None]
"""A goal that was given, and whether STOP would have succeeded on the way; None if that is unknown."""
_Known = tuple[tuple[_Given, ...], int, bool, bool | None]
"""The given goals of an episode, the number of goals of its sequence, success and oracle success."""


def read_legs(engine: Engine, record: ReportData) -> Rows:
    """Return success by position in the sequence, then of whole sequences, for each condition that has some.

    A goal that was not given, because a collision had ended the episode, is a failure.
    """
    rows: list[dict[str, Any]] = []
    for condition in record.conditions:
        known = list(_known(engine, record, condition))
        for position in range(1, max((goals for _, goals, _, _ in known), default=0) + 1):
            given = [legs[position - 1 : position] for legs, goals, _, _ in known if goals >= position]
            rows.append({"condition": condition.number, "position": position, "progress": None, **_of_legs(given)})
        if known:
            each, _, successes, oracle = zip(*known, strict=True)
            whole = _of_legs(each, successes, oracle)
            reached = [sum(leg.success is True for leg, _ in legs) / goals for legs, goals, _, _ in known]
            whole["progress"] = math.fsum(reached) / len(reached)
            rows.append({"condition": condition.number, "position": None, **whole})
    return tuple(rows)


def _known(engine: Engine, record: ReportData, condition: Condition) -> Iterator[_Known]:
    """Yield the counted sequences of a condition."""
    counted = record.counted(condition)
    verdicts = dict(zip(counted["episode"].tolist(), counted["success"].tolist(), strict=True))
    query = select(EpisodeRow.id, EpisodeRow.legs, GoalRow.content).join(TrialRow, TrialRow.id == EpisodeRow.trial_id)
    query = query.join(GoalRow, GoalRow.id == TrialRow.goal_id).where(COUNTS, GoalRow.kind == GoalKind.SEQUENCE.value)
    with record_errors(engine), engine.connect() as connection:
        found = [row for row in connection.execute(query.order_by(EpisodeRow.id)) if row.id in verdicts]
    ground = course_map(engine, record, condition) if found else None
    for first in range(0, len(found), _PART):
        part = found[first : first + _PART]
        courses = read_courses(engine, [row.id for row in part])
        for row in part:
            legs = tuple(SequenceLeg(**leg) for leg in row.legs or ())
            oracle, goals, success = (
                oracle_of_legs(ground, courses.get(row.id)),
                len(row.content["goals"]),
                verdicts[row.id],
            )
            given = tuple(zip(legs, oracle or (None,) * len(legs), strict=True))
            yield given, goals, bool(success), True if success else oracle_of_sequence(oracle, goals)


def _of_legs(
    several: Sequence[Sequence[_Given]],
    successes: Sequence[bool] | None = None,
    oracle: Sequence[bool | None] | None = None,
) -> dict[str, Any]:
    """Return rates, SPL and actions of parts of sequences; a part succeeds if its one leg does, unless stated."""
    successes = successes or [all(leg.success for leg, _ in legs) and bool(legs) for legs in several]
    oracle = oracle or [legs[0][1] if legs else False for legs in several]
    known = [flag for flag in oracle if flag is not None]
    weighted = [_spl_of(legs, success=success) for legs, success in zip(several, successes, strict=True)]
    given = [leg for legs in several for leg, _ in legs]
    sequences = sum(bool(legs) for legs in several)
    return {
        "rate": Proportion(sum(successes), len(several)),
        "mean_oracle_success": sum(known) / len(known) if known else math.nan,
        "given": sequences,
        "spl": math.fsum(weighted) / len(weighted),
        "mean_actions": sum(leg.actions for leg in given) / sequences if given else math.nan,
        "memory": all(leg.memory for leg in given),
    }


def _spl_of(legs: Sequence[_Given], *, success: bool) -> float:
    shortest = [leg.shortest_m for leg, _ in legs]
    if not success:
        return 0.0
    lengths = [length for length in shortest if length is not None]
    path_m = math.fsum(leg.path_m for leg, _ in legs)
    return spl(success, math.fsum(lengths), path_m) if None not in shortest else math.nan
