"""Runs a locked study: the next scheduled trial with the arm whose turn it is, until all is done or decided."""

import logging
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass
from datetime import datetime
from functools import partial

from vsnbench.database.episode_entries import EpisodeEnd
from vsnbench.database.episodes import Claim
from vsnbench.database.journal import Journal
from vsnbench.database.provenance import gather_provenance
from vsnbench.database.study_entries import (
    OVER,
    SESSION,
    SESSION_END,
    SUSPEND,
    RecordedStudy,
    StudyTrialStanding,
)
from vsnbench.errors import RobotError, StudyError, VsnbenchError
from vsnbench.models.contract import Policy
from vsnbench.protocol.judge import EndReason, judge
from vsnbench.record.entries import EpisodeViewer
from vsnbench.record.results import ResultsDirectory
from vsnbench.robots.contract import Robot, SeenDriving, battery_of
from vsnbench.runner.attendance import Attendance, Occasion
from vsnbench.runner.attendant import SessionOverError, TrialSkippedError
from vsnbench.runner.bench import close_policy
from vsnbench.runner.blind import BlindAttendant, BlindViewer
from vsnbench.runner.episode import EpisodeOutcome, EpisodePlan
from vsnbench.runner.leftovers import sweep_results
from vsnbench.runner.model_shelf import ModelShelf
from vsnbench.runner.recorder import EpisodeRecorderFanOut, RecordingTarget
from vsnbench.runner.session import VOID_IN_A_ROW, DrivingModel, Judged, Stage, run_trial
from vsnbench.runner.stopping import Stopping
from vsnbench.runner.study_arms import StudyPlace, needs_a_person, telling_words
from vsnbench.runner.unheard import ModelsUnheard
from vsnbench.study.stopping import Decision, decide

logger = logging.getLogger(__name__)

THE_MODELS = (EndReason.MODEL_ERROR, EndReason.MODEL_LOST)
"""Void for the sake of the model, which says nothing about the robot or about other models."""


@dataclass(frozen=True, slots=True)
class StudyRequest:
    """What is to be run of a study."""

    recorded: RecordedStudy
    place: StudyPlace
    results: ResultsDirectory
    only_next: bool = False
    """One trial."""
    until: datetime | None = None
    """No trial is begun from then on; an aware moment."""
    memory_bytes: int | None = None
    """How much the loaded models may take together; half of the machine's memory when None."""


@dataclass(frozen=True, slots=True)
class StudyResult:
    """What a session of a study achieved."""

    episodes: int
    void: int
    left: int
    """Scheduled trials that are left and still wanted."""
    elsewhere: int
    awaiting: int
    suspended: tuple[str, ...]
    """Arms whose model could not be used, as people may call them."""
    over: str
    """Why nothing more is wanted, short of every trial done; empty else."""
    stopped_because: str = ""


def run_study(request: StudyRequest, attendance: Attendance, viewer: EpisodeViewer | None = None) -> StudyResult:
    """Run the scheduled trials that are left.

    Args:
        request: what to run.
        attendance: finds whoever stands beside the robot.
        viewer: whoever shows or copies the episodes.

    Raises:
        StudyError: the circumstances are not those that were locked, or another person has the robot.
        VsnbenchError: the robot or the record cannot be used.
        Stopped: a person or the system asked to stop; what happened until then is recorded.
    """
    recorded, place = request.recorded, request.place
    blind = recorded.is_blind
    with ExitStack() as stack:
        unheard = stack.enter_context(ModelsUnheard(telling_words(place, recorded))) if blind else None
        provenance = gather_provenance()
        journal = stack.enter_context(Journal.open(request.results.database_url, provenance))
        other = journal.who_else_runs(recorded.id)
        refusal = StudyError(f"this study is being run by {other}: one robot runs one trial at a time")
        try:
            robot = stack.enter_context(place.robot())
        except RobotError as error:
            if not other:
                raise
            # A robot that another run drives refuses by itself, and cannot say whose run that is.
            raise refusal from error
        by_hand = needs_a_person(robot)
        if by_hand:
            attendance.require(robot.identity.profile)
            if other:
                raise refusal
        request.results.prepare()
        journal.note_in_study(recorded.id, SESSION, provenance.operator)
        stack.callback(journal.note_in_study, recorded.id, SESSION_END)
        seen = BlindViewer(viewer) if viewer is not None and blind else viewer
        if seen is not None:
            seen.prepare()
        sweep_results(request.results, journal)
        stop = stack.enter_context(Stopping())
        stop.last_acts.append(robot.halt)
        standing = journal.study_standing(recorded.id)
        results = [bool(one.success) for one in standing if one.done]
        attendant = stack.enter_context(
            attendance.attend(
                Occasion(
                    label=recorded.title,
                    trials=len(standing),
                    done=len(results),
                    successes=sum(results),
                    parameters=place.study.protocol,
                    needs_a_person=by_hand,
                    halt=robot.halt,
                    stop=stop,
                    site=place.site,
                    robot_radius_m=robot.identity.profile.base.radius_m,
                    journal=journal,
                    results=request.results,
                    campaigns=tuple(arm.campaign_id for arm in recorded.arms),
                    operator=provenance.operator,
                    blind=blind,
                    glimpse=robot.glimpse if isinstance(robot, SeenDriving) else None,
                    battery=battery_of(robot),
                )
            )
        )
        journal.patience.gives_up = lambda: stop.session_ends
        shelf = stack.enter_context(
            ModelShelf(lambda arm: _loaded(place, recorded, arm, robot, journal, unheard), request.memory_bytes)
        )
        return _Session(
            request,
            Stage(
                journal,
                robot,
                Judged(journal, BlindAttendant(attendant) if blind else attendant, provenance.operator),
                stop,
            ),
            shelf,
            lambda arm: RecordingTarget(
                journal, request.results, recorded.shown(arm), robot.identity.profile, seen, provenance.operator
            ),
        ).run()


def _loaded(
    place: StudyPlace,
    recorded: RecordedStudy,
    arm: str,
    robot: Robot,
    journal: Journal,
    unheard: ModelsUnheard | None,
) -> Policy:
    """Make the policy of an arm, which must be the one that was locked.

    Args:
        place: the study's.
        recorded: the study.
        arm: which.
        robot: what it drives.
        journal: is told where it runs.
        unheard: lets nothing be heard of it; None where people see who drives.

    Raises:
        StudyError: it is not; or its circumstances are not.
        VsnbenchError: it cannot be loaded.
    """
    with unheard.call() if unheard else nullcontext():
        bench = place.load(arm, robot)
    policy, known = bench.policy, recorded.by_name[arm]
    plan = place.campaign(arm, bench)
    if plan.key != known.campaign_key:
        what = (
            "its weights, settings or code are not those that were locked"
            if plan.model.sha256 != known.model_sha256
            else "the site, the robot or its conditions are not those that were locked"
        )
        close_policy(policy)
        raise StudyError(f"arm {arm}: {what}")
    runs_on = ", ".join(f"{name}: {value}" for name, value in policy.card.runs_on.items())
    journal.add_event("model_loaded", runs_on, campaign_id=known.campaign_id)
    return unheard.policy(policy) if unheard else policy


@dataclass(slots=True)
class _Session:
    request: StudyRequest
    stage: Stage
    shelf: ModelShelf
    target: Callable[[str], RecordingTarget]

    def run(self) -> StudyResult:
        request, recorded = self.request, self.request.recorded
        episodes = void = in_a_row = 0
        because = ""
        own: Counter[str] = Counter()
        suspended: dict[str, str] = {}
        passed_over: set[int] = set()
        skipped: set[int] = set()
        """By whoever is there, until nothing else is left."""
        decision = self._decision(self.stage.journal.study_standing(recorded.id))
        while not because and not decision.over:
            standing = self.stage.journal.study_standing(recorded.id)
            away = {*suspended, *decision.dropped}
            not_now = passed_over | skipped
            wanted = [one for one in standing if one.left and one.arm not in away and one.rank not in not_now]
            if request.only_next and episodes:
                break
            if not wanted and skipped:
                skipped.clear()
                continue
            if not wanted and self.stage.beside.nothing_left():
                continue
            if not wanted:
                break
            if request.until is not None and datetime.now(request.until.tzinfo) >= request.until:
                because = f"it is {request.until:%H:%M}"
                break
            turn = wanted[0]
            claim = self.stage.journal.claim_next(turn.trial.campaign_id, [turn.trial.id])
            if claim is None:
                passed_over.add(turn.rank)
                continue
            try:
                outcome = self._run_one(turn, claim)
            except TrialSkippedError:
                skipped.add(turn.rank)
                continue
            except SessionOverError as over:
                because = str(over)
                break
            if outcome is None:
                continue
            episodes += 1
            reason = outcome.verdict.end_reason
            void += not reason.is_result
            own[turn.arm] = own[turn.arm] + 1 if reason in THE_MODELS else 0
            if own[turn.arm] == VOID_IN_A_ROW or (not outcome.began and reason in THE_MODELS):
                suspended[turn.arm] = outcome.error
                self.stage.journal.note_in_study(recorded.id, SUSPEND, f"{turn.arm}: {outcome.error}")
                logger.warning("%s is left out for now: %s", recorded.shown(turn.arm), self._shown_error(outcome))
            if reason.is_result:
                in_a_row = 0
                decision = self._decision(self.stage.journal.study_standing(recorded.id))
            elif reason is not EndReason.ABORTED and reason not in THE_MODELS:
                in_a_row += 1
            if in_a_row == VOID_IN_A_ROW:
                because = f"{VOID_IN_A_ROW} void episodes one after another, the last: {outcome.error}"
        return self._result(decision, episodes, void, tuple(suspended), because)

    def _decision(self, standing: Sequence[StudyTrialStanding]) -> Decision:
        study, recorded = self.request.place.study, self.request.recorded
        if study.stopping != "decided":
            return Decision((), {}, "")
        decision = decide(study, block_outcomes(standing, study.goals))
        if decision.over and not any(one.kind == OVER for one in recorded.entries):
            self.stage.journal.note_in_study(recorded.id, OVER, decision.over)
        return decision

    def _run_one(self, turn: StudyTrialStanding, claim: Claim) -> EpisodeOutcome | None:
        place, trial = self.request.place, claim.trial
        parameters = place.study.protocol
        plan = EpisodePlan(place.site, trial.goal, place.site.start(trial.start), claim.seed, parameters)
        try:
            policy = self.shelf.take(turn.arm)
        except VsnbenchError as error:
            verdict = judge(EndReason.MODEL_ERROR, 0, None, parameters)
            self.stage.journal.end_episode(
                claim.id, EpisodeEnd(EndReason.MODEL_ERROR, 0, verdict, error=f"could not be loaded: {error}")
            )
            return EpisodeOutcome(verdict, 0, None, 0.0, f"could not be loaded: {error}", began=False)
        except BaseException:
            self.stage.journal.release(claim.id)
            raise
        recorder = partial(EpisodeRecorderFanOut, self.target(turn.arm))
        shown = self.request.recorded.shown(turn.arm)
        outcome = run_trial(self.stage, DrivingModel(policy, recorder, shown), claim, plan)
        if outcome is not None and outcome.verdict.end_reason in THE_MODELS:
            self.shelf.drop(turn.arm)  # whatever state it is in, the next trial gets a fresh one
        return outcome

    def _shown_error(self, outcome: EpisodeOutcome) -> str:
        return "its model failed; the record keeps how" if self.request.recorded.is_blind else outcome.error

    def _result(
        self, decision: Decision, episodes: int, void: int, suspended: Sequence[str], because: str
    ) -> StudyResult:
        standing = self.stage.journal.study_standing(self.request.recorded.id)
        wanted = [] if decision.over else [one for one in standing if one.arm not in decision.dropped]
        return StudyResult(
            episodes=episodes,
            void=void,
            left=sum(one.left for one in wanted),
            elsewhere=sum(one.state is not None and not one.done and not one.here for one in wanted),
            awaiting=sum(one.done and one.success is None for one in standing),
            suspended=tuple(self.request.recorded.shown(arm) for arm in suspended),
            over=decision.over,
            stopped_because=because,
        )


def block_outcomes(standing: Sequence[StudyTrialStanding], goals: Sequence[str]) -> list[dict[str, bool]]:
    """Return what is known of every block of the shared goals, in the order of the schedule."""
    blocks: dict[int, dict[str, bool]] = {}
    for one in standing:
        if one.trial.goal in goals:
            known = blocks.setdefault(one.block, {})
            if one.success is not None:
                known[one.arm] = one.success
    return [blocks[block] for block in sorted(blocks)]
