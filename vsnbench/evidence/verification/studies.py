"""Verifies the studies of a record: lock, schedule, log, and the decisions to stop."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime

from sqlalchemy import select

from vsnbench.evidence.verification.checks import Check, Finding, Progress, finding
from vsnbench.evidence.verification.record import VerifiedRecord
from vsnbench.results.schema.tables import VerdictRow
from vsnbench.results.studies.entries import OVER, RecordedStudy, StudyTrialProgress
from vsnbench.results.studies.evidence import read_evidence
from vsnbench.results.studies.queries import studies, trials_of
from vsnbench.runner.study.integrity import check_integrity
from vsnbench.study.decision import StoppingDecision
from vsnbench.study.file import StudyFile, parse_study
from vsnbench.study.lock import LockNote
from vsnbench.study.stopping import decide
from vsnbench.study.units import shared_blocks


def check_studies(record: VerifiedRecord, note: LockNote | None, progress: Progress) -> Check:
    """Compare each study with its lock, its log and its random draw, and make its decisions again."""
    check = Check("studies", "studies")
    with check.failing("the studies"):
        known = studies(record.engine)
        for done, recorded in enumerate(known, start=1):
            with check.failing(f"study {recorded.id}"):
                _check_study(record, recorded, note, check)
            progress("checking studies", done, len(known))
    return check


def _check_study(record: VerifiedRecord, recorded: RecordedStudy, note: LockNote | None, check: Check) -> None:
    where = f"study {recorded.id}"
    plan = parse_study(recorded.content, f"the plan of {where}")
    found = check_integrity(recorded, read_evidence(record.engine, recorded.id), plan, note)
    for remark in found.remarks:
        check.skip(remark)
    findings = [finding(where, difference) for difference in found.differences]
    check.add([*findings, *_stopping(record, recorded, plan, trials_of(record.engine, recorded.id))])


def _stopping(
    record: VerifiedRecord, recorded: RecordedStudy, plan: StudyFile, trials: Sequence[StudyTrialProgress]
) -> Iterator[Finding]:
    """Decide again before each trial, from the results of that time, whether it was needed."""
    if plan.stopping != "decided":
        return
    where, judged = f"study {recorded.id}", _first_judgements(record, trials)
    begun = sorted((trial for trial in trials if trial.started_at is not None), key=lambda trial: str(trial.started_at))
    known, decision = -1, StoppingDecision((), {}, "")
    for trial in begun:
        before = [at for at in judged.values() if trial.started_at is not None and at <= trial.started_at]
        if len(before) != known:
            known, decision = len(before), _decision_at(plan, trials, judged, trial.started_at)
        if decision.over:
            yield finding(where, f"trial {trial.rank + 1} began after the study was over ({decision.over})")
        elif trial.arm in decision.dropped:
            yield finding(where, f"trial {trial.rank + 1} of {recorded.shown(trial.arm)} began after it was dropped")
    final = _decision_at(plan, trials, judged, None)
    stated = [entry.text for entry in recorded.entries if entry.kind == OVER]
    if stated and stated[-1] != final.over:
        yield finding(where, f"it ended because {stated[-1]!r}; its results give {final.over or 'no end'!r}")


def _decision_at(
    plan: StudyFile, trials: Sequence[StudyTrialProgress], judged: dict[int, datetime], moment: datetime | None
) -> StoppingDecision:
    """Decide from the results that were judged at a moment; None for all."""
    known = [
        trial
        if trial.episode_id in judged and (moment is None or judged[trial.episode_id] <= moment)
        else replace(trial, success=None)
        for trial in trials
    ]
    return decide(plan, shared_blocks(known, plan.goals))


def _first_judgements(record: VerifiedRecord, trials: Sequence[StudyTrialProgress]) -> dict[int, datetime]:
    """Return the time of the current judgement of each episode that counts."""
    numbers = {trial.episode_id for trial in trials if trial.success is not None}
    query = (
        select(VerdictRow.episode_id, VerdictRow.created_at)
        .where(VerdictRow.proposed.is_(False))
        .order_by(VerdictRow.id)
    )
    return {number: at for number, at in record.connection.execute(query) if number in numbers}
