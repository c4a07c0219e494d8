"""Locks a study: loads every model once, checks it and records what it is."""

from vsnbench.errors import StudyError
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.studies.entries import LockedArm, RecordedStudy, StudyLock
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.setup.trial_setup import close_policy
from vsnbench.runner.study.arms import StudyPlace, check_progress
from vsnbench.study.lock import sha256_of


def locked_arms(place: StudyPlace) -> tuple[LockedArm, ...]:
    """Load the models of all arms in turn and identify them; writes nothing.

    Raises:
        StudyError: a model does not know a goal, or two arms are the same model and settings.
        VsnbenchError: a model or the robot cannot be used.
    """
    arms: list[LockedArm] = []
    with place.robot() as robot:
        check_progress(place, robot.identity.profile.base.radius_m)
        for name in place.study.arms:
            setup = place.load(name, robot)
            try:
                plan = place.campaign(name, setup)
            finally:
                close_policy(setup.policy)
            for other in arms:
                if other.plan.key == plan.key:
                    raise StudyError(
                        f"arms {other.name} and {name} are the same model and settings",
                        advice="remove one of them",
                        code="equal-arms",
                    )
            arms.append(LockedArm(name, place.schedule.codes[name], plan))
    return tuple(arms)


def lock(place: StudyPlace, text: str, results: ResultsDirectory) -> RecordedStudy:
    """Write a study to the results database in one transaction.

    Raises:
        StudyError: a model does not fit, or some of the trials have results already.
        VsnbenchError: a model, the robot or the results cannot be used.
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
                trials=place.schedule.trials,
            )
        )
