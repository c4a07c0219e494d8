"""Checklist of what reviewers ask of an evaluation on robots, filled in from the record, as Markdown or LaTeX.

A ticked item is answered by the record. An open one says what is missing or what the authors must add.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from vsnbench import __version__
from vsnbench.protocol.disturbances import text_of_conditions
from vsnbench.protocol.execution import STOP_AND_GO, text_of_execution
from vsnbench.report.analysis.conditions import Condition, Selection
from vsnbench.report.analysis.courses import site_of
from vsnbench.report.analysis.episodes_frame import ReportData, goal_order
from vsnbench.report.analysis.summary import ConditionSummary, ReportResults, summarise
from vsnbench.report.build import read
from vsnbench.report.comparison.looks import looks_at
from vsnbench.report.comparison.question import ModelQuestion, questions
from vsnbench.report.formats import latex, markdown
from vsnbench.report.study.findings import StudyFindings, read_findings
from vsnbench.report.tables.success import SUMMARY
from vsnbench.report.wording import listed
from vsnbench.results.reading.read_model import VOID
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.second_judgements import second_judgements
from vsnbench.results.studies.queries import studies
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.study.file import parse_study
from vsnbench.text.sanitize import counted

_PRACTICE = "practice"
_LBM = "lbm"
_NAVIGATION = "navigation"
_PRECIPICE = "precipice"
_STEP = "step"
_CHECKLIST = "checklist"
REFERENCES = {
    _PRACTICE: "H. Kress-Gazit et al., Robot Learning as an Empirical Science: Best Practices for Policy "
    "Evaluation, arXiv:2409.09491, 2024.",
    _LBM: "TRI LBM Team, A Careful Examination of Large Behavior Models for Multitask Dexterous Manipulation, "
    "arXiv:2507.05331, 2025.",
    _NAVIGATION: "P. Anderson et al., On Evaluation of Embodied Navigation Agents, arXiv:1807.06757, 2018.",
    _PRECIPICE: "R. Agarwal et al., Deep Reinforcement Learning at the Edge of the Statistical Precipice, "
    "NeurIPS 2021, arXiv:2108.13264.",
    _STEP: "D. Snyder et al., Is Your Imitation Learning Policy Better than Mine? Policy Comparison with "
    "Near-Optimal Stopping, RSS 2025, arXiv:2503.10966.",
    _CHECKLIST: "J. Pineau et al., Improving Reproducibility in Machine Learning Research, JMLR 22(164), 2021.",
}
"""Papers that ask for the items, by the name that the items use."""
Item = tuple[str, bool, Sequence[str], Sequence[str]]
"""Heading, whether the record answers it, sentences, and names of `REFERENCES`."""


def checklist(url: str, selection: Selection, directory: Path, *, as_latex: bool) -> str:
    """Return the checklist of a part of a record.

    Args:
        url: SQLAlchemy URL.
        selection: part of the record.
        directory: the results directory, with the looks of `vsnbench compare`.
        as_latex: LaTeX instead of Markdown.

    Raises:
        RecordError: no record exists, it is empty or it cannot be read.
        UsageError: nothing in the record matches the selection.
        StudyError: the plan of a study in the record is invalid.
    """
    record = read(url, selection, directory)
    results = summarise(record)
    campaigns = {number for condition in record.conditions for number in condition.campaigns}
    with open_record(url) as engine:
        recorded = [study for study in studies(engine) if any(arm.campaign_id in campaigns for arm in study.arms)]
        with engine.connect() as connection:
            episodes = set(record.episodes["episode"].tolist())
            raters = {given.rater for given in second_judgements(connection) if given.episode in episodes}
    found = [read_findings(url, study, parse_study(study.content, study.title)) for study in recorded]
    in_study = {arm.campaign_id for study in recorded for arm in study.arms}
    asked = questions(record, results)
    items = [
        _conditions(results),
        _criteria(record),
        _models(results),
        _trials(results, record),
        _looks(found, asked, directory),
        _randomisation(found, outside=bool(campaigns - in_study)),
        _blinding(found, sorted(raters), outside=bool(campaigns - in_study)),
        _exclusions(results, found),
        _intervals(found, asked),
        _other_measures(results),
        _failures(results),
        _not_tested(record, results),
        _code(),
    ]
    return _latex(items) if as_latex else _markdown(items)


def _conditions(results: ReportResults) -> Item:
    conditions = [summary.condition for summary in results.conditions]
    words = [f"{condition.name}: {condition.description}" for condition in conditions]
    for sha256 in dict.fromkeys(condition.site_sha256 for condition in conditions):
        named = next(condition for condition in conditions if condition.site_sha256 == sha256)
        words.append(f"Site {named.site}: sha256 {sha256[:12]}; disturbances and noise as recorded per condition.")
    if any(not condition.simulated for condition in conditions):
        words.append("Add by hand: lighting, floor, people in the scene.")
    disturbed = {text_of_conditions(condition.conditions) for condition in conditions} - {""}
    words += [f"Disturbed on purpose: {text}." for text in sorted(disturbed)]
    return "Experimental conditions", True, words, (_PRACTICE, _LBM)


def _executed(condition: Condition) -> str:
    """Return the name of the protocol, and the execution if the robot does not rest between answers."""
    how = f" ({text_of_execution(condition.protocol)})" if condition.execution != STOP_AND_GO else ""
    return (condition.protocol_name or "unknown") + how


def _criteria(record: ReportData) -> Item:
    words = []
    for condition in {(known.protocol_name, known.execution): known for known in reversed(record.conditions)}.values():
        limits = [
            f"{limit:g} {unit}"
            for limit, unit in (
                (condition.max_actions, "actions"),
                (condition.max_time_s, "s"),
                (condition.max_path_m, "m of path"),
            )
            if limit is not None
        ]
        within = condition.success_distance_m
        near = f"under {within:g} m from the goal" if within is not None else "at the goal"
        words.append(
            f"Protocol {_executed(condition)}: success is STOP {near} without a collision, before the limit of "
            f"{listed(limits)}. The rules are in the record, and only equal ones are pooled."
        )
    return "Criteria of success", bool(record.conditions), words, (_PRACTICE, _NAVIGATION)


def _models(results: ReportResults) -> Item:
    words, whole = [], True
    for summary in results.conditions:
        condition = summary.condition
        weights = f"weights {condition.weights_sha256[:12]}" if condition.weights_sha256 else "no weights recorded"
        words.append(f"{condition.name}: {weights}; seeds {listed(condition.seeds)}.")
        whole &= bool(condition.weights_sha256 or condition.source or condition.surveyed or condition.driver)
    return "Models, weights and seeds", whole, words, (_CHECKLIST,)


def _trials(results: ReportResults, record: ReportData) -> Item:
    words = []
    for summary in results.conditions:
        total, starts = summary.total, [group.start for group in summary.starts if group.start]
        words.append(
            f"{summary.condition.name}: {total.episodes} of {counted(total.planned, 'planned trial')}; goals "
            f"{listed(summary.own_goals)}; {counted(len(starts), 'starting position')}; "
            f"{counted(len(total.outcomes.cells), 'cell')} (goal and starting position)."
        )
    whole = all(summary.total.episodes == summary.total.planned for summary in results.conditions)
    if not whole:
        words.append("Incomplete: say why trials are missing.")
    return "Number of trials", whole and bool(record.conditions), words, (_PRACTICE, _PRECIPICE)


def _looks(found: Sequence[StudyFindings], asked: Sequence[ModelQuestion], directory: Path) -> Item:
    words = []
    for study in found:
        primary = study.primary
        if primary.looks:
            words.append(
                f"{_named(study)}: planned looks after {listed(primary.looks)} starting positions; those "
                f"after {listed(primary.looked)} took place, with alpha shared among them."
            )
        else:
            rule = "after every unit, by bets that hold at every look" if study.plan.about else "once, after all trials"
            words.append(f"{_named(study)}: analysed {rule}.")
    several = False
    for question in asked:
        for comparison in question.comparisons:
            looks = looks_at(comparison, directory)
            several |= len(looks) > 1
            if looks:
                at = ", ".join(f"{first} : {second}" for first, second in looks)
                words.append(
                    f"{comparison.first.name} and {comparison.second.name} were compared outside of a plan "
                    f"{counted(len(looks), 'time')} with new results, at {at} episodes."
                )
    if several:
        words.append("Several unplanned looks: p-values and intervals are those of a single one, and err more often.")
    if not words:
        words.append("No look at a comparison is recorded.")
    words.append("Looks by other commands and programs are not counted.")
    return "Number of looks and stopping rule", not several, words, (_STEP, _PRACTICE)


def _randomisation(found: Sequence[StudyFindings], *, outside: bool) -> Item:
    orders = {
        "blocks": "every model once per goal and starting position, models and blocks in random order",
        "shuffled": "all trials in random order",
        "as-planned": "not randomised, model after model",
    }
    words = [
        f"{_named(study)}: {orders[study.plan.order]}, seed {study.plan.seed}, schedule drawn at the lock "
        f"on {study.recorded.locked_at:%Y-%m-%d}."
        for study in found
    ]
    if outside:
        words.append("Trials outside of a study: in the order of the command, not randomised.")
    randomised = not outside and all(study.plan.order != "as-planned" for study in found)
    return "Order of trials", bool(found) and randomised, words, (_PRACTICE, _LBM)


def _blinding(found: Sequence[StudyFindings], raters: Sequence[str], *, outside: bool) -> Item:
    words = []
    for study in found:
        recorded = study.recorded
        blind = "not blind" if not recorded.blind else "operators saw codes instead of models"
        if recorded.blind and recorded.unblinded_at is not None:
            blind += f" until {recorded.unblinded_at:%Y-%m-%d %H:%M} UTC"
        words.append(f"{_named(study)}: {blind}.")
    if outside:
        words.append("Trials outside of a study: not blind.")
    if raters:
        words.append(f"Episodes were judged again, blind, by {counted(len(raters), 'second rater')}.")
    blinded = not outside and bool(found) and all(study.recorded.blind for study in found)
    return "Blinding", blinded, words, (_PRACTICE, _LBM)


def _exclusions(results: ReportResults, found: Sequence[StudyFindings]) -> Item:
    words = []
    for summary in results.conditions:
        attempts = summary.total.attempts
        if attempts is None:
            continue
        void = attempts[attempts.state.of(VOID)]
        reasons = Counter(void.end_reason.names[number] for number in void.end_reason.numbers.tolist())
        why = ", ".join(f"{reason.replace('_', ' ')} {times}" for reason, times in sorted(reasons.items()))
        fields = SUMMARY.fields(summary.total)
        words.append(
            f"{summary.condition.name}: {counted(len(void), 'void attempt')}{f' ({why})' if why else ''}, repeated and "
            f"in no rate; {counted(fields['unjudged'], 'episode')} without a verdict; "
            f"{counted(fields['trivial'] or 0, 'trivial trial')} included."
        )
    words += [
        f"{_named(study)}: {deviation.what}: {deviation.words}" for study in found for deviation in study.deviations
    ]
    return "Exclusions and deviations, with reasons", True, words, (_CHECKLIST, _PRACTICE)


def _intervals(found: Sequence[StudyFindings], asked: Sequence[ModelQuestion]) -> Item:
    rates = "Rates: Wilson's 95 % interval at the effective sample size, clustered by starting position."
    apart = "Differences: Newcombe's interval, paired by cell, and sign flips of whole starting positions."
    words = [rates, apart]
    pairs = sum(len(question.pairs) for question in asked)
    if pairs > 1:
        words.append(f"{pairs} pairs of models: p-values after Holm, simultaneous intervals.")
    words += [f"{_named(study)}, primary analysis: {study.primary.method}." for study in found]
    return "Intervals and tests", True, words, (_PRECIPICE, _PRACTICE)


def _other_measures(results: ReportResults) -> Item:
    known = [
        name
        for name, key in (("SPL", "spl_episodes"), ("SoftSPL", "soft_spl_episodes"), ("progress", "progress_episodes"))
        if any(SUMMARY.fields(summary.total)[key] for summary in results.conditions)
    ]
    words = [f"Besides success: {listed([*known, 'number of actions', 'end reasons'])}."]
    return "Other measures than success", bool(known), words, (_PRACTICE, _NAVIGATION)


def _failures(results: ReportResults) -> Item:
    failed = sum(summary.total.episodes - summary.total.successes for summary in results.conditions)
    where = "`vsnbench report --table narrative` describes them by cause, with an example each"
    words = [f"{counted(failed, 'failed episode')}; {where}.", "Add what you saw."]
    return "Failures in words", True, words, (_PRACTICE,)


def _not_tested(record: ReportData, results: ReportResults) -> Item:
    words = list(_untested(record, results.conditions))
    words.append("Add the limits of your claims: other sites, robots, lighting, goals.")
    return "What was not tested", True, words, (_PRACTICE, _LBM)


def _untested(record: ReportData, summaries: Sequence[ConditionSummary]) -> Iterator[str]:
    for sha256 in dict.fromkeys(summary.condition.site_sha256 for summary in summaries):
        there = [summary for summary in summaries if summary.condition.site_sha256 == sha256]
        condition = there[0].condition
        site = site_of(record, condition)
        if site is None:
            yield f"Site {condition.site}: its file is not in the record, so what was left out is unknown."
            continue
        possible = {str(goal.id) for goal in site.goals} | {name for name in GOAL_CATEGORIES if name in site.categories}
        untried = sorted(possible.difference(*(summary.own_goals for summary in there)), key=goal_order)
        starts = {group.start for summary in there for group in summary.starts}
        left = [start.number for start in site.starts if start.number not in starts]
        yield (
            f"Site {condition.site}: goals without a trial: {listed(untried)}; "
            f"starting positions without a trial: {listed(left)}."
        )
    missing = [
        f"{summary.condition.name} {summary.total.planned - summary.total.episodes}"
        for summary in summaries
        if summary.total.episodes < summary.total.planned
    ]
    if missing:
        yield f"Planned trials without a result: {listed(missing)}."


def _code() -> Item:
    words = [
        f"Evaluated with vsnbench {__version__}.",
        "`vsnbench bundle` packs record, images and hashes for others to verify.",
        "Add where the bundle and the weights are published.",
    ]
    return "Data and code", False, words, (_CHECKLIST,)


def _named(study: StudyFindings) -> str:
    return f'Study "{study.recorded.title}"'


def _numbers(items: Sequence[Item]) -> dict[str, int]:
    """Return the numbers of the references that the items cite, in order."""
    cited = dict.fromkeys(name for _, _, _, sources in items for name in sources)
    return {name: number for number, name in enumerate(cited, start=1)}


def _markdown(items: Sequence[Item]) -> str:
    numbers = _numbers(items)
    lines = ["# Checklist of the evaluation", ""]
    for heading, answered, words, sources in items:
        cited = ", ".join(str(numbers[name]) for name in sources)
        lines.append(f"- [{'x' if answered else ' '}] **{heading}** [{cited}]")
        lines += [f"  - {markdown.escaped(sentence)}" for sentence in words]
    lines += ["", "## References", ""]
    return "\n".join([*lines, *(f"{number}. {REFERENCES[name]}" for name, number in numbers.items()), ""])


def _latex(items: Sequence[Item]) -> str:
    numbers = _numbers(items)
    lines = [r"% \usepackage[T1]{fontenc}", r"\begin{description}"]
    for heading, answered, words, sources in items:
        cited = ", ".join(str(numbers[name]) for name in sources)
        mark = "answered" if answered else "open"
        lines.append(rf"\item[{{{latex.escaped(heading)} ({mark}) [{cited}]}}]")
        lines.append(" ".join(latex.breakable(sentence) for sentence in words))
    lines += [r"\end{description}", r"\begin{enumerate}"]
    lines += [rf"\item {latex.escaped(REFERENCES[name])}" for name in numbers]
    return "\n".join([*lines, r"\end{enumerate}", ""])
