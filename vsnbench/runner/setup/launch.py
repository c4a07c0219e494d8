"""Runs a campaign from a request. Everything is checked before a robot moves or anything is written."""

import logging
import math
import os
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import replace

from vsnbench.errors import SiteError, UsageError
from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import TEMPORARY_RESULTS, KeepFiles
from vsnbench.results.files.episode_entries import EpisodeViewer
from vsnbench.results.schema.migrate import get_ready
from vsnbench.results.studies.queries import study_that_claims
from vsnbench.results.writing.campaigns import CampaignPlan, OpenCampaign, Trial
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.disturbances.fit import check_before_opening, warn_of_unused
from vsnbench.runner.episode.recorder import RecordingOptions
from vsnbench.runner.executors.backends import open_executor
from vsnbench.runner.executors.capacity import worker_request
from vsnbench.runner.executors.local_pool import SharedWorkers
from vsnbench.runner.loop.campaign import CampaignSource
from vsnbench.runner.loop.contract import Session, SessionResult
from vsnbench.runner.loop.follow_up import DEFAULT_VOID_LIMIT, VoidLimit
from vsnbench.runner.operator.contract import TrialCounts
from vsnbench.runner.operator.provider import OperatorProvider
from vsnbench.runner.session import run_session
from vsnbench.runner.setup.execution import check_stack_without_person, rules_for
from vsnbench.runner.setup.request import RunRequest
from vsnbench.runner.setup.selection import is_surveyed, plan_trials
from vsnbench.runner.setup.trial_setup import (
    SetupDescription,
    warn_of_assumptions,
    warn_of_camera,
    warn_of_default_weights,
)
from vsnbench.runtime.child_process import hide_memory
from vsnbench.site_checks.check import layout_findings
from vsnbench.site_checks.finding import Severity, SiteFinding
from vsnbench.site_checks.starts import start_findings
from vsnbench.sites.site import Site

logger = logging.getLogger(__name__)


def launch(
    request: RunRequest,
    operators: OperatorProvider,
    viewer: EpisodeViewer | None = None,
    shared: SharedWorkers | None = None,
) -> SessionResult:
    """Run the remaining trials of a campaign, whose request is for its site (`RunRequest.at`).

    `viewer` shows or copies the episodes, where copies are kept; `shared` are workers that other campaigns use as well.

    Raises:
        UsageError: something named does not exist or does not fit together; nothing was written.
        VsnbenchError: the site, model, robot or results cannot be used.
        Stopped: a person or the system asked to stop; what happened until then is recorded.
    """
    spec, results = request.setup, request.results
    spec = replace(spec, parameters=rules_for(spec.model, spec.parameters))
    request = replace(request, setup=spec)
    check_before_opening(spec.disturbances, spec.robot, rehearsal=spec.rehearsal)
    is_kept = request.practice is None and not os.environ.get(TEMPORARY_RESULTS)
    note = results.new_record_note if is_kept else ""
    surveyed = is_surveyed(request.site)
    if surveyed:
        _check_findings(request.site, layout_findings(spec.site))
    if spec.isolation is not None:
        hide_memory()  # of this process; the model's process hides its own
    if spec.keep is not KeepFiles.ALL:
        viewer = None
    live = viewer is not None and viewer.is_live
    workers = worker_request(request.workers, spec, request.max_trials, live=live, attended=request.attended)
    if workers is None or workers.limit > 1:
        get_ready(results.database_url)  # while the workers start
    with ExitStack() as stack:
        robots = stack.enter_context(open_executor(spec, workers, request.workers, shared))
        plan = _checked_plan(request, robots.description)
        if surveyed:
            check_survey(request.site, spec.site, robots.robot.profile.base.radius_m, spec.parameters)
        if robots.controls is not None:
            operators.require_page(robots.controls)
            robots.controls.practice = request.practice is not None
        if robots.needs_operator:
            operators.require(robots.robot.profile)
        if not operators.is_present(needed=robots.needs_operator):
            check_stack_without_person(robots.description.card)
        results.prepare()
        provenance = robots.provenance()
        journal = stack.enter_context(Journal.open(results.database_url, provenance))
        campaign = _open_campaign(journal, plan)
        outcomes = journal.campaign_progress(campaign).outcomes
        disturbed = f" with {spec.disturbances.text}" if spec.disturbances else ""
        disturbed += "" if spec.parameters.execution is None else f", {spec.parameters.execution.text}"
        session = Session(
            journal=journal,
            robots=robots,
            recording=RecordingOptions(results, viewer, provenance.operator, spec.keep),
            site=spec.site,
            parameters=spec.parameters,
            disturbances=spec.disturbances,
            label=f"{robots.description.card.name} in {spec.site.name}{disturbed}",
            trials=TrialCounts(len(campaign.trials), len(outcomes), sum(outcomes)),
            campaign_ids=(campaign.id,),
            recording_note=spec.keep.note(note),
        )
        limit = VoidLimit(1 if request.fail_fast else DEFAULT_VOID_LIMIT)
        result = run_session(session, operators, lambda begun: CampaignSource(begun, campaign, limit))
    if session.stop_requests.session_ends:  # requested after the last trial: no other campaign of a sweep may begin
        session.stop_requests.act_now()
    return result


def _checked_plan(request: RunRequest, description: SetupDescription) -> CampaignPlan:
    """Return the plan of a campaign with this setup; logs what is doubtful.

    Raises:
        UsageError: images would be dropped that cannot be rendered again, or no trial is left.
    """
    spec = request.setup
    warn_of_default_weights(description)
    warn_of_assumptions(description.card, spec.parameters)
    warn_of_camera(description)
    warn_of_unused(spec.disturbances, description.card.name, description.card.sensors)
    if spec.keep is KeepFiles.NONE and not description.robot.simulated:
        raise UsageError(
            f"--keep none: robot {description.robot.profile.name} is real, so its images cannot be rendered again",
            advice="keep its images: --keep images",
            code="images-needed",
        )
    return CampaignPlan(
        site=spec.site,
        robot=description.robot,
        model=description.card,
        protocol=spec.parameters,
        seed=request.seed,
        trials=_trials(request, description.goals),
        conditions=description.conditions,
    )


def _trials(request: RunRequest, goals: Sequence[str]) -> tuple[Trial, ...]:
    """Return the trials of a campaign; of practice only the first, repeated if there are fewer.

    Raises:
        UsageError: no trial is left.
    """
    starts, excluded = request.start_numbers, request.setup.site.excluded
    trials = plan_trials(goals, starts, request.repetitions, excluded)
    if request.practice is None:
        return trials
    rounds = math.ceil(request.practice / len(trials))
    return plan_trials(goals, starts, request.repetitions * rounds, excluded)[: request.practice]


def _open_campaign(journal: Journal, plan: CampaignPlan) -> OpenCampaign:
    if refusal := study_that_claims(journal.engine, plan):
        raise UsageError(
            refusal,
            advice="`vsnbench study run` continues it; another --seed makes a separate campaign",
            code="campaign-of-a-study",
        )
    campaign = journal.find_or_create_campaign(plan)
    if change := journal.model_change(campaign, plan.model):
        logger.warning("campaign %d is new: %s", campaign.id, change)
    return campaign


def _check_findings(site: str, findings: Iterable[SiteFinding]) -> None:
    """Refuse a site with errors, and log its warnings."""
    found = list(findings)
    errors = [finding for finding in found if finding.severity is Severity.ERROR]
    if errors:
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        raise SiteError(f"site {site}: {errors[0].message}{more}; vsnbench sites check {site} shows all findings")
    for finding in found:
        logger.warning("site %s: %s", site, finding.message)


def check_survey(name: str, site: Site, radius_m: float, parameters: ProtocolParameters) -> None:
    """Refuse a surveyed site with starts or goals that a robot of this radius cannot use, and log its warnings.

    Raises:
        SiteError: the first error found.
    """
    _check_findings(name, start_findings(site, free_space(site, radius_m), parameters))
