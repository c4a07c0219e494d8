"""A study from a plan, locked in a record and partly run, without loading models."""

from dataclasses import replace

from tests.results.records_of_a_lab import plan, run, stopped
from tests.results.studies_of_a_lab import hash_of
from tests.study.studies import study_text
from vsnbench.results.studies.entries import LockedArm, RecordedStudy, StudyLock
from vsnbench.results.studies.evidence import read_evidence
from vsnbench.results.studies.queries import studies
from vsnbench.results.writing.campaigns import Trial
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.study.integrity import StudyIntegrity, check_integrity
from vsnbench.sites.site import load_site
from vsnbench.study.file import parse_study
from vsnbench.study.lock import LockNote
from vsnbench.study.schedule import Schedule, draw_schedule

SITE = load_site("apartment")


def drawn(text: str) -> Schedule:
    """Return the schedule of a plan over starting positions 1 to 4."""
    return draw_schedule(parse_study(text, "study.yaml"), [1, 2, 3, 4], SITE.excluded)


def lock_drawn(journal: Journal, text: str = "", schedule: Schedule | None = None) -> RecordedStudy:
    """Lock a plan, by default with the order that follows from its seed."""
    text = text or study_text()
    schedule = schedule or drawn(text)
    base = replace(plan(), site=SITE, seed=7)
    arms = [
        LockedArm(
            name,
            code,
            replace(
                base,
                model=replace(base.model, name=name),
                trials=[
                    Trial(trial.goal, trial.start, trial.repetition) for trial in schedule.trials if trial.arm == name
                ],
            ),
        )
        for name, code in schedule.codes.items()
    ]
    study = parse_study(text, "study.yaml")
    return journal.lock_study(
        StudyLock(study.title, text, hash_of(text), schedule.fingerprint, 7, study.blind, arms, schedule.trials)
    )


def run_ranks(journal: Journal, study: RecordedStudy, ranks: range) -> None:
    """Run some of the scheduled trials; every third one succeeds."""
    for planned in journal.study_progress(study.id)[ranks.start : ranks.stop]:
        run(journal, planned.trial, stopped(success=planned.rank % 3 == 0), steps=1)


def note_of(journal: Journal, study: RecordedStudy) -> LockNote:
    """Return the lock file of `study lock`."""
    first = read_evidence(journal.engine, study.id).log[0]
    return LockNote(study.uuid, study.sha256, "", "", study.schedule_sha256, first.sha256)


def integrity(journal: Journal, identity: str, note: LockNote | None = None) -> StudyIntegrity:
    """Compare the current study with its lock and its log."""
    (study,) = [study for study in studies(journal.engine) if study.uuid == identity]
    evidence = read_evidence(journal.engine, study.id)
    return check_integrity(study, evidence, parse_study(study.content, "study.yaml"), note)
