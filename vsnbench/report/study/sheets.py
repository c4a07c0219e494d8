"""The tables of a study's report: the primary analysis first, everything after it marked exploratory."""

import math
from collections.abc import Sequence

from vsnbench.database.study_entries import StudyTrialStanding
from vsnbench.report.record import goal_order
from vsnbench.report.sheets import UNKNOWN, Cell, Column, Row, Sheet, count, of, percent, row, word
from vsnbench.report.study.findings import StudyFindings
from vsnbench.report.study.primary import Answer
from vsnbench.report.verdicts import compared
from vsnbench.statistics.drift import Trend, trend
from vsnbench.study.file import Rate

EXPLORATORY = "Exploratory: "


def study_sheets(found: StudyFindings) -> list[Sheet]:
    """Return every table in the order in which they are read."""
    sheets = [_primary(found), _plan(found), _conduct(found)]
    if found.deviations:
        sheets.append(_deviations(found))
    return [*sheets, _by_goal(found), _drift(found)]


def _primary(found: StudyFindings) -> Sheet:
    versus = isinstance(found.plan.primary, Rate)
    columns = (
        Column("question", number=False),
        Column("answer", number=False),
        Column("cells"),
        Column("successes"),
        Column("rate" if versus else "difference"),
        Column("interval"),
        Column("p", note="two-sided, adjusted for all pairs"),
    )
    rows = tuple(_answer_row(found, one) for one in found.primary.answers)
    notes = [
        f"{found.primary.method}. It speaks of {found.primary.about}.",
        f"Alpha {found.plan.alpha:g} for all pairs together, margin {100 * found.plan.margin:g} points of success.",
    ]
    if found.primary.over:
        notes.append(f"The study is over: {found.primary.over}.")
    for arm, block in found.primary.dropped.items():
        notes.append(f"{found.shown[arm]} was beaten, and dropped after {block} blocks.")
    bounds = [found.shown[arm.name] for arm in found.recorded.arms if arm.surveyed and not found.recorded.is_blind]
    if bounds:
        notes.append(f"{', '.join(bounds)}: handed the site, an upper bound and no competitor.")
    return Sheet("primary", "Primary analysis", columns, rows, tuple(notes))


def _answer_row(found: StudyFindings, one: Answer) -> Row:
    shown = found.shown
    known = math.isfinite(one.difference)
    if one.second is None:
        rate = found.plan.primary.rate if isinstance(found.plan.primary, Rate) else 0.5
        question = f"{shown[one.first]} against {rate:.0%}"
        k = str(one.successes[0])
        answer = "above" if one.winner else "below" if one.loser == one.first and not one.counted else "not shown"
    else:
        question = f"{shown[one.first]} – {shown[one.second]}"
        k = f"{one.successes[0]} : {one.successes[1]}"
        answer = f"{shown[one.winner]} better" if one.winner else "counted only" if one.counted else "not shown"
    sign = "" if one.second is None else "+"
    return row(
        word(question),
        word("open" if one.open else answer),
        count(one.cells),
        word(k),
        word(f"{100 * one.difference:{sign}.1f}" if known else UNKNOWN),
        word(f"[{100 * one.low:{sign}.1f}, {100 * one.high:{sign}.1f}]" if known else UNKNOWN),
        Cell(_p(one.p), one.p if one.p is not None else -1.0),
    )


def _p(value: float | None) -> str:
    if value is None:
        return UNKNOWN
    return "< 0.0001" if value < 0.0001 else f"{value:.4f}"


def _plan(found: StudyFindings) -> Sheet:
    recorded, plan = found.recorded, found.plan
    arms = list(found.shown.items())
    beside = [*(["with noise"] if plan.noise else []), *(["a rehearsal"] if plan.pretend_real else [])]
    facts = [
        ("locked", f"{recorded.locked_at:%Y-%m-%d %H:%M} UTC"),
        ("sha256 of the plan", recorded.locked_sha256),
        *([("sha256 as amended", recorded.sha256)] if recorded.sha256 != recorded.locked_sha256 else []),
        ("schedule", f"{plan.order}, seed {plan.seed}, sha256 {recorded.schedule_sha256[:16]}"),
        ("arms", ", ".join(sorted(name for _, name in arms))),
        ("shared goals", ", ".join(plan.goals)),
        ("starting positions", plan.starting_positions or "all of the site's"),
        ("repetitions", str(plan.repetitions)),
        ("site, robot", ", ".join([plan.site, plan.robot, *beside])),
        ("stopping", plan.stopping),
        ("blind", "yes" if recorded.is_blind else "no longer" if recorded.blind else "no"),
    ]
    columns = (Column("what was locked", number=False), Column("", number=False))
    return Sheet("plan", "The locked plan", columns, tuple(row(word(a), word(b)) for a, b in facts))


def _conduct(found: StudyFindings) -> Sheet:
    columns = tuple(
        Column(name, number=name != "arm") for name in ("arm", "planned", "done", "left", "awaiting", "void attempts")
    )
    rows = []
    for arm in found.recorded.arms:
        own = found.of(arm.name)
        rows.append(
            row(
                word(found.shown[arm.name]),
                count(len(own)),
                count(sum(one.done for one in own)),
                count(sum(one.left for one in own)),
                count(sum(one.done and one.success is None for one in own)),
                count(sum(one.voids for one in own)),
            )
        )
    return Sheet("conduct", "What was run of what was planned", columns, tuple(rows))


def _deviations(found: StudyFindings) -> Sheet:
    columns = (Column("deviation", number=False), Column("what happened", number=False))
    rows = tuple(row(word(one.what), word(one.words)) for one in found.deviations)
    return Sheet("deviations", "Deviations from the plan", columns, rows)


def _by_goal(found: StudyFindings) -> Sheet:
    goals = sorted({one.trial.goal for one in found.standing}, key=goal_order)
    columns = (Column("arm", number=False), *(Column(goal) for goal in goals), Column("shared goals"))
    rows = []
    for arm in found.recorded.arms:
        own = [one for one in found.of(arm.name) if one.success is not None]
        cells = [_share([one for one in own if one.trial.goal == goal]) for goal in goals]
        rows.append(
            row(word(found.shown[arm.name]), *cells, _share([one for one in own if one.trial.goal in found.plan.goals]))
        )
    note = "Successes of trials judged. Not asked beforehand: it suggests the next study, and proves nothing."
    return Sheet("by-goal", f"{EXPLORATORY}success by goal", columns, tuple(rows), (note,))


def _drift(found: StudyFindings) -> Sheet:
    done = sorted(
        (one for one in found.standing if one.success is not None and one.started_at is not None),
        key=lambda one: str(one.started_at),
    )
    half = (len(done) + 1) // 2
    parts = [("first half", done[:half]), ("second half", done[half:])]
    for operator in sorted({one.operator for one in done}):
        parts += [(f"run by {operator}", [one for one in done if one.operator == operator])]
    columns = (Column("trials", number=False), Column("successes"), Column("SR %"))
    rows = tuple(row(word(name), _share(own), percent(_rate(own), 1)) for name, own in parts)
    over_time = _over_time(done)
    how = "exact" if over_time.exact else "by the normal distribution"
    note = f"Time, arm for arm and goal for goal: p {compared(over_time.p)}, {how}. Not asked beforehand."
    return Sheet("drift", f"{EXPLORATORY}success over time and by operator, all arms", columns, rows, (note,))


def _over_time(done: Sequence[StudyTrialStanding]) -> Trend:
    """Return what is to be said of success and time having nothing to do with each other."""
    strata: dict[tuple[str, str], list[bool]] = {}
    for one in done:
        strata.setdefault((one.arm, one.trial.goal), []).append(bool(one.success))
    return trend(list(strata.values()))


def _share(own: Sequence[StudyTrialStanding]) -> Cell:
    return of(sum(bool(one.success) for one in own), len(own))


def _rate(own: Sequence[StudyTrialStanding]) -> float:
    return sum(bool(one.success) for one in own) / len(own) if own else math.nan
