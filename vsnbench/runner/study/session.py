"""Runs a session of a locked study: each scheduled trial with the model of its arm."""

from contextlib import ExitStack, nullcontext
from functools import partial

from vsnbench.errors import RobotError, StudyError
from vsnbench.results.files.episode_entries import EpisodeViewer
from vsnbench.results.studies.entries import SESSION, SESSION_END
from vsnbench.results.writing.campaigns import model_sha256
from vsnbench.results.writing.journal import Journal
from vsnbench.results.writing.provenance import gather_provenance
from vsnbench.robots.contract import Robot
from vsnbench.runner.episode.recorder import RecordingOptions
from vsnbench.runner.executors.in_process import DrivingModel, InProcessExecutor
from vsnbench.runner.loop.contract import Session, SessionResult
from vsnbench.runner.operator.contract import TrialCounts
from vsnbench.runner.operator.provider import OperatorProvider
from vsnbench.runner.session import run_session
from vsnbench.runner.setup.model_cache import ModelCache
from vsnbench.runner.setup.trial_setup import close_policy
from vsnbench.runner.study.arms import revealing_words
from vsnbench.runner.study.blinding import BlindViewer
from vsnbench.runner.study.output_redaction import OutputRedaction
from vsnbench.runner.study.source import StudyRequest, StudySource, arm_of


def run_study(request: StudyRequest, operators: OperatorProvider, viewer: EpisodeViewer | None = None) -> SessionResult:
    """Run the scheduled trials that are left.

    Raises:
        StudyError: a condition differs from the locked study, or another process uses the robot.
        VsnbenchError: the robot or the results cannot be used.
        Stopped: a person or the system asked to stop; what happened until then is recorded.
    """
    recorded, place = request.recorded, request.place
    with ExitStack() as stack:
        redaction = OutputRedaction(revealing_words(place, recorded)) if recorded.is_blind else None
        if redaction is not None:
            stack.enter_context(redaction)
        provenance = gather_provenance(of_run=True)
        journal = stack.enter_context(Journal.open(request.results.database_url, provenance))
        robot = _open_robot(stack, request, journal, operators)
        request.results.prepare()
        journal.note_in_study(recorded.id, SESSION, provenance.operator)
        stack.callback(journal.note_in_study, recorded.id, SESSION_END)
        load = partial(_load_arm, request, robot, journal, redaction)
        models = stack.enter_context(ModelCache(load, request.memory_bytes))
        if viewer is not None and recorded.is_blind:
            viewer = BlindViewer(viewer)
        progress = journal.study_progress(recorded.id)
        results = [bool(trial.success) for trial in progress if trial.done]
        session = Session(
            journal=journal,
            robots=InProcessExecutor(
                robot,
                take=lambda trial: models.take(arm_of(recorded, trial)),
                drop=lambda trial: models.drop(arm_of(recorded, trial)),
            ),
            recording=RecordingOptions(request.results, viewer, provenance.operator),
            site=place.site,
            parameters=place.study.protocol,
            parameters_of={arm.campaign_id: place.rules(arm.name) for arm in recorded.arms},
            label=recorded.title,
            trials=TrialCounts(len(progress), len(results), sum(results)),
            campaign_ids=tuple(arm.campaign_id for arm in recorded.arms),
            is_blind=recorded.is_blind,
        )
        return run_session(session, operators, lambda begun: StudySource(begun.journal, request))


def _open_robot(stack: ExitStack, request: StudyRequest, journal: Journal, operators: OperatorProvider) -> Robot:
    """Open the robot, which no other process may use for this study where a person places it."""
    other = journal.other_running_process(request.recorded.id)
    refusal = StudyError(
        f"this study is being run by {other}: one robot runs one trial at a time", code="study-is-running"
    )
    try:
        robot = stack.enter_context(request.place.robot())
    except RobotError as error:
        if not other:
            raise
        # The robot is in use; its own error cannot name the other process.
        raise refusal from error
    if robot.needs_operator:
        operators.require(robot.identity.profile)
        if other:
            raise refusal
    return robot


def _load_arm(
    request: StudyRequest, robot: Robot, journal: Journal, redaction: OutputRedaction | None, arm: str
) -> DrivingModel:
    """Load the model of an arm, and check that it is the locked one.

    Raises:
        StudyError: the model or its conditions are not those that were locked.
        VsnbenchError: the model cannot be loaded.
    """
    recorded, place = request.recorded, request.place
    with redaction.call() if redaction else nullcontext():
        setup = place.load(arm, robot)
    policy, locked = setup.policy, recorded.by_name[arm]
    plan = place.campaign(arm, setup)
    if plan.key != locked.campaign_key:
        what = (
            "its weights, settings or code are not those that were locked"
            if model_sha256(plan.model) != locked.model_sha256
            else "the site, the robot or its conditions are not those that were locked"
        )
        close_policy(policy)
        raise StudyError(f"arm {arm}: {what}", code="differs-from-lock")
    runs_on = ", ".join(f"{name}: {value}" for name, value in policy.card.runs_on.items())
    journal.add_event("model_loaded", runs_on, campaign_id=locked.campaign_id)
    return DrivingModel(redaction.policy(policy) if redaction else policy, recorded.shown(arm))
