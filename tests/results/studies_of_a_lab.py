"""A small study of two arms, locked in a record, and trials of it."""

import hashlib
from dataclasses import replace

from tests.results.records_of_a_lab import plan, run, stopped
from vsnbench.protocol.scheduled_trial import ScheduledTrial
from vsnbench.results.studies.entries import LockedArm, RecordedStudy, StudyChange, StudyLock
from vsnbench.results.writing.campaigns import CampaignPlan
from vsnbench.results.writing.journal import Journal

CONTENT = "title: Which?\n"


def hash_of(content: str) -> str:
    return hashlib.sha256(content.encode()).hexdigest()


def lock(journal: Journal, *, seed: int = 3, blind: bool = True, of: CampaignPlan | None = None) -> RecordedStudy:
    """Lock a study of two arms on four cells."""
    first = replace(of or plan(), seed=seed)
    second = replace(first, model=replace(first.model, name="another"))
    arms = [LockedArm("lark", "B", first), LockedArm("owl", "A", second)]
    trials = [
        ScheduledTrial(rank, rank // 2, arm.name, trial.goal, trial.start, trial.repetition)
        for rank, (trial, arm) in enumerate((trial, arm) for trial in first.trials for arm in arms)
    ]
    return journal.lock_study(StudyLock("Which?", CONTENT, hash_of(CONTENT), "h", seed, blind, arms, trials))


def amend(journal: Journal, study: RecordedStudy, content: str) -> None:
    """Replace the text of the plan."""
    journal.amend_study(study.id, StudyChange(content, hash_of(content), "Which?", "we had to", f"+{content.strip()}"))


def apply_merge(journal: Journal, study: RecordedStudy, ranks: range) -> None:
    """Run some of its scheduled trials."""
    for planned in journal.study_progress(study.id)[ranks.start : ranks.stop]:
        run(journal, planned.trial, stopped(success=planned.rank % 3 == 0), steps=1)
