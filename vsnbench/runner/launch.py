"""From what a person asked for to a running campaign: everything is checked before anything moves or is written."""

import logging
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

from vsnbench.database.campaign_plan import CampaignPlan, OpenCampaign
from vsnbench.database.journal import Journal
from vsnbench.database.study_queries import study_of_campaign
from vsnbench.errors import SiteError, UsageError
from vsnbench.models.remote.isolation import Isolation
from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import Site
from vsnbench.protocol.survey.check import layout_findings
from vsnbench.protocol.survey.finding import Severity, SiteFinding
from vsnbench.protocol.survey.starts import start_findings
from vsnbench.record.entries import EpisodeViewer
from vsnbench.record.results import Kept, ResultsDirectory
from vsnbench.runner.attendance import Attendance, Occasion
from vsnbench.runner.bench import BenchPlan, tell_of_stand_in
from vsnbench.runner.crew import WorkersAsked, open_crew, wish_of
from vsnbench.runner.leftovers import sweep_results
from vsnbench.runner.pool.messages import Keeping
from vsnbench.runner.selection import choose_starts, is_surveyed, most_goals, named_site, plan_trials
from vsnbench.runner.session import SessionResult
from vsnbench.runner.stopping import Stopping

logger = logging.getLogger(__name__)

DEFAULT_SITE = "apartment"


@dataclass(frozen=True, slots=True)
class RunRequest:
    """What `vsnbench run` was asked for, as it was typed."""

    model: str
    goals: tuple[str, ...]
    results: ResultsDirectory
    site: str = DEFAULT_SITE
    robot: str = "simulated"
    starts: str | None = None
    repetitions: int = 1
    max_steps: int = 150
    seed: int = 0
    shuffle: bool = False
    noise: bool = False
    pretend_real: bool = False
    """A simulated robot plays a real one: a rehearsal."""
    model_options: Mapping[str, Any] = field(default_factory=dict)
    act_timeout_s: float | None = None
    """How long a model in this process may take for an action; without end when None."""
    isolation: Isolation | None = None
    """Run the model in a process of its own."""
    workers: WorkersAsked = field(default_factory=WorkersAsked)
    """How many trials are run at once in simulation, and where."""
    kept: Kept = Kept.FULL
    """What is kept of an episode beside its rows."""

    def bench_plan(self, site: Site, parameters: ProtocolParameters) -> BenchPlan:
        """Return what every trial of it is run with."""
        return BenchPlan(
            site=site,
            model=self.model,
            goals=self.goals,
            robot=self.robot,
            noise=self.noise,
            pretend_real=self.pretend_real,
            parameters=parameters,
            model_options=self.model_options,
            act_timeout_s=self.act_timeout_s,
            isolation=self.isolation,
            kept=self.kept,
        )


@dataclass(frozen=True, slots=True)
class Launched:
    """A campaign, and what the session just run has made of it."""

    campaign: OpenCampaign
    result: SessionResult


def launch(request: RunRequest, attendance: Attendance, viewer: EpisodeViewer | None = None) -> Launched:
    """Run the trials of the campaign that are left.

    Args:
        request: what was asked for.
        attendance: finds whoever stands beside the robot.
        viewer: whoever shows or copies the episodes, where copies are kept.

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
    if request.kept is not Kept.FULL:
        viewer = None
    wish = wish_of(request.workers, bench, trials, live=viewer is not None and viewer.is_live)
    with ExitStack() as stack:
        crew = stack.enter_context(open_crew(bench, wish))
        described = crew.description
        tell_of_stand_in(described)
        profile = described.robot.profile
        if request.kept is Kept.NUMBERS and not described.robot.simulated:
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
            f"{described.card.name} in {site.name}",
            len(campaign.trials),
            len(outcomes),
            sum(outcomes),
            parameters,
            described.needs_a_person,
            crew.halt,
            stop,
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
