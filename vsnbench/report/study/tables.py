"""Tables of a study's report: primary analysis first, then tables marked as exploratory."""

import math
from collections.abc import Sequence

from vsnbench.report.analysis.episodes_frame import goal_order
from vsnbench.report.analysis.summary import goal_title
from vsnbench.report.study.findings import StudyFindings
from vsnbench.report.study.primary import PrimaryAnswer
from vsnbench.report.table import UNKNOWN, Column, ReportTable, Row, TableCell, of, percent, row
from vsnbench.report.wording import compared
from vsnbench.results.studies.entries import StudyTrialProgress
from vsnbench.statistics.clustered import MIN_UNITS
from vsnbench.statistics.conclusion import Conclusion
from vsnbench.statistics.drift import Trend, trend
from vsnbench.statistics.rates import Interval
from vsnbench.study.file import Rate
from vsnbench.text.sanitize import counted
from vsnbench.values.goal import GoalKind

EXPLORATORY = "Exploratory: "


def study_tables(found: StudyFindings) -> list[ReportTable]:
    """Return the tables in reading order."""
    tables = [_primary(found), _plan(found), _conduct(found)]
    if found.deviations:
        tables.append(_deviations(found))
    return [*tables, _by_goal(found), _drift(found)]


def _primary(found: StudyFindings) -> ReportTable:
    versus = isinstance(found.plan.primary, Rate)
    columns = (
        Column("question", number=False),
        Column("answer", number=False),
        Column("cells", note="combinations of goal and starting position"),
        Column("trials", note="per arm: cells x repetitions"),
        Column("successes"),
        Column("rate" if versus else "progress, points" if found.plan.of_progress else "difference"),
        Column("interval"),
        Column("p", note=f"{'of the question' if found.plan.of_margin else 'two-sided'}, adjusted for all pairs"),
    )
    rows = tuple(_answer_row(found, answer) for answer in found.primary.answers)
    notes = [
        f"{found.primary.method}. The inference is about {found.primary.about}.",
        f"Alpha {found.plan.alpha:g} over all pairs, margin {100 * found.plan.margin:g} points.",
    ]
    if any(answer.cells and not Interval(answer.low, answer.high).known for answer in found.primary.answers):
        notes.append(f"An interval needs {MIN_UNITS} starting positions; no test of fewer can show a difference.")
    if found.primary.looks:
        looked = ", ".join(str(look) for look in found.primary.looked) or "none yet"
        planned = ", ".join(str(look) for look in found.primary.looks)
        notes.append(f"Looks after complete starting positions: {looked}; planned {planned}.")
    if found.primary.over:
        notes.append(f"The study is over: {found.primary.over}.")
    for arm, block in found.primary.dropped.items():
        behind = "behind in these trials" if found.plan.of_these_cells else "worse"
        notes.append(f"{found.shown[arm]} was {behind} and dropped after {counted(block, found.primary.unit)}.")
    bounds = [found.shown[arm.name] for arm in found.recorded.arms if arm.surveyed and not found.recorded.is_blind]
    if bounds:
        notes.append(f"{', '.join(bounds)}: access to the site file, an upper bound and not a competitor.")
    return ReportTable("primary", "Primary analysis", columns, rows, tuple(notes))


def _answer_row(found: StudyFindings, result: PrimaryAnswer) -> Row:
    shown = found.shown
    known = math.isfinite(result.difference)
    has_interval = Interval(result.low, result.high).known
    if result.second is None:
        rate = found.plan.primary.rate if isinstance(found.plan.primary, Rate) else 0.5
        question = f"{shown[result.first]} against {rate:.0%}"
        k = str(result.successes[0])
        answer = "above" if result.winner else "below" if result.loser else "not shown"
    else:
        question = f"{shown[result.first]} – {shown[result.second]}"
        k = f"{result.successes[0]} : {result.successes[1]}"
        better = "more progress" if result.means else "ahead" if found.plan.of_these_cells else "better"
        undecided = "counted only" if result.counted else "not shown"
        answer = f"{shown[result.winner]} {better}" if result.winner else undecided
        if result.conclusion in (Conclusion.EQUIVALENT, Conclusion.NOT_INFERIOR):
            answer = f"{result.conclusion.value} within {100 * found.plan.margin:g} points"
    sign = "" if result.second is None else "+"
    return row(
        question,
        "open" if result.open else answer,
        result.cells,
        result.trials,
        k,
        f"{100 * result.difference:{sign}.1f}" if known else UNKNOWN,
        f"[{100 * result.low:{sign}.1f}, {100 * result.high:{sign}.1f}]" if known and has_interval else UNKNOWN,
        TableCell(_p(result.p if has_interval else None), result.p if result.p is not None else -1.0),
    )


def _p(value: float | None) -> str:
    if value is None:
        return UNKNOWN
    return "< 0.0001" if value < 0.0001 else f"{value:.4f}"


def _plan(found: StudyFindings) -> ReportTable:
    recorded, plan = found.recorded, found.plan
    arms = list(found.shown.items())
    environment = [*(["with noise"] if plan.noise else []), *(["a rehearsal"] if plan.rehearse else [])]
    facts = [
        ("locked", f"{recorded.locked_at:%Y-%m-%d %H:%M} UTC"),
        ("sha256 of the plan", recorded.locked_sha256),
        *([("sha256 as amended", recorded.sha256)] if recorded.sha256 != recorded.locked_sha256 else []),
        ("schedule", f"{plan.order}, seed {plan.seed}, sha256 {recorded.schedule_sha256[:16]}"),
        ("arms", ", ".join(sorted(name for _, name in arms))),
        ("shared goals", ", ".join(plan.goals)),
        ("starting positions", plan.starting_positions or "all of the site's"),
        ("repetitions", str(plan.repetitions)),
        ("site, robot", ", ".join([plan.site, plan.robot, *environment])),
        ("stopping", plan.stopping),
        *([("test", "sign-flips" if plan.by_looks else "bets")] if plan.stopping == "decided" else []),
        ("blind", "yes" if recorded.is_blind else "no longer" if recorded.blind else "no"),
    ]
    columns = (Column("field", number=False), Column("value", number=False))
    return ReportTable("plan", "Locked plan", columns, tuple(row(a, b) for a, b in facts))


def _conduct(found: StudyFindings) -> ReportTable:
    columns = tuple(
        Column(name, number=name != "arm") for name in ("arm", "planned", "done", "left", "awaiting", "void attempts")
    )
    rows = []
    for arm in found.recorded.arms:
        own = found.of(arm.name)
        rows.append(
            row(
                found.shown[arm.name],
                len(own),
                sum(trial.done for trial in own),
                sum(trial.left for trial in own),
                sum(trial.done and trial.success is None for trial in own),
                sum(trial.voids for trial in own),
            )
        )
    return ReportTable("conduct", "Completed and remaining trials", columns, tuple(rows))


def _deviations(found: StudyFindings) -> ReportTable:
    columns = (Column("deviation", number=False), Column("description", number=False))
    rows = tuple(row(deviation.what, deviation.words) for deviation in found.deviations)
    return ReportTable("deviations", "Deviations from the plan", columns, rows)


def _by_goal(found: StudyFindings) -> ReportTable:
    goals = sorted({trial.trial.goal for trial in found.progress}, key=goal_order)
    titles = [goal_title(goal, found.goal_kinds.get(goal, GoalKind.CATEGORY)) for goal in goals]
    columns = (Column("arm", number=False), *(Column(title) for title in titles), Column("shared goals"))
    rows = []
    for arm in found.recorded.arms:
        own = [trial for trial in found.of(arm.name) if trial.success is not None]
        cells = [_share([trial for trial in own if trial.trial.goal == goal]) for goal in goals]
        rows.append(
            row(
                found.shown[arm.name],
                *cells,
                _share([trial for trial in own if trial.trial.goal in found.plan.goals]),
            )
        )
    note = "Successes of judged trials. Not planned in advance: suitable for hypotheses only."
    return ReportTable("by-goal", f"{EXPLORATORY}success by goal", columns, tuple(rows), (note,))


def _drift(found: StudyFindings) -> ReportTable:
    done = sorted(
        (trial for trial in found.progress if trial.success is not None and trial.started_at is not None),
        key=lambda trial: str(trial.started_at),
    )
    half = (len(done) + 1) // 2
    parts = [("first half", done[:half]), ("second half", done[half:])]
    for operator in sorted({trial.operator for trial in done}):
        parts += [(f"run by {operator}", [trial for trial in done if trial.operator == operator])]
    columns = (Column("trials", number=False), Column("successes"), Column("SR %"))
    rows = tuple(row(name, _share(own), percent(_rate(own), 1)) for name, own in parts)
    over_time = _over_time(done)
    how = "exact" if over_time.exact else "normal approximation"
    note = f"Trend with time, stratified by arm and goal: p {compared(over_time.p)}, {how}. Not planned in advance."
    return ReportTable("drift", f"{EXPLORATORY}success over time and by operator, all arms", columns, rows, (note,))


def _over_time(done: Sequence[StudyTrialProgress]) -> Trend:
    """Return the test of a trend of success with time."""
    strata: dict[tuple[str, str], list[bool]] = {}
    for trial in done:
        strata.setdefault((trial.arm, trial.trial.goal), []).append(bool(trial.success))
    return trend(list(strata.values()))


def _share(own: Sequence[StudyTrialProgress]) -> TableCell:
    return of(sum(bool(trial.success) for trial in own), len(own))


def _rate(own: Sequence[StudyTrialProgress]) -> float:
    return sum(bool(trial.success) for trial in own) / len(own) if own else math.nan
