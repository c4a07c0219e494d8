"""From what a person asked for to a running campaign: everything is checked before anything moves or is written."""

import logging
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from vsnbench.database.campaign_plan import CampaignPlan, ModelIdentity, OpenCampaign
from vsnbench.database.journal import Journal
from vsnbench.database.provenance import Provenance, gather_provenance
from vsnbench.errors import SiteError, UsageError
from vsnbench.harmless_text import error_line
from vsnbench.models.contract import Policy, SurveyedPolicy
from vsnbench.models.identity import code_of, files_handed_over
from vsnbench.models.registry import create_policy
from vsnbench.models.remote.isolation import Isolation
from vsnbench.models.timed import timed
from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.observation import Sensor
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import embedded_sites, load_site
from vsnbench.protocol.survey.check import layout_findings
from vsnbench.protocol.survey.finding import Severity, SiteFinding
from vsnbench.protocol.survey.starts import start_findings
from vsnbench.record.entries import EpisodeViewer
from vsnbench.record.results import ResultsDirectory
from vsnbench.robots.contract import PlacedByHand, Robot
from vsnbench.robots.registry import identity_of, open_robot
from vsnbench.runner.attendance import Attendance, Occasion
from vsnbench.runner.campaign import choose_goals, choose_starts, plan_trials
from vsnbench.runner.leftovers import sweep_results
from vsnbench.runner.recorder import EpisodeRecorderFanOut, RecordingTarget
from vsnbench.runner.session import SessionResult, run_session
from vsnbench.runner.stopping import Stopping

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class RunRequest:
    """What `vsnbench run` was asked for, as it was typed."""

    model: str
    goals: tuple[str, ...]
    results: ResultsDirectory
    site: str = "apartment"
    robot: str = "simulated"
    starts: str | None = None
    repetitions: int = 1
    max_steps: int = 150
    seed: int = 0
    shuffle: bool = False
    noise: bool = False
    model_options: Mapping[str, Any] = field(default_factory=dict)
    act_timeout_s: float | None = None
    """How long a model in this process may take for an action; without end when None."""
    isolation: Isolation | None = None
    """Run the model in a process of its own."""


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
        viewer: whoever shows or copies the episodes.

    Raises:
        UsageError: something named does not exist or does not fit together; nothing was written.
        VsnbenchError: the site, model, robot or record cannot be used.
        Stopped: a person or the system asked to stop; what happened until then is recorded.
    """
    site = load_site(request.site)
    starts = choose_starts(request.starts, site)
    parameters = ProtocolParameters(max_actions=request.max_steps)
    surveyed = request.site not in embedded_sites()
    if surveyed:
        _heed(request.site, layout_findings(site))
    with ExitStack() as stack:
        policy = create_policy(request.model, request.isolation, **request.model_options)
        stack.callback(_close, policy)
        goals = choose_goals(request.goals, site, policy.card)
        robot = stack.enter_context(open_robot(request.robot, site, parameters, noise=request.noise))
        _check_sensors(policy, robot)
        _check_weights(policy, robot)
        if surveyed:
            _heed(
                request.site, start_findings(site, free_space(site, robot.identity.profile.base.radius_m), parameters)
            )
        by_hand = isinstance(robot, PlacedByHand) and robot.needs_a_person
        if by_hand:
            attendance.require(robot.identity.profile)
        plan = CampaignPlan(
            site=site,
            robot=identity_of(robot),
            model=_identity(request, policy),
            protocol=parameters,
            seed=request.seed,
            trials=plan_trials(
                goals, starts, request.repetitions, request.seed if request.shuffle else None, site.excluded
            ),
            conditions=robot.conditions,
        )
        request.results.prepare()
        journal = stack.enter_context(Journal.open(request.results.database_url, _provenance(policy)))
        campaign = journal.find_or_create_campaign(plan)
        if change := journal.model_change(campaign, plan.model):
            logger.warning("campaign %d is a new one: %s", campaign.id, change)
        if viewer is not None:
            viewer.prepare()
        operator = _provenance(policy).operator
        target = RecordingTarget(journal, request.results, _title(policy), robot.identity.profile, viewer, operator)
        sweep_results(request.results, journal)
        stop = stack.enter_context(Stopping())
        stop.last_acts.append(robot.halt)
        outcomes = journal.standing(campaign).outcomes
        occasion = Occasion(
            f"{_title(policy)} in {site.name}",
            len(campaign.trials),
            len(outcomes),
            sum(outcomes),
            parameters,
            by_hand,
            robot.halt,
            stop,
        )
        attendant = stack.enter_context(attendance.attend(occasion))
        journal.patience.gives_up = lambda: stop.session_ends
        result = run_session(
            journal,
            campaign,
            site,
            parameters,
            robot,
            policy if request.act_timeout_s is None else timed(policy, request.act_timeout_s),
            partial(EpisodeRecorderFanOut, target),
            attendant,
            stop,
            operator,
        )
    return Launched(campaign, result)


def _close(policy: Policy) -> None:
    """Let the policy go; what it raises then changes no result."""
    try:
        getattr(policy, "close", lambda: None)()
    except Exception as error:
        logger.warning("model %s failed in close: %s", policy.card.name, error_line(error))


def _provenance(policy: Policy) -> Provenance:
    """Describe this process, and where in it the model runs."""
    here = gather_provenance()
    runs_on = {f"model_{name}": str(value) for name, value in policy.card.runs_on.items()}
    return replace(here, platform={**here.platform, **runs_on})


def _identity(request: RunRequest, policy: Policy) -> ModelIdentity:
    card = policy.card
    return ModelIdentity(
        name=card.name,
        goals=card.goals,
        sensors=frozenset(sensor.value for sensor in card.sensors),
        weights_sha256=card.weights_sha256,
        weights_label=card.weights_label,
        settings=card.settings,
        surveyed=isinstance(policy, SurveyedPolicy),
        files=files_handed_over(request.model, policy, request.model_options),
        code=code_of(policy),
    )


def _title(policy: Policy) -> str:
    card = policy.card
    return f"{card.name} ({card.weights_label})" if card.weights_label else card.name


def _check_sensors(policy: Policy, robot: Robot) -> None:
    missing = policy.card.sensors - robot.sensors
    who = robot.identity.profile.name
    if missing:
        labels = Sensor.INSTANCES in missing
        raise UsageError(
            f"model {policy.card.name} needs {', '.join(sorted(missing))}, which robot {who} does not "
            f"have; it has {', '.join(sorted(robot.sensors))}"
            + ("; instances are the simulator's own labels: give the model a real detector's weights" if labels else "")
        )


def _check_weights(policy: Policy, robot: Robot) -> None:
    if policy.card.stand_in and not robot.identity.simulated:
        raise UsageError(
            f"model {policy.card.name}: robot {robot.identity.profile.name} is real, and nothing was named to drive "
            f"it but the {policy.card.weights_label}",
            advice="name your weights with --weights FILE, or these with --weights embedded",
        )
    if policy.card.stand_in:
        logger.warning("%s runs on %s; name others with --weights FILE", policy.card.name, policy.card.weights_label)


def _heed(site: str, findings: Iterable[SiteFinding]) -> None:
    """Refuse a site with errors before anything is built on it, and pass its warnings on."""
    found = list(findings)
    errors = [finding for finding in found if finding.severity is Severity.ERROR]
    if errors:
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        raise SiteError(f"site {site}: {errors[0].message}{more}; vsnbench sites check {site} tells everything")
    for finding in found:
        logger.warning("site %s: %s", site, finding.message)
