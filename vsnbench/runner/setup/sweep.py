"""A sweep: one campaign for every model, site and seed."""

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from vsnbench.errors import UsageError, VsnbenchError
from vsnbench.models.registry import locate
from vsnbench.results.files.episode_entries import EpisodeViewer
from vsnbench.results.reading.throughput import Throughput
from vsnbench.results.writing.campaigns import protocol_sha256
from vsnbench.robots.registry import is_simulated
from vsnbench.runner.executors.capacity import Capacity
from vsnbench.runner.executors.local_pool import SharedWorkers
from vsnbench.runner.loop.contract import SessionResult
from vsnbench.runner.operator.provider import OperatorProvider
from vsnbench.runner.setup.launch import launch
from vsnbench.runner.setup.request import NoGoalPresentError, RunRequest
from vsnbench.runner.setup.selection import FLAT, named_goals, named_site, possible_goals
from vsnbench.sites.site import Site

logger = logging.getLogger(__name__)

UNKNOWN_PACE_S = 3.0
"""Estimate for a trial without recorded trials; the embedded models need 1 to 3 s."""
STARTUP_S = 6.0
"""Time before the first trial of the first campaign, which starts the workers."""
NEXT_STARTUP_S = 2.0
"""Time before the first trial of every other campaign."""
MOST_CAMPAIGNS = 100_000


Sweep = tuple[RunRequest, ...]
"""The campaigns of a sweep in the order of running."""


@dataclass(frozen=True, slots=True)
class Cost:
    """Trials of a sweep that are left, and the time that they need."""

    campaigns: int
    trials: int
    done: int
    seconds: float
    workers: int
    known_from: int
    """Number of recorded episodes that the estimate is based on."""


@dataclass(frozen=True, slots=True)
class Swept:
    """A campaign of a sweep that was run."""

    request: RunRequest
    result: SessionResult | VsnbenchError
    """An error is why it could not run; NoGoalPresentError is none: the generated site has none of the goals."""

    @property
    def session(self) -> SessionResult | None:
        """Result of its session; None if it could not run."""
        return self.result if isinstance(self.result, SessionResult) else None

    @property
    def is_skipped(self) -> bool:
        """Whether it has no trials."""
        return isinstance(self.result, NoGoalPresentError)


def plan_sweep(request: RunRequest, models: Sequence[str], seeds: Sequence[int], sites: Sequence[str]) -> Sweep:
    """Return the campaigns of every model, site and seed, after checking what can be checked now.

    Seeds vary slowest, so that a sweep stopped half-way has results of every model and site. Sites are names, paths of
    site files, and generated sites as `flat:7`; `request` has the options that the campaigns share, and its own site.

    Raises:
        UsageError: something named does not exist or does not fit together.
        SiteError: the file of a site is not valid.
    """
    setup = request.setup
    if not is_simulated(setup.robot):
        raise UsageError(
            f"a sweep needs a simulated robot, and {setup.robot} is real",
            advice="run one campaign at a time",
            code="real-robot",
        )
    if len(models) > 1 and setup.model_options:
        options = ", ".join(f"--{name.replace('_', '-')}" for name in setup.model_options)
        raise UsageError(f"{options} is for one model, and there are {len(models)}", advice="sweep each on its own")
    for name in models:
        locate(name)
    named_goals(setup.goals)
    if (count := len(seeds) * len(sites) * len(models)) > MOST_CAMPAIGNS:
        raise UsageError(f"that is {count:,} campaigns, more than {MOST_CAMPAIGNS:,}", advice="sweep a part of it")
    at_site: dict[str, RunRequest] = {}
    sample: Site | None = None
    for place in sites:
        is_generated = place.startswith(FLAT)
        if is_generated and sample is not None:
            site = sample  # each is generated when its campaign begins
        else:
            site = setup.site if place == request.site else named_site(place)
            sample = site if is_generated else sample
        several = is_generated and len(sites) > 1
        at_site[place] = request.at_one_of_several_flats(place, site) if several else request.at(place, site)
    return tuple(
        replace(at_site[place], setup=replace(at_site[place].setup, model=model), seed=seed)
        for seed in seeds
        for place in sites
        for model in models
    )


def cost_of(sweep: Sweep, throughput: Throughput) -> Cost:
    """Return the trials of a sweep that are left, and an estimate of their time on this machine."""
    left = done = 0
    seconds = 0.0
    known_of: dict[str, int] = {}
    for request in sweep:
        model, trials = request.setup.model, request.max_trials
        setup = request.setup
        condition = model, request.site_name, request.seed, setup.disturbances.text, protocol_sha256(setup.parameters)
        goals = possible_goals(setup.goals, setup.site)
        has = min(trials, sum(throughput.done.get((*condition, goal), 0) for goal in goals))
        done += has
        left += trials - has
        mean_s, episodes = throughput.seconds.get(model, (UNKNOWN_PACE_S, 0))
        known_of[model] = episodes
        seconds += (trials - has) * mean_s
    workers = sweep[0].workers.count or Capacity.of_this_machine().cores
    starting_s = STARTUP_S + NEXT_STARTUP_S * (len(sweep) - 1)
    return Cost(len(sweep), left + done, done, seconds / workers + starting_s, workers, sum(known_of.values()))


def run_sweep(sweep: Sweep, operators: OperatorProvider, viewer: EpisodeViewer | None = None) -> Iterator[Swept]:
    """Run the campaigns one after another, and yield the result of each.

    A campaign that cannot run does not stop the others. Workers of this machine stay from campaign to campaign.

    Raises:
        Stopped: a person or the system asked to stop; what happened until then is recorded.
    """
    total, before = sum(request.max_trials for request in sweep), 0
    with SharedWorkers() as shared:
        for number, request in enumerate(sweep, start=1):
            label = f"{number}/{len(sweep)} seed {request.seed}"
            in_sweep = replace(operators, label=label, before=before, of_sweep=total)
            try:
                yield Swept(request, launch(request.ready(), in_sweep, viewer, shared))
            except NoGoalPresentError as absent:
                logger.warning("%s", absent)
                yield Swept(request, absent)
            except VsnbenchError as error:
                logger.warning("%s: %s", request.label, error)
                yield Swept(request, error)
            before += request.max_trials


def undone(swept: Sequence[Swept]) -> tuple[int, int]:
    """Return the number of trials of a sweep that are left, and of campaigns that could not run."""
    failed = sum(campaign.session is None and not campaign.is_skipped for campaign in swept)
    results = [result for campaign in swept if (result := campaign.session) is not None]
    return sum(result.left + result.elsewhere for result in results), failed
