"""The arms of a study as campaigns: each one's model on the study's robot, in its site, under its protocol."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vsnbench.database.campaign_plan import CampaignPlan, PlannedTrial
from vsnbench.database.study_entries import RecordedStudy
from vsnbench.errors import StudyError, UsageError
from vsnbench.models.registry import create_policy
from vsnbench.protocol.site import Site, embedded_sites, load_site
from vsnbench.robots.contract import PlacedByHand, Robot
from vsnbench.robots.registry import open_robot
from vsnbench.runner.bench import Bench, BenchPlan, close_policy, on_bench, settle_threads
from vsnbench.runner.launch import heed_survey
from vsnbench.runner.selection import choose_starts
from vsnbench.study.file import StudyFile
from vsnbench.study.schedule import Schedule, draw_schedule
from vsnbench.study.stopping import decide

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class StudyPlace:
    """A study's site and starting positions; its schedule follows from them."""

    study: StudyFile
    site: Site
    schedule: Schedule
    directory: Path
    """Of the study's file: paths in it are relative to it."""

    @classmethod
    def of(cls, study: StudyFile, directory: Path) -> "StudyPlace":
        """Read the site and draw the schedule.

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
            if goal not in site.categories:
                raise StudyError(f"goals: site {site.name} has no {goal}; it has {', '.join(sorted(site.categories))}")
        schedule = draw_schedule(study, starts, site.excluded)
        _check_can_be_decided(study, schedule)
        return cls(study, site, schedule, directory)

    def options(self, arm: str) -> dict[str, Any]:
        """Return what an arm's model is made with; its paths lead from the study's file."""
        return {
            name: self.directory / value
            if isinstance(value, Path) and str(value) != "embedded" and not value.is_absolute()
            else value
            for name, value in self.study.arms[arm].options.items()
        }

    def trials(self, arm: str) -> tuple[PlannedTrial, ...]:
        """Return an arm's trials in the order of the schedule."""
        return tuple(
            PlannedTrial(one.goal, one.start, one.repetition) for one in self.schedule.trials if one.arm == arm
        )

    @contextmanager
    def robot(self) -> Iterator[Robot]:
        """Open the study's robot, and heed the survey of a site of one's own.

        Raises:
            VsnbenchError: the robot or the site cannot be used.
        """
        study = self.study
        settle_threads(study.robot)
        with open_robot(
            study.robot, self.site, study.protocol, noise=study.noise, pretend_real=study.pretend_real
        ) as robot:
            if study.site not in embedded_sites():
                heed_survey(study.site, self.site, robot.identity.profile.base.radius_m, study.protocol)
            yield robot

    def load(self, arm: str, robot: Robot) -> Bench:
        """Make an arm's model, fit for the goals and the robot.

        Raises:
            StudyError: it does not know a goal of the study, or the robot lacks what it needs.
            VsnbenchError: it cannot be loaded.
        """
        chosen = self.study.arms[arm]
        plan = BenchPlan(
            site=self.site,
            model=chosen.model,
            goals=self.study.goals_of(arm),
            robot=self.study.robot,
            noise=self.study.noise,
            pretend_real=self.study.pretend_real,
            parameters=self.study.protocol,
            model_options=self.options(arm),
            act_timeout_s=None if chosen.elsewhere else chosen.act_timeout,
        )
        policy = create_policy(chosen.model, None, **plan.model_options)
        try:
            return on_bench(plan, policy, robot)
        except BaseException as error:
            close_policy(policy)
            if isinstance(error, UsageError):
                raise StudyError(f"arm {arm}: {error}") from error
            raise

    def campaign(self, arm: str, bench: Bench) -> CampaignPlan:
        """Return the campaign of an arm."""
        described = bench.description
        return CampaignPlan(
            site=self.site,
            robot=described.robot,
            model=described.model,
            protocol=self.study.protocol,
            seed=self.study.seed,
            trials=self.trials(arm),
            conditions=described.conditions,
        )


def _check_can_be_decided(study: StudyFile, schedule: Schedule) -> None:
    """Refuse a study that would be over before its first trial.

    Raises:
        StudyError: not even an arm that wins every block could be told apart.
    """
    blocks = len({one.block for one in schedule.trials if one.goal in study.goals})
    if study.stopping == "decided" and decide(study, [{} for _ in range(blocks)]).over:
        raise StudyError(
            f"stopping: {blocks} blocks are too few: not even an arm that wins every one of them could be told apart; "
            "ask for more goals, starting_positions or repetitions, or for stopping: plan"
        )


def needs_a_person(robot: Robot) -> bool:
    """Whether somebody has to put the robot at its marks."""
    return isinstance(robot, PlacedByHand) and robot.needs_a_person


def _site_name(study: StudyFile, directory: Path) -> str:
    if study.site in embedded_sites() or Path(study.site).is_absolute():
        return study.site
    return str(directory / study.site)


def telling_words(place: StudyPlace, recorded: RecordedStudy) -> frozenset[str]:
    """Return the words that give a model away: names, paths and their parts, labels and hashes."""
    words: set[str] = set()
    for name, arm in place.study.arms.items():
        words |= {name, arm.model}
        for path in (arm.weights, arm.model_settings):
            if path and path != "embedded":
                words |= {path, Path(path).name, Path(path).stem, str(place.directory / path)}
    for known in recorded.arms:
        words |= {known.model, known.weights_label, known.model_sha256}
        words |= {known.weights_sha256, known.weights_sha256[:12]}
    return frozenset(words)
