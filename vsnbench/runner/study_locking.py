"""Locks a study: every model is loaded once, fits its goals and its robot, and is frozen as it is."""

from vsnbench.database.journal import Journal
from vsnbench.database.study_entries import LockedArm, LockedTrial, RecordedStudy, StudyLock
from vsnbench.errors import StudyError
from vsnbench.record.results import ResultsDirectory
from vsnbench.runner.bench import close_policy
from vsnbench.runner.study_arms import StudyPlace
from vsnbench.study.lock import sha256_of


def locked_arms(place: StudyPlace) -> tuple[LockedArm, ...]:
    """Load the arms one after another and return what they are; nothing is written.

    Raises:
        StudyError: a model does not know a goal, or two arms are the same model and settings.
        VsnbenchError: a model or the robot cannot be used.
    """
    arms: list[LockedArm] = []
    with place.robot() as robot:
        for name in place.study.arms:
            bench = place.load(name, robot)
            try:
                plan = place.campaign(name, bench)
            finally:
                close_policy(bench.policy)
            for other in arms:
                if other.plan.key == plan.key:
                    raise StudyError(f"arms {other.name} and {name} are the same model and settings: drop one")
            arms.append(LockedArm(name, place.schedule.codes[name], plan))
    return tuple(arms)


def lock(place: StudyPlace, text: str, results: ResultsDirectory) -> RecordedStudy:
    """Write a study into the record: all of it or nothing.

    Args:
        place: the plan, its site and its schedule.
        text: the file as it is.
        results: where the record is, or will be.

    Raises:
        StudyError: a model does not fit, or some of the trials have been run already.
        VsnbenchError: a model, the robot or the record cannot be used.
    """
    arms = locked_arms(place)
    results.prepare()
    with Journal.open(results.database_url) as journal:
        return journal.lock_study(
            StudyLock(
                title=place.study.title,
                content=text,
                sha256=sha256_of(text),
                schedule_sha256=place.schedule.fingerprint,
                seed=place.study.seed,
                blind=place.study.blind,
                arms=arms,
                trials=[
                    LockedTrial(one.rank, one.block, one.arm, one.goal, one.start, one.repetition)
                    for one in place.schedule.trials
                ],
            )
        )
