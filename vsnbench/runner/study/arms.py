"""The arms of a study as campaigns: each model with the study's robot, site and protocol."""

import logging
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vsnbench.errors import StudyError, UsageError
from vsnbench.models.names import STACK_PREFIX, is_stack, require_no_person, stack_file
from vsnbench.models.process_exit import process_exit_refused
from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.studies.entries import RecordedStudy
from vsnbench.results.writing.campaigns import CampaignPlan, Trial
from vsnbench.robots.contract import Robot
from vsnbench.robots.registry import is_simulated, open_robot, profile_of
from vsnbench.runner.executors.capacity import WorkerOptions
from vsnbench.runner.setup.execution import needs_person, rules_for
from vsnbench.runner.setup.launch import check_survey
from vsnbench.runner.setup.request import RunRequest
from vsnbench.runner.setup.selection import choose_goals, choose_starts, resolve_goals
from vsnbench.runner.setup.trial_setup import (
    TrialSetup,
    TrialSetupSpec,
    close_policy,
    load_policy,
    prepare_setup,
    use_one_thread_in_simulation,
)
from vsnbench.sites.site import Site, embedded_sites, load_site
from vsnbench.study.design import design_error
from vsnbench.study.file import Rate, StudyFile
from vsnbench.study.schedule import Schedule, draw_schedule, schedules_of
from vsnbench.study.stopping import decide, min_units
from vsnbench.study.units import Block
from vsnbench.text.sanitize import counted

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class StudyPlace:
    """A study with its site and its schedule."""

    study: StudyFile
    site: Site
    schedule: Schedule
    directory: Path
    """Directory of the study's file; its paths are relative to it."""

    @classmethod
    def of(cls, study: StudyFile, directory: Path, locked_sha256: str | None = None) -> "StudyPlace":
        """Read the site and draw the schedule.

        `locked_sha256` is the fingerprint of the locked schedule, None before the lock. If no schedule of the study has
        it, the result has the schedule that would be drawn now.

        Raises:
            StudyError: the site lacks a goal or a starting position of the study.
            VsnbenchError: the site cannot be used.
        """
        site = load_site(_site_name(study, directory))
        try:
            starts = choose_starts(study.starting_positions, site)
        except UsageError as error:
            raise StudyError(f"starting_positions: {error}".replace("in --starts ", "in ")) from error
        for goal in dict.fromkeys(goal for arm in study.arms for goal in study.goals_of(arm)):
            try:
                resolve_goals([goal], site)
            except UsageError as error:
                raise StudyError(f"goals: {error}", code=error.code) from error
        if locked_sha256 is None:
            schedule = draw_schedule(study, starts, site.excluded)
            _check_can_be_decided(study, schedule)
        else:
            possible = schedules_of(study, starts, site.excluded)
            schedule = next(
                (candidate for candidate in possible if candidate.fingerprint == locked_sha256), possible[0]
            )
        return cls(study, site, schedule, directory)

    @property
    def design_error(self) -> str:
        """Why the plan cannot lead to a conclusion; empty if it can."""
        return design_error(self.study, self.shared_blocks)

    def model(self, arm: str) -> str:
        """Return the name of an arm's model; the file of a stack is relative to the study's."""
        model = self.study.arms[arm].model
        return f"{STACK_PREFIX}{self.directory / stack_file(model)}" if is_stack(model) else model

    def rules(self, arm: str) -> ProtocolParameters:
        """Return the protocol of an arm: the study's, in which a stack drives the robot itself."""
        return rules_for(self.model(arm), self.study.protocol)

    def options(self, arm: str) -> dict[str, Any]:
        """Return the options of an arm's model, with paths relative to the study's file resolved."""
        return {
            name: self.directory / value
            if isinstance(value, Path) and str(value) != "embedded" and not value.is_absolute()
            else value
            for name, value in self.study.arms[arm].options.items()
        }

    def setup(self, arm: str) -> TrialSetupSpec:
        """Return the setup of an arm, with all its goals."""
        return TrialSetupSpec(
            site=self.site,
            model=self.model(arm),
            goals=self.study.goals_of(arm),
            robot=self.study.robot,
            noise=self.study.noise,
            rehearsal=self.study.rehearse,
            parameters=self.rules(arm),
            model_options=self.options(arm),
            act_timeout_s=self.study.arms[arm].act_timeout,
        )

    def trials(self, arm: str) -> tuple[Trial, ...]:
        """Return an arm's trials in the order of the schedule."""
        return tuple(
            Trial(trial.goal, trial.start, trial.repetition) for trial in self.schedule.trials if trial.arm == arm
        )

    def twin(self, results: ResultsDirectory) -> RunRequest:
        """Return the request for the planned twin: simulated trials of the primary arm's model in all cells.

        The seed is the one after the study's, which no other campaign may use while the study is blind.

        Raises:
            StudyError: the study plans no twin (`no-twin`), or its robot cannot be simulated (`no-profile`).
        """
        study, robot = self.study, self.study.robot
        if study.real_cells is None or not isinstance(study.primary, Rate):
            raise StudyError("this study plans no twin", advice="`vsnbench study new --twin 30` does", code="no-twin")
        if profile_of(robot) is None:
            raise StudyError(
                f"robot {robot} has no profile that can be simulated",
                advice="run the twin with `vsnbench run --robot simulated:PROFILE`",
                code="no-profile",
            )
        named = robot if is_simulated(robot) else f"simulated:{robot.partition('@')[0]}"
        setup = replace(self.setup(study.primary.arm), goals=study.goals, robot=named, rehearsal=False)
        request = RunRequest(
            setup=setup,
            results=results,
            starts=choose_starts(study.starting_positions, self.site),
            repetitions=study.repetitions,
            seed=(study.seed + 1) % 2**63,
            workers=WorkerOptions(None),
        )
        return request.at(_site_name(study, self.directory), self.site)

    @property
    def shared_blocks(self) -> tuple[Block, ...]:
        """Planned blocks of the shared goals, in the order of the schedule, without results."""
        return _shared_blocks(self.study, self.schedule)

    @contextmanager
    def robot(self) -> Iterator[Robot]:
        """Open the study's robot, and check the survey of the user's own site.

        Raises:
            VsnbenchError: the robot or the site cannot be used.
        """
        study = self.study
        use_one_thread_in_simulation(study.robot)
        with (
            process_exit_refused(),
            open_robot(study.robot, self.site, study.protocol, noise=study.noise, rehearsal=study.rehearse) as robot,
        ):
            if study.site not in embedded_sites():
                check_survey(study.site, self.site, robot.identity.profile.base.radius_m, study.protocol)
            yield robot

    def load(self, arm: str, robot: Robot) -> TrialSetup:
        """Load an arm's model, and check that it fits the goals and the robot.

        Raises:
            StudyError: the model does not know a goal of the study, or the robot lacks a sensor.
            VsnbenchError: the model cannot be loaded.
        """
        try:
            require_no_person(self.study.arms[arm].model, "study")
        except UsageError as error:
            raise StudyError(f"arm {arm}: {error}") from error
        spec = self.setup(arm)
        robot.set_execution(spec.parameters.execution)
        policy = load_policy(spec)
        try:
            goals = choose_goals(spec.goals, spec.site, policy.card)
            if self.study.blind and needs_person(policy.card):
                raise StudyError(
                    f"arm {arm}: a person starts this stack or says that it has arrived, and the study is blind",
                    advice="let it be announced and arrive another way, or set blind: false",
                    code="needs-operator",
                )
            return prepare_setup(replace(spec, goals=goals), policy, robot)
        except BaseException as error:
            close_policy(policy)
            if isinstance(error, UsageError):
                raise StudyError(f"arm {arm}: {error}") from error
            raise

    def campaign(self, arm: str, setup: TrialSetup) -> CampaignPlan:
        """Return the campaign of an arm."""
        description = setup.description
        return CampaignPlan(
            site=self.site,
            robot=description.robot,
            model=description.card,
            protocol=self.rules(arm),
            seed=self.study.seed,
            trials=self.trials(arm),
            conditions=description.conditions,
        )


def check_progress(place: StudyPlace, radius_m: float) -> None:
    """Refuse progress as the primary metric where the site's map gives a shared cell no shortest path.

    Raises:
        StudyError: a cell has none; the message names the first.
    """
    if not place.study.of_progress:
        return
    space, starts = free_space(place.site, radius_m), {start.number: start for start in place.site.starts}
    for block in place.shared_blocks:
        if not math.isfinite(space.geodesic_to_goal_m(starts[block.start].pose, block.goal, place.study.protocol)):
            raise StudyError(
                f"primary: progress to {block.goal} is unknown from starting position {block.start}: the map of site "
                f"{place.site.name} has no path there",
                advice="exclude that cell in the site file, or set primary: {metric: success}",
                code="no-progress",
            )


def _shared_blocks(study: StudyFile, schedule: Schedule) -> tuple[Block, ...]:
    shared = (trial for trial in schedule.trials if trial.goal in study.goals)
    return tuple({trial.block: Block(trial.goal, trial.start, {}) for trial in shared}.values())


def _check_can_be_decided(study: StudyFile, schedule: Schedule) -> None:
    """Refuse a study that is too small for a decision.

    Raises:
        StudyError: even the clearest outcome would decide nothing, or a look comes after the last starting position.
    """
    if study.stopping != "decided":
        return
    blocks = _shared_blocks(study, schedule)
    decision = decide(study, blocks)
    if decision.over or (study.by_looks and min_units(study, blocks) is None):
        more = "starting_positions" if study.by_starting_position else "goals, starting_positions or repetitions"
        raise StudyError(
            f"stopping: {counted(decision.planned_units, decision.unit)} "
            f"{'is' if decision.planned_units == 1 else 'are'} too few: even {_clearest(study)} would decide nothing",
            advice=f"plan more {more}, or set stopping: plan",
            code="too-few-units",
        )


def _clearest(study: StudyFile) -> str:
    return "equal results of all trials" if study.primary.kind == "equivalence" else "an arm that wins all of them"


def _site_name(study: StudyFile, directory: Path) -> str:
    if study.site in embedded_sites() or Path(study.site).is_absolute():
        return study.site
    return str(directory / study.site)


def revealing_words(place: StudyPlace, recorded: RecordedStudy) -> frozenset[str]:
    """Return the words that reveal a model: names, paths and their parts, labels and hashes."""
    words: set[str] = set()
    for name, arm in place.study.arms.items():
        words |= {name, arm.model}
        for path in (arm.weights, arm.model_settings, str(stack_file(arm.model)) if is_stack(arm.model) else None):
            if path and path != "embedded":
                words |= {path, Path(path).name, Path(path).stem, str(place.directory / path)}
    for locked in recorded.arms:
        words |= {locked.model, locked.weights_label, locked.model_sha256}
        words |= {locked.weights_sha256, locked.weights_sha256[:12]}
    return frozenset(words)
