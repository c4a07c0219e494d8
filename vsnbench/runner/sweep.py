"""Many campaigns as one plan: every model in every site with every seed, each of them a run like any other."""

import logging
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace

from vsnbench.database.pace import Pace
from vsnbench.errors import UsageError, VsnbenchError
from vsnbench.lab_file import BUILT_IN_SITE
from vsnbench.models.registry import locate
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site
from vsnbench.record.entries import EpisodeViewer
from vsnbench.robots.registry import is_simulated
from vsnbench.runner.attendance import Attendance, Occasion
from vsnbench.runner.attendant import Attendant, Overview
from vsnbench.runner.launch import Launched, launch
from vsnbench.runner.pool.capacity import Capacity
from vsnbench.runner.pool.local import SharedWorkers
from vsnbench.runner.request import RunRequest
from vsnbench.runner.selection import TWIN, choose_starts, most_goals, named_goals, named_site, read_numbers

logger = logging.getLogger(__name__)

TWINS = "twins:"
"""Before numbers, in `--sites`: generated flats by their seeds."""
UNKNOWN_PACE_S = 3.0
"""What a trial is taken to need while the record knows of none: the embedded models need 1 to 3 s."""
STARTUP_S = 6.0
"""What the first campaign needs before its first trial; the workers of the others are there."""
NEXT_STARTUP_S = 2.0
"""What every other one needs."""
MOST_CAMPAIGNS = 100_000


@dataclass(frozen=True, slots=True)
class Sweep:
    """The campaigns of a sweep, in the order in which they are run, and how many trials each has at most."""

    requests: tuple[RunRequest, ...]
    trials: tuple[int, ...]
    site_names: tuple[str, ...]
    """What the site of each is called in the record."""


@dataclass(frozen=True, slots=True)
class Cost:
    """What is left of a sweep, and what it will take."""

    campaigns: int
    trials: int
    done: int
    seconds: float
    workers: int
    known_from: int
    """Episodes of the record that the estimate rests on; 0 where nothing is known yet."""


@dataclass(frozen=True, slots=True)
class Swept:
    """What became of a campaign of a sweep."""

    request: RunRequest
    launched: Launched | None
    error: str = ""
    """Why it could not be run."""


def plan_sweep(request: RunRequest, models: str, seeds: str | None, sites: str | None) -> Sweep:
    """Return the campaigns of every model, site and seed; whatever can be refused is refused now.

    The seeds are the outermost: a sweep that is stopped half-way has something of every model and site.

    Args:
        request: what they have in common.
        models: names, separated by commas.
        seeds: numbers and ranges; the request's own when None.
        sites: names, separated by commas, and generated flats as `twins:0-19`; the request's own when None.

    Raises:
        UsageError: something does not exist or does not fit together.
        SiteError: a site's file breaks the format.
    """
    if not is_simulated(request.robot):
        raise UsageError(
            f"a sweep is run in simulation, and robot {request.robot} is not simulated", advice="give one campaign"
        )
    if sites is not None and request.site != BUILT_IN_SITE:
        raise UsageError("both --site and --sites were given", advice="give one of them")
    if seeds is not None and request.seed:
        raise UsageError("both --seed and --seeds were given", advice="give one of them")
    names = list(dict.fromkeys(name.strip() for name in models.split(",") if name.strip()))
    if len(names) > 1 and request.model_options:
        options = ", ".join(f"--{name.replace('_', '-')}" for name in request.model_options)
        raise UsageError(f"{options} is for one model, and there are {len(names)}", advice="sweep each on its own")
    for name in names:
        locate(name)
    named_goals(request.goals)
    numbers = (request.seed,) if seeds is None else read_numbers(seeds, "--seeds", "0-9")
    places = (request.site,) if sites is None else read_sites(sites)
    if (count := len(numbers) * len(places) * len(names)) > MOST_CAMPAIGNS:
        raise UsageError(f"that is {count:,} campaigns, more than {MOST_CAMPAIGNS:,}", advice="sweep a part of it")
    trials: dict[str, int] = {}
    called: dict[str, str] = {}
    sample: Site | None = None
    for place in places:
        if place.startswith(TWIN) and sample is not None:
            site = sample  # flats are much alike; each is drawn when its turn comes
            called[place] = f"twin-{place.removeprefix(TWIN)}"
        else:
            site = named_site(place)
            sample = site if place.startswith(TWIN) else sample
            called[place] = site.name
        trials[place] = most_goals(request.goals, site) * len(choose_starts(request.starts, site)) * request.repetitions
    requests = tuple(
        replace(request, model=model, site=place, seed=seed) for seed in numbers for place in places for model in names
    )
    return Sweep(requests, tuple(trials[one.site] for one in requests), tuple(called[one.site] for one in requests))


def read_sites(asked: str) -> tuple[str, ...]:
    """Return the sites that text like `apartment,twins:0-19` names.

    Raises:
        UsageError: a part of it is none.
    """
    places: dict[str, None] = {}
    in_twins = False
    for part in (part.strip() for part in asked.split(",")):
        if part.partition(":")[0] in (TWINS[:-1], TWIN[:-1]):
            in_twins, part = True, part.partition(":")[2]  # noqa: PLW2901 - what follows the colon
        elif not part[:1].isdecimal():
            in_twins = False
        if in_twins:
            numbers = read_numbers(part, "--sites", "twins:0-19, the seeds of flats", typed=asked)
            places |= dict.fromkeys(f"{TWIN}{number}" for number in numbers)
        elif part:
            places[part] = None
        else:
            raise UsageError(f"cannot read --sites {asked}", advice="give sites like apartment,twins:0-19")
    return tuple(places)


def cost_of(sweep: Sweep, pace: Pace) -> Cost:
    """Say what is left of a sweep, and what it will take on this machine."""
    left = done = 0
    seconds = 0.0
    known = 0
    for request, trials, site in zip(sweep.requests, sweep.trials, sweep.site_names, strict=True):
        has = min(trials, pace.done.get((request.model, site, request.seed), 0))
        done += has
        left += trials - has
        mean_s, episodes = pace.seconds.get(request.model, (UNKNOWN_PACE_S, 0))
        known = max(known, episodes)
        seconds += (trials - has) * mean_s
    workers = sweep.requests[0].workers.count or Capacity.of_this_machine().cores
    starting_s = STARTUP_S + NEXT_STARTUP_S * (len(sweep.requests) - 1)
    return Cost(len(sweep.requests), left + done, done, seconds / workers + starting_s, workers, known)


def run_sweep(sweep: Sweep, attendance: Attendance, viewer: EpisodeViewer | None = None) -> Iterator[Swept]:
    """Run one campaign after another, and yield what became of each; one that cannot be run holds up no other.

    Workers of this machine stay from campaign to campaign: they are told to make the next one's bench.

    Raises:
        Stopped: a person or the system asked to stop; what happened until then is recorded.
    """
    total, before = sum(sweep.trials), 0
    with SharedWorkers() as shared:
        for place, (request, trials) in enumerate(zip(sweep.requests, sweep.trials, strict=True), start=1):
            label = f"{place}/{len(sweep.requests)} seed {request.seed}"
            beside = _OfSweep(attendance, label, before, total)
            try:
                yield Swept(request, launch(request, beside, viewer, shared))
            except VsnbenchError as error:
                logger.warning("%s in %s with seed %d: %s", request.model, request.site, request.seed, error)
                yield Swept(request, None, str(error))
            before += trials


@dataclass(frozen=True, slots=True)
class _OfSweep:
    """Shows a campaign's progress as a part of the sweep's."""

    attendance: Attendance
    label: str
    before: int
    total: int

    def require(self, profile: RobotProfile) -> None:
        self.attendance.require(profile)

    def attend(self, occasion: Occasion) -> AbstractContextManager[Attendant]:
        return self.attendance.attend(self._part(occasion))

    def oversee(self, occasion: Occasion) -> AbstractContextManager[Overview]:
        return self.attendance.oversee(self._part(occasion))

    def _part(self, occasion: Occasion) -> Occasion:
        beside = (self.before, max(self.total - occasion.trials, self.before))
        return replace(occasion, label=f"{self.label}: {occasion.label}", beside=beside, keeps="")


def undone(swept: Sequence[Swept]) -> tuple[int, int]:
    """Return how many trials of a sweep are left, and how many campaigns could not be run."""
    ran = [one.launched.result for one in swept if one.launched is not None]
    return sum(result.left + result.elsewhere for result in ran), sum(1 for one in swept if one.launched is None)
