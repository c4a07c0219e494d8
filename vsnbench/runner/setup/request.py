"""Request of `vsnbench run`: what the command's options ask for, as plain values."""

import logging
from dataclasses import dataclass, field, replace
from typing import Self

from vsnbench.config import BUILT_IN_SITE
from vsnbench.errors import UsageError
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.runner.executors.capacity import WorkerOptions
from vsnbench.runner.setup.selection import (
    FLAT,
    check_goal_starts,
    goals_of_flats,
    max_goals,
    named_site,
    present_goals,
    resolve_goals,
)
from vsnbench.runner.setup.trial_setup import TrialSetupSpec
from vsnbench.sites.site import Site

logger = logging.getLogger(__name__)


class NoGoalPresentError(UsageError):
    """A generated site of a sweep has none of the requested goals."""

    code = "no-goal-present"


@dataclass(frozen=True, slots=True)
class RunRequest:
    """A campaign to run: its setup, its trials, and how they are run and recorded."""

    setup: TrialSetupSpec
    """Its goals are names of the site's goals, or `all`, once `at` has resolved them."""
    results: ResultsDirectory
    site: str = BUILT_IN_SITE
    """The site as the user names it."""
    starts: tuple[int, ...] = ()
    """Numbers of starting positions; empty for all of the site's."""
    repetitions: int = 1
    seed: int = 0
    workers: WorkerOptions = field(default_factory=WorkerOptions)
    """Number of trials that run at once in simulation, and where."""
    attended: bool = False
    """An operator is present, even if the robot is simulated; trials run one at a time."""
    fail_fast: bool = False
    """The first void episode ends the session."""
    practice: int | None = None
    """Number of practice trials of a person, instead of all trials; None for trials that count."""

    @property
    def label(self) -> str:
        """Model, site, seed, disturbances and execution, for messages about one of several campaigns."""
        disturbances, execution = self.setup.disturbances, self.setup.parameters.execution
        disturbed = f", {disturbances.text}" if disturbances else ""
        disturbed += "" if execution is None else f", {execution.text}"
        return f"{self.setup.model} in {self.site} with seed {self.seed}{disturbed}"

    @property
    def site_name(self) -> str:
        """Name of the site in the results."""
        return f"flat-{self.site.removeprefix(FLAT)}" if self.site.startswith(FLAT) else self.setup.site.name

    @property
    def start_numbers(self) -> tuple[int, ...]:
        """Numbers of the starting positions."""
        return self.starts or tuple(start.number for start in self.setup.site.starts)

    @property
    def max_trials(self) -> int:
        """Maximum number of trials for any model."""
        return max_goals(self.setup.goals, self.setup.site) * len(self.start_numbers) * self.repetitions

    def at(self, name: str, site: Site) -> Self:
        """Return the request for a site, with the names of its goals.

        Raises:
            UsageError: the site lacks a goal or a starting position, or a goal has no trials from these positions.
        """
        goals = resolve_goals(self.setup.goals, site)
        for number in self.starts:
            site.start(number)
        if self.starts:
            check_goal_starts(goals, self.starts, site)
        return replace(self, site=name, setup=replace(self.setup, site=site, goals=goals))

    def at_one_of_several_flats(self, name: str, sample: Site) -> Self:
        """Return the request for a generated site that may lack goals; `generated` makes that site.

        Args:
            name: the site as the user names it.
            sample: another generated site, which has the same starting positions.

        Raises:
            UsageError: no generated site can have a goal (`unknown-goal`), or they lack a starting position.
        """
        for number in self.starts:
            sample.start(number)
        goals = goals_of_flats(self.setup.goals, sample)
        return replace(self, site=name, setup=replace(self.setup, site=sample, goals=goals))

    def ready(self) -> Self:
        """Return the request with its own site where `at_one_of_several_flats` has set another one.

        Logs which of the goals this site lacks.

        Raises:
            NoGoalPresentError: the site has none of the goals.
            SiteError: no site can be generated from the seed.
        """
        if not self.site.startswith(FLAT):
            return self
        site = self.setup.site if self.setup.site.name == self.site_name else named_site(self.site)
        present, absent = present_goals(self.setup.goals, site)
        if not present:
            raise NoGoalPresentError(f"{self.site} has no {' and no '.join(absent)}: skipped")
        if absent:
            logger.warning("%s has no %s: no trials with that goal there", self.site, " and no ".join(absent))
        return replace(self, setup=replace(self.setup, goals=present)).at(self.site, site)
