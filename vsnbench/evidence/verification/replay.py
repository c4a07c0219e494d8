"""Drives simulated episodes again, and compares poses, motions and digests of images exactly.

A built-in model without weights decides again from its seed. For every other model the recorded actions are driven. No
code that a record names is imported.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from sqlalchemy import Row

from vsnbench.evidence.verification.checks import Check, Finding, Progress, cell
from vsnbench.evidence.verification.record import RecordedCondition, VerifiedRecord
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.fit.camera import FIT_KEY
from vsnbench.models.names import BUILT_IN
from vsnbench.models.registry import create_policy
from vsnbench.protocol.disturbances import CURRENT_EDITION, EDITION
from vsnbench.protocol.judge import EndReason
from vsnbench.results.files.images import hash_images
from vsnbench.results.writing.campaigns import model_sha256
from vsnbench.results.writing.entries import EpisodeBegin, EpisodeEnd
from vsnbench.results.writing.lifecycle import EpisodeState
from vsnbench.results.writing.steps import step_row
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.episode import run_episode
from vsnbench.runner.episode.recorder import record_of_step
from vsnbench.runner.episode.step import EpisodePlan, Step
from vsnbench.runner.operator.contract import AbsentOperator
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.runtime.threads import compute_with_one_thread
from vsnbench.simulator.dynamics.noise import NoiseSettings
from vsnbench.simulator.dynamics.physics import simulator_version
from vsnbench.values.decision import Decision
from vsnbench.values.fix import Fix
from vsnbench.values.model.card import Anchor, copy_of
from vsnbench.values.movement import Action, ActionKind
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.step import StepRecord

NOT_DRIVEN = frozenset(
    {"episode_id", "recorded_at", "sense_s", "infer_s", "move_s", "details", "probabilities"}
    | {"rgb_file_digest", "depth_file_digest"}
)
"""Columns of a step that differ between two runs, or are the model's own notes."""
_WITHOUT_WEIGHTS = frozenset({"random", "forward", "oracle", "oracle-waypoints"})


def check_replay(record: VerifiedRecord, limit: int | None, progress: Progress) -> Check:
    """Drive simulated episodes again: all, or a number of them, spread evenly over the record."""
    check = Check("replay", "episodes")
    with check.failing("the record"):
        candidates = list(_candidates(record, check))
        count = len(candidates) if limit is None else min(limit, len(candidates))
        if count < len(candidates):
            check.skip("not asked for (--replay all)", len(candidates) - count)
        compute_with_one_thread()
        robots: dict[int, SimulatedRobot] = {}
        for done in range(count):
            episode = candidates[done * len(candidates) // count]
            with check.failing(f"episode {episode.id}"):
                condition = record.condition(episode.campaign_id)
                if condition.id not in robots:
                    robots = {condition.id: _robot(condition)}
                check.add(list(_replay(robots[condition.id], condition, episode, record.steps(episode.id))))
            progress("driving episodes again", done + 1, count)
    return check


def _candidates(record: VerifiedRecord, check: Check) -> Iterator[Row[Any]]:
    for episode in record.episodes():
        with check.failing(f"episode {episode.id}"):
            if reason := _obstacle(episode, record.condition(episode.campaign_id)):
                check.skip(reason)
            else:
                yield episode


def _obstacle(episode: Row[Any], condition: RecordedCondition) -> str:
    """Return why an episode cannot be driven again, or an empty string."""
    if not condition.is_simulated_here:
        return "not of the simulated robot"
    if episode.state != EpisodeState.JUDGED or not EndReason(episode.end_reason).is_result:
        return "ended without a result"
    if condition.site is None or condition.profile is None:
        return "its site or robot is not known"
    if condition.site.scan is not None and condition.site.scan.path is None:
        return "drawn from a scan that is not there (bundle --with-scan)"
    if condition.row.conditions.get("simulator") != simulator_version():
        return f"recorded with another simulator than {simulator_version()}"
    if condition.disturbances and condition.row.conditions.get(EDITION) != CURRENT_EDITION:
        return "recorded with another edition of the disturbances"
    execution = condition.parameters.execution
    if execution is not None and execution.latency_s is None:
        return "the robot drove on for as long as the model took, which depends on the machine"
    return ""


def _robot(condition: RecordedCondition) -> SimulatedRobot:
    noise = condition.row.conditions.get("noise")
    if condition.site is None or condition.profile is None:
        raise ValueError("its site or robot is not known")
    return SimulatedRobot(
        condition.site,
        condition.profile,
        condition.parameters,
        None if noise is None else NoiseSettings.model_validate(noise),
        frozenset({Sensor.RGB}),
    )


def _replay(
    robot: SimulatedRobot, condition: RecordedCondition, episode: Row[Any], steps: Sequence[StepRecord]
) -> Iterator[Finding]:
    policy = _built_in(condition) or _RecordedActions(steps, Anchor(condition.row.settings.get("anchor", "capture")))
    comparison = _Comparison(episode.id, steps)
    plan = EpisodePlan(
        robot.site,
        episode.goal,
        robot.site.start(episode.start),
        episode.seed,
        condition.parameters,
        condition.disturbances,
    )
    try:
        outcome = run_episode(robot, policy, plan, comparison, AbsentOperator(), StopRequests())
    finally:
        policy.close()
    yield from comparison.findings
    if not comparison.findings:
        if outcome.actions != len(steps):
            yield cell("episode", episode.id, "actions", f"{len(steps)} steps, and driven again {outcome.actions}")
        if outcome.verdict.end_reason != episode.end_reason:
            ended = outcome.verdict.end_reason
            yield cell("episode", episode.id, "end_reason", f"{episode.end_reason}, and driven again {ended}")


def _built_in(condition: RecordedCondition) -> Policy | None:
    """Return the built-in model of a campaign, if it decides without weights and is the same as in the record.

    A model whose images were cropped or disturbed is not run again: its recorded actions are driven.
    """
    row = condition.row
    if condition.disturbances or FIT_KEY in row.conditions:
        return None
    if row.name not in _WITHOUT_WEIGHTS or row.name not in BUILT_IN or row.code or row.files or row.weights_sha256:
        return None
    policy = create_policy(row.name)
    card = copy_of(policy.card, surveyed=policy.needs_survey).recorded({}, {})
    return policy if model_sha256(card) == row.model_sha256 else None


class _RecordedActions(Policy):
    """Answers with the recorded actions of an episode."""

    def __init__(self, steps: Sequence[StepRecord], anchor: Anchor) -> None:
        self.card = ModelCard(name="recorded actions", action_kinds=frozenset(ActionKind), anchor=anchor)
        self._steps = iter(steps)

    def reset(self, goal: str, seed: int) -> None:
        """Do nothing: the actions are known."""

    def act(self, observation: Observation) -> Decision:  # noqa: ARG002 - the actions are known
        """Return the next action; STOP after the last."""
        step = next(self._steps, None)
        if step is None:
            return Decision(Action.STOP)
        return Decision(step.action, raw_action=step.raw_action) if step.movement is None else Decision(step.movement)


@dataclass(slots=True)
class _Comparison:
    """Compares each step with its row; nothing is written. Ends with the first step that differs."""

    episode_id: int
    steps: Sequence[StepRecord]
    findings: list[Finding] = field(default_factory=list)

    def kept_photo(self, plan: EpisodePlan) -> bytes | None:
        """Return None, because a replay has no placement."""

    def begin(self, plan: EpisodePlan, start: Fix, begin: EpisodeBegin, view_jpeg: bytes | None = None) -> None:
        """Accept the begin."""

    def event(self, kind: str, text: str) -> None:
        """Ignore events."""

    def intervention(self, what: str, author: str = "") -> None:
        """Ignore interventions."""

    def end(self, outcome: EpisodeEnd) -> None:
        """Accept the end."""

    def step(self, step: Step) -> None:
        """Compare a step with its row."""
        if self.findings or step.index > len(self.steps):
            return
        recorded, driven = self.steps[step.index - 1], record_of_step(step, hash_images(step.observation))
        unknown: dict[str, Any] = {name: None for name in ("rgb_digest", "depth_digest") if not getattr(recorded, name)}
        was, now = step_row(0, replace(recorded, part=None)), step_row(0, replace(driven, part=None, **unknown))
        for column in was:
            if column not in NOT_DRIVEN and was[column] != now[column]:
                text = f"{was[column]!r}, and driven again {now[column]!r}"
                self.findings.append(cell("step", f"{self.episode_id}/{step.index}", column, text))
