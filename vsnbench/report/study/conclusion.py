"""Conclusion of a study as one sentence; only the primary test names a better arm.

A study about these cells says which arm succeeded more often in its trials, never that it is better: the outcomes of
its trials are the whole population, with the chance in them. The sentence about progress never calls an arm better and
never speaks of success as if it had been compared: more progress means that the robot came nearer to its goals.
"""

from collections.abc import Mapping

from vsnbench.report.study.primary import Primary, PrimaryAnswer
from vsnbench.report.wording import caution, compared, interval_words, trial_count
from vsnbench.statistics.conclusion import Conclusion
from vsnbench.statistics.rates import Interval
from vsnbench.study.file import Rate, StudyFile
from vsnbench.text.sanitize import counted

IN_THESE = "in this plan's trials"
ONLY_THESE = "whether a model is better is not shown: where outcomes vary within a cell, equal models differ by chance"
"""What a study about these cells does not show."""


def conclusion(study: StudyFile, primary: Primary, shown: Mapping[str, str], changed_after: int | None) -> str:
    """Return the study's conclusion.

    Args:
        study: the plan.
        primary: its analysis.
        shown: displayed names of the arms.
        changed_after: number of results when the judging was changed; None if it was not.
    """
    where = IN_THESE if study.of_these_cells else "on the shared goals"
    sentences = [_sentence(study, answer, shown, where) for answer in primary.answers if not answer.open]
    waiting = sum(answer.open for answer in primary.answers)
    if waiting:
        least = min((answer for answer in primary.answers if answer.open), key=lambda answer: answer.trials)
        done = f"{least.trials} of {trial_count(primary.trials, primary.cells)}"
        if study.by_starting_position:
            done = f"{least.units} of {counted(primary.planned_units, primary.unit)}"
        if study.by_looks:
            coming = next((look for look in primary.looks if look > least.units), primary.planned_units)
            done = f"the next look is after {coming} of {counted(primary.planned_units, primary.unit)}"
        about = f"about {waiting} of the pairs " if sentences else ""
        both = "" if study.by_looks else " are done" if study.primary.kind == "rate" else " are done by both"
        sentences.append(f"no conclusion {about}yet: {done}{both}")
    if study.of_these_cells and any(answer.winner or answer.loser for answer in primary.answers):
        sentences.append(ONLY_THESE)
    words = "; ".join(sentences)
    if changed_after is not None:
        words += f" (the analysis was changed after {changed_after} results)"
    if not any(words.startswith(f"{name} ") for name in shown):  # an arm's name keeps its spelling
        words = words[:1].upper() + words[1:]
    return f"{words}."


def _sentence(study: StudyFile, answer: PrimaryAnswer, shown: Mapping[str, str], where: str) -> str:
    k, m = answer.successes
    if not answer.cells:
        return f"no data for {' and '.join(shown[arm] for arm in (answer.first, answer.second) if arm)}"
    tried = trial_count(answer.trials, answer.cells)
    if answer.second is None:
        rate = study.primary.rate if isinstance(study.primary, Rate) else 0.5
        text = f"{shown[answer.first]} succeeds in {k} of {tried} [{answer.low:.0%}, {answer.high:.0%}]"
        if answer.winner:
            return f"{text} {where}, {'more' if study.of_these_cells else 'better'} than {rate:.0%}"
        if answer.loser:
            return f"{text} {where}, less than {rate:.0%}"
        return f"{text} {where}: neither above nor below {rate:.0%} was shown"
    if study.of_margin:
        return _of_margin(study, answer, shown, f"{k} and {m} of {tried}", where)
    if answer.means is not None:
        return _of_progress(study, answer, shown, f"{k} against {m} of {tried}", where)
    if answer.winner:
        ahead, behind = (k, m) if answer.winner == answer.first else (m, k)
        better, worse = shown[answer.winner], shown[answer.loser or ""]
        claim = "succeeded more often" if study.of_these_cells else "is better"
        return f"{better} {claim} than {worse} {where}: {ahead} against {behind} of {tried}"
    named = f"{shown[answer.first]} and {shown[answer.second]}"
    if answer.counted:
        return (
            f"{named} succeeded in {k} and {m} of {tried}; the remaining trials cannot reverse this lead, but no test "
            "showed a difference"
        )
    seen = f"{100 * answer.difference:+.0f} points {interval_words(Interval(answer.low, answer.high))}"
    return (
        f"no difference was shown between {named} {where} ({seen}{_doubt(study, answer)}); "
        "this does not show that they are equal"
    )


def _of_margin(study: StudyFile, answer: PrimaryAnswer, shown: Mapping[str, str], successes: str, where: str) -> str:
    """Return the answer of equivalence or non-inferiority; it never says more than the margin allows."""
    first, second = shown[answer.first], shown[answer.second or ""]
    points, what = f"{100 * study.margin:g} points", "progress" if study.of_progress else "success"
    seen = f"{100 * answer.difference:+.0f} points {interval_words(Interval(answer.low, answer.high))}; {successes}"
    if answer.conclusion is Conclusion.EQUIVALENT:
        return f"{first} and {second} differ by less than {points} in {what} {where} ({seen})"
    if answer.conclusion is Conclusion.NOT_INFERIOR:
        return f"{first} is at most {points} worse than {second} in {what} {where} ({seen})"
    if study.primary.kind == "equivalence":
        return f"it was not shown that {first} and {second} differ by less than {points} in {what} {where} ({seen})"
    return f"it was not shown that {first} is at most {points} worse than {second} in {what} {where} ({seen})"


def _of_progress(study: StudyFile, answer: PrimaryAnswer, shown: Mapping[str, str], successes: str, where: str) -> str:
    first, second = shown[answer.first], shown[answer.second or ""]
    mine, theirs = answer.means or (0.0, 0.0)
    seen = f"{100 * (mine - theirs):+.0f} points {interval_words(Interval(answer.low, answer.high))}"
    success = f"success was not compared: {successes}"
    if answer.winner:
        nearer, other = shown[answer.winner], shown[answer.loser or ""]
        numbers = sorted((mine, theirs), reverse=True)
        makes = "made" if study.of_these_cells else "makes"
        return (
            f"{nearer} {makes} more progress than {other} {where}: {numbers[0]:.0%} against {numbers[1]:.0%} of the "
            f"way on average ({first} - {second}: {seen}); {success}"
        )
    if answer.counted:
        return (
            f"{first} and {second} covered {mine:.0%} and {theirs:.0%} of the way; the remaining trials cannot reverse "
            f"this lead, but no test showed a difference in progress; {success}"
        )
    return (
        f"no difference in progress was shown between {first} and {second} {where} ({seen}{_doubt(study, answer)}); "
        f"this does not show that they are equal; {success}"
    )


def _doubt(study: StudyFile, answer: PrimaryAnswer) -> str:
    """Return why no winner is named if only the test or only the interval would name one."""
    if not (doubt := caution(answer.conclusion, study.margin)):
        return ""
    return f"; {doubt}" + (f", p {compared(answer.p)}" if answer.p is not None else "")
