"""From what a person asked for to a running campaign: everything is checked before anything moves or is written.

Its trials are run by this process alone with its robot, or by workers that it hands them out to.
"""

import logging
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from vsnbench.database.campaign_plan import CampaignPlan, OpenCampaign
from vsnbench.database.journal import Journal
from vsnbench.database.migrate import get_ready
from vsnbench.database.provenance import Provenance, gather_provenance
from vsnbench.database.study_queries import study_of_campaign
from vsnbench.errors import SiteError, UsageError
from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import Site
from vsnbench.protocol.survey.check import layout_findings
from vsnbench.protocol.survey.finding import Severity, SiteFinding
from vsnbench.protocol.survey.starts import start_findings
from vsnbench.record.entries import EpisodeViewer
from vsnbench.record.results import Kept
from vsnbench.robots.contract import Glimpse, ReadBattery, SeenDriving, battery_of
from vsnbench.runner.attendance import Attendance, Occasion
from vsnbench.runner.bench import Bench, BenchDescription, BenchPlan, open_bench, tell_of_stand_in
from vsnbench.runner.leftovers import sweep_results
from vsnbench.runner.pool.capacity import ClusterWish, Wish, wish_of
from vsnbench.runner.pool.cluster import RayTasks
from vsnbench.runner.pool.contract import TrialPool
from vsnbench.runner.pool.handing_out import hand_out
from vsnbench.runner.pool.local import LocalPool, SharedWorkers
from vsnbench.runner.pool.merging import MergingPool
from vsnbench.runner.pool.messages import Keeping
from vsnbench.runner.pool.process import dismiss_fork_server
from vsnbench.runner.recorder import EpisodeRecorderFanOut, RecordingTarget
from vsnbench.runner.request import RunRequest
from vsnbench.runner.selection import choose_starts, is_surveyed, most_goals, named_site, plan_trials
from vsnbench.runner.session import VOID_IN_A_ROW, DrivingModel, Judged, SessionResult, Stage, run_session
from vsnbench.runner.stopping import Stopping

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Launched:
    """A campaign, and what the session just run has made of it."""

    campaign: OpenCampaign
    result: SessionResult


def launch(
    request: RunRequest,
    attendance: Attendance,
    viewer: EpisodeViewer | None = None,
    shared: SharedWorkers | None = None,
) -> Launched:
    """Run the trials of the campaign that are left.

    Args:
        request: what was asked for.
        attendance: finds whoever stands beside the robot.
        viewer: whoever shows or copies the episodes, where copies are kept.
        shared: workers that other campaigns are run with too.

    Raises:
        UsageError: something named does not exist or does not fit together; nothing was written.
        VsnbenchError: the site, model, robot or record cannot be used.
        Stopped: a person or the system asked to stop; what happened until then is recorded.
    """
    site = named_site(request.site)
    starts = choose_starts(request.starts, site)
    parameters = ProtocolParameters(max_actions=request.max_steps)
    surveyed = is_surveyed(request.site)
    if surveyed:
        _heed(request.site, layout_findings(site))
    bench = request.bench_plan(site, parameters)
    trials = most_goals(request.goals, site) * len(starts) * request.repetitions
    if request.keeps is not Kept.FULL:
        viewer = None
    live = viewer is not None and viewer.is_live
    wish = wish_of(request.workers, bench, trials, live=live, attended=request.attended)
    if isinstance(wish, ClusterWish) or wish.at_most > 1:
        get_ready(request.results.database_url)  # while the workers do
    with ExitStack() as stack:
        crew = stack.enter_context(open_crew(bench, wish, shared))
        described = crew.description
        tell_of_stand_in(described)
        profile = described.robot.profile
        if request.keeps is Kept.NUMBERS and not described.robot.simulated:
            raise UsageError(
                f"--record numbers: robot {profile.name} is real, and what it saw cannot be drawn again",
                advice="keep its images: --record lean",
            )
        if surveyed:
            heed_survey(request.site, site, profile.base.radius_m, parameters)
        if described.needs_a_person:
            attendance.require(profile)
        plan = CampaignPlan(
            site=site,
            robot=described.robot,
            model=described.model,
            protocol=parameters,
            seed=request.seed,
            trials=plan_trials(
                described.goals, starts, request.repetitions, request.seed if request.shuffle else None, site.excluded
            ),
            conditions=described.conditions,
        )
        request.results.prepare()
        provenance = crew.provenance()
        journal = stack.enter_context(Journal.open(request.results.database_url, provenance))
        if study := study_of_campaign(journal.engine, plan.key):
            raise UsageError(
                f"these trials belong to the locked study {study!r}, which alone may run them",
                advice="`vsnbench study run` goes on with it; another --seed is a campaign of its own",
            )
        campaign = journal.find_or_create_campaign(plan)
        if change := journal.model_change(campaign, plan.model):
            logger.warning("campaign %d is a new one: %s", campaign.id, change)
        if viewer is not None:
            viewer.prepare()
        sweep_results(request.results, journal)
        stop = stack.enter_context(Stopping())
        stop.last_acts.append(crew.halt)
        journal.patience.gives_up = lambda: stop.session_ends
        outcomes = journal.standing(campaign).outcomes
        occasion = Occasion(
            label=f"{described.card.name} in {site.name}",
            trials=len(campaign.trials),
            done=len(outcomes),
            successes=sum(outcomes),
            parameters=parameters,
            needs_a_person=described.needs_a_person,
            halt=crew.halt,
            stop=stop,
            site=site,
            robot_radius_m=profile.base.radius_m,
            journal=journal,
            results=request.results,
            campaigns=(campaign.id,),
            operator=provenance.operator,
            most_void=1 if request.fail_fast else VOID_IN_A_ROW,
            glimpse=crew.glimpse,
            battery=crew.battery,
            keeps=f"--record {request.keeps}: {request.keeps.words}",
        )
        keeping = Keeping(campaign, request.results, viewer, provenance.operator)
        result = crew.run(journal, keeping, attendance, occasion)
    return Launched(campaign, result)


def _heed(site: str, findings: Iterable[SiteFinding]) -> None:
    """Refuse a site with errors before anything is built on it, and pass its warnings on."""
    found = list(findings)
    errors = [finding for finding in found if finding.severity is Severity.ERROR]
    if errors:
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        raise SiteError(f"site {site}: {errors[0].message}{more}; vsnbench sites check {site} tells everything")
    for finding in found:
        logger.warning("site %s: %s", site, finding.message)


def heed_survey(name: str, site: Site, radius_m: float, parameters: ProtocolParameters) -> None:
    """Refuse a site of one's own whose starts or goals a robot of this radius cannot use; pass its warnings on.

    Raises:
        SiteError: the first error found.
    """
    _heed(name, start_findings(site, free_space(site, radius_m), parameters))


class Crew(Protocol):
    """One who runs trials, or many."""

    @property
    def description(self) -> BenchDescription:
        """The robot and the model, as every trial of the campaign has them."""
        ...

    @property
    def glimpse(self) -> Glimpse | None:
        """What its robot's camera sees while it drives; None for many robots, and for one that does not say."""
        ...

    @property
    def battery(self) -> ReadBattery:
        """What its robot's base says of its battery."""
        ...

    def provenance(self) -> Provenance:
        """Describe this process, as far as it has a hand in the results."""
        ...

    def halt(self) -> None:
        """Stand everything still that moves, from any thread; before the process is ended for certain."""
        ...

    def run(self, journal: Journal, keeping: Keeping, attendance: Attendance, occasion: Occasion) -> SessionResult:
        """Run what is left of the campaign.

        Raises:
            Stopped: a person or the system asked to stop; what happened until then is recorded.
            VsnbenchError: nothing more can be run or kept.
        """
        ...


@contextmanager
def open_crew(plan: BenchPlan, wish: Wish | ClusterWish, shared: SharedWorkers | None = None) -> Iterator[Crew]:
    """Make the bench here for one, start workers for more, or have a cluster's.

    Args:
        plan: what every trial is run with.
        wish: how many run trials, and where.
        shared: workers of this machine that may be there already, and stay; others end with the crew.

    Raises:
        UsageError: something named does not exist, does not fit together, or does not fit into memory.
        VsnbenchError: the model, the robot or the cluster cannot be used.
    """
    if isinstance(wish, ClusterWish):
        with MergingPool(RayTasks(plan, wish.address, wish.workers, wish.gpus_each)) as pool:
            yield _Several(plan, pool)
    elif wish.at_most == 1:
        dismiss_fork_server()
        with open_bench(plan) as bench:
            yield _Alone(plan, bench)
    elif shared is not None:
        with shared.made_ready(plan, wish) as local:
            yield _Several(plan, local)
    else:
        with LocalPool(plan, wish) as local:
            yield _Several(plan, local)


class _Alone:
    """This process, with its bench and whoever stands beside the robot."""

    def __init__(self, plan: BenchPlan, bench: Bench) -> None:
        self._plan = plan
        self._bench = bench
        self.description = bench.description
        self.glimpse = bench.robot.glimpse if isinstance(bench.robot, SeenDriving) else None
        self.battery = battery_of(bench.robot)

    def provenance(self) -> Provenance:
        return self._bench.provenance()

    def halt(self) -> None:
        self._bench.robot.halt()

    def run(self, journal: Journal, keeping: Keeping, attendance: Attendance, occasion: Occasion) -> SessionResult:
        described = self.description
        target = RecordingTarget(
            journal,
            keeping.results,
            described.title,
            described.robot.profile,
            keeping.viewer,
            keeping.operator,
            self._plan.kept,
        )
        with attendance.attend(occasion) as attendant:
            return run_session(
                Stage(journal, self._bench.robot, Judged(journal, attendant, keeping.operator), occasion.stop),
                DrivingModel(self._bench.policy, partial(EpisodeRecorderFanOut, target), described.title),
                keeping.campaign,
                self._plan.site,
                self._plan.parameters,
                occasion.most_void,
            )


class _Several:
    """Workers, none of which anybody stands beside."""

    def __init__(self, plan: BenchPlan, pool: TrialPool) -> None:
        self._plan = plan
        self._pool = pool
        self.description = pool.description
        self.glimpse, self.battery = None, lambda: None

    def provenance(self) -> Provenance:
        return gather_provenance()

    def halt(self) -> None:
        self._pool.kill()

    def run(self, journal: Journal, keeping: Keeping, attendance: Attendance, occasion: Occasion) -> SessionResult:
        site, parameters = self._plan.site, self._plan.parameters
        with attendance.oversee(occasion) as overview:
            return hand_out(journal, keeping, site, parameters, self._pool, overview, occasion.stop, occasion.most_void)
