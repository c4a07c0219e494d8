"""Judges recorded episodes again, from their poses, actions and site, and compares the verdicts.

Columns that follow from the steps (number of actions, duration, path, distances) are computed again as well.
"""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from sqlalchemy import Row

from vsnbench import __version__
from vsnbench.evidence.verification.checks import Check, Finding, Progress, cell
from vsnbench.evidence.verification.record import RecordedCondition, VerifiedRecord
from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.judge import (
    ROBOT_FAILURES,
    EndReason,
    GoalDistance,
    Verdict,
    distance_to_goal,
    end_after,
    judge,
    judge_sequence,
)
from vsnbench.protocol.limits import Spent
from vsnbench.protocol.metrics import path_length_m
from vsnbench.results.schema.row_encoding import fix_of_columns, pose_of_columns
from vsnbench.results.second_judgements import second_judgements
from vsnbench.results.writing.campaigns import trial_seed
from vsnbench.results.writing.entries import SequenceLeg, leg_of
from vsnbench.results.writing.lifecycle import ENDED, EpisodeState
from vsnbench.sites.targets import legs_of, targets_of
from vsnbench.text.sanitize import counted
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.pose import Pose
from vsnbench.values.robot_identity import IMPORTED
from vsnbench.values.step import StepRecord, taken_action

_TOLERANCE = 1e-6
"""Metres and seconds; the same computation on another machine can differ in the last digits."""


def check_judgements(record: VerifiedRecord, progress: Progress) -> tuple[Check, dict[str, int]]:
    """Judge every episode again.

    Returns:
        The check, and the number of verdicts of each person.
    """
    check = Check("verdicts", "episodes")
    people: Counter[str] = Counter()
    with check.failing("the record"):
        episodes = record.episodes()
        for done, episode in enumerate(episodes, start=1):
            with check.failing(f"episode {episode.id}"):
                verdicts = record.verdicts(episode.id)
                people.update(verdict.author for verdict in verdicts if verdict.source == "person")
                _check_episode(record, episode, verdicts, check)
            progress("judging episodes", done, len(episodes))
        seconds = Counter(second.rater for second in second_judgements(record.connection))
        check.notes += [
            f"judged a second time, by a person: {counted(n, 'episode')} by {rater}"
            for rater, n in sorted(seconds.items())
        ]
    return check, dict(people)


def _check_episode(record: VerifiedRecord, episode: Row[Any], verdicts: Sequence[Row[Any]], check: Check) -> None:
    if episode.state not in ENDED:
        check.skip("not ended")
    elif episode.origin == IMPORTED:
        check.skip("imported from another tool: no poses to judge")
    else:
        found = _EpisodeCheck(record, episode, verdicts)
        check.add(list(found.findings()))
        if found.other_wording:
            check.skip("wording of a verdict: written by another version")


class _EpisodeCheck:
    """Checks of one ended episode."""

    def __init__(self, record: VerifiedRecord, episode: Row[Any], verdicts: Sequence[Row[Any]]) -> None:
        self.episode, self.verdicts = episode, verdicts
        self.condition: RecordedCondition = record.condition(episode.campaign_id)
        self.parameters = self.condition.parameters
        self.steps = record.steps(episode.id)
        self.is_recovered = any(verdict.source == "recovery" for verdict in verdicts)
        self.was_retracted = record.was_retracted(episode.id)
        self.other_wording = False
        site = self.condition.site
        self.goals = (episode.goal,) if site is None else legs_of(site, episode.goal)
        self.legs: list[SequenceLeg] = []
        """The goals of a sequence, judged again."""
        self.recorded = [SequenceLeg(**leg) for leg in episode.legs or ()]
        self.start = pose_of_columns(episode.start_x_m, episode.start_y_m, episode.start_heading_rad)
        self.final = fix_of_columns(
            episode.final_x_m, episode.final_y_m, episode.final_heading_rad, episode.final_source
        )

    def findings(self) -> Iterator[Finding]:
        yield from self._counts()
        yield from self._end()
        yield from self._derived()
        yield from self._verdict()
        yield from self._state()

    def _cell(self, column: str, text: str) -> Finding:
        return cell("episode", self.episode.id, column, text)

    def _counts(self) -> Iterator[Finding]:
        numbers = [step.number for step in self.steps]
        if numbers != list(range(1, len(numbers) + 1)):
            yield cell("step", self.episode.id, "number", "the steps are not numbered from 1 without gaps")
        if self.episode.actions != len(numbers):
            yield self._cell("actions", f"{self.episode.actions}, and there are {len(numbers)} steps")
        expected = trial_seed(self.condition.row.seed, self.episode.goal, self.episode.start, self.episode.repetition)
        if self.episode.seed != expected:
            yield self._cell("seed", f"{self.episode.seed}, and its trial has {expected}")

    def _end(self) -> Iterator[Finding]:
        """Apply the rules for the end of an episode to every step."""
        spent, reason, before, begin = Spent(), None, self.start, self.start
        for step in self.steps:
            if reason is not None and reason.ends_leg and len(self.legs) + 1 < len(self.goals):
                self._add_leg(spent, reason, begin, before)
                spent, reason, begin = Spent(), None, before
            if reason is not None:
                yield cell("step", f"{self.episode.id}/{step.number}", "number", f"follows the end ({reason})")
                return
            spent, before = self._after(spent, step, before), self._world(step) or before
            reason = end_after(spent, taken_action(step.action, step.answer), step.result, self.parameters)
        recorded = EndReason(self.episode.end_reason)
        if len(self.goals) > 1:
            self._add_leg(spent, recorded, begin, self.final.pose if self.final else before)
            yield from self._legs()
        if recorded == reason or recorded is EndReason.INTERRUPTED:
            return
        if reason is None:
            if recorded.is_result:
                yield self._cell("end_reason", f"{recorded}, and no step ends the episode")
        elif not (reason in ROBOT_FAILURES and recorded in (*ROBOT_FAILURES, EndReason.ABORTED)) and not (
            reason is EndReason.STOP and recorded is EndReason.SENSOR_LOST and self.final is None
        ):
            yield self._cell("end_reason", f"{recorded}, and the steps end with {reason}")

    def _add_leg(self, spent: Spent, reason: EndReason, begin: Pose | None, end: Pose | None) -> None:
        """Judge a goal of a sequence again."""
        site, profile, goal = self.condition.site, self.condition.profile, self.goals[len(self.legs)]
        if site is None or profile is None or begin is None:
            raise ValueError("its site, robot or start is invalid")
        at = Fix(end, self.final.source if self.final else PoseSource.SIMULATED) if end is not None else None
        distance = None if at is None else distance_to_goal(site, goal, at, self.parameters)
        shortest_m = free_space(site, profile.base.radius_m).geodesic_to_goal_m(begin, goal, self.parameters)
        verdict = judge(reason, spent.actions, distance, self.parameters)
        memory = not self.legs or (len(self.recorded) > len(self.legs) and self.recorded[len(self.legs)].memory)
        self.legs.append(leg_of(len(self.legs) + 1, goal, verdict, spent, shortest_m, memory=memory))

    def _legs(self) -> Iterator[Finding]:
        """Compare the goals of a sequence with those judged again; of a real robot, only the last pose is recorded."""
        if len(self.recorded) != len(self.legs):
            yield self._cell("legs", f"{len(self.recorded)} goals, and the steps have {len(self.legs)}")
            return
        for recorded, expected in zip(self.recorded, self.legs, strict=True):
            for name, value in asdict(expected).items():
                measured = name in ("success", "distance_m", "goal_instance")
                if measured and not self.condition.is_simulated_here and expected is not self.legs[-1]:
                    continue
                found = getattr(recorded, name)
                close = isinstance(value, float) and isinstance(found, float)
                if not (
                    math.isclose(value, found, rel_tol=_TOLERANCE, abs_tol=_TOLERANCE) if close else found == value
                ):
                    yield self._cell(
                        "legs", f"{name} of goal {expected.position} is {found}, and the steps give {value}"
                    )

    def _after(self, spent: Spent, step: StepRecord, before: Pose | None) -> Spent:
        result, world = step.result, self._world(step)
        path_m = before.distance_to(world) if before is not None and world is not None else 0.0
        driving_s = result.duration_s if result is not None else 0.0
        thinking_s = step.timings.infer_s or 0.0
        if self.condition.row.simulated:  # only a disturbance takes time, once for each decision
            is_decision = step.part is None or step.part[0] == 1
            thinking_s = self.condition.disturbances["latency"] or 0.0 if is_decision else 0.0
        if result is not None and result.path_m is not None:
            path_m = max(path_m, result.path_m)
        return spent.after(driving_s=0.0 if math.isnan(driving_s) else driving_s, thinking_s=thinking_s, path_m=path_m)

    @staticmethod
    def _world(step: StepRecord) -> Pose | None:
        return step.world.pose if step.world is not None else None

    def _derived(self) -> Iterator[Finding]:
        """Compute the lengths and times of the episode again."""
        driving = [step.result.duration_s for step in self.steps if step.result is not None]
        if driving:
            yield from self._number("duration_s", math.fsum(driving))
        thinking = [step.timings.infer_s for step in self.steps]
        known = [infer_s for infer_s in thinking if infer_s is not None]
        yield from self._number("thinking_s", math.fsum(known) if known and len(known) == len(thinking) else math.nan)
        if self.is_recovered:  # the length is that of its motions, and its process did not measure the end
            return
        if self.start is None:
            if self.steps:
                yield self._cell("start_x_m", "missing, and the episode has steps")
            return
        poses = [self.start]
        for step in self.steps:
            if (pose := self._world(step)) is None:
                yield cell("step", f"{self.episode.id}/{step.number}", "world_x_m", "missing")
                return
            poses.append(pose)
        detour_m = 0.0
        for step, before, after in zip(self.steps, poses, poses[1:], strict=False):
            if step.result is not None and step.result.path_m is not None:
                detour_m += max(step.result.path_m - before.distance_to(after), 0.0)
        yield from self._number("path_length_m", path_length_m(poses) + detour_m)
        if self.condition.is_simulated_here and self.final is not None and self.final.pose != poses[-1]:
            yield self._cell("final_x_m", "the final pose is not that after the last step")
        site, profile = self.condition.site, self.condition.profile
        if len(self.goals) > 1:  # each goal has its own
            return
        if site is None or profile is None or not targets_of(site, self.episode.goal):
            return
        space, goal = free_space(site, profile.base.radius_m), self.episode.goal
        yield from self._number("geodesic_start_m", space.geodesic_to_goal_m(self.start, goal, self.parameters))
        if self.final is not None:
            remaining_m = space.remaining_m(self.final.pose, goal, self.parameters)
            yield from self._number("geodesic_end_m", remaining_m)
        elif self.episode.geodesic_end_m is not None:
            yield self._cell("geodesic_end_m", f"{self.episode.geodesic_end_m:.6g}, without a final pose")

    def _number(self, column: str, expected: float) -> Iterator[Finding]:
        """Compare a number; one that is not finite is NULL in the record."""
        recorded = getattr(self.episode, column)
        known = math.isfinite(expected)
        if recorded is None and known:
            yield self._cell(column, f"missing, and the steps give {expected:.6g}")
        elif recorded is not None and not known:
            yield self._cell(column, f"{recorded:.6g}, and the steps give no value")
        elif known and not math.isclose(recorded, expected, rel_tol=_TOLERANCE, abs_tol=_TOLERANCE):
            yield self._cell(column, f"{recorded:.6g}, and the steps give {expected:.6g}")

    def _verdict(self) -> Iterator[Finding]:
        own = [verdict for verdict in self.verdicts if verdict.source in ("protocol", "recovery")]
        if not own:
            yield cell("verdict", f"of episode {self.episode.id}", "source", "the protocol's verdict is missing")
            return
        given, reason = own[0], EndReason(self.episode.end_reason)
        if self.final is None and self._needs_final_pose(reason):
            yield self._cell("final_x_m", "missing, and the robot's pose was known at the end")
            return
        distance: GoalDistance | None = None
        if self.final is not None:
            if self.condition.site is None:
                raise ValueError("its site is invalid")
            goal = self.goals[max(len(self.legs) - 1, 0)]
            distance = distance_to_goal(self.condition.site, goal, self.final, self.parameters)
            yield from self._distances("episode", self.episode, distance, "distance_to_goal_m")
        actions = self.legs[-1].actions if self.legs else self.episode.actions
        expected = judge(reason, actions, distance, self.parameters)
        if self.legs:
            earlier = [leg.success for leg in self.recorded[:-1]]
            expected = judge_sequence(earlier, expected, len(self.goals))
        yield from self._against(given, expected)
        if self.condition.is_simulated_here and given.source == "protocol" and given.proposed:
            yield cell("verdict", given.id, "proposed", "a simulated episode needs no confirmation")

    def _needs_final_pose(self, reason: EndReason) -> bool:
        """Whether the end of the episode was measured: not of a recovered one, nor where the robot was lost."""
        measured = reason is EndReason.STOP or self.episode.distance_to_goal_m is not None
        return measured or (self.condition.is_simulated_here and bool(self.steps) and not self.is_recovered)

    def _against(self, given: Row[Any], expected: Verdict) -> Iterator[Finding]:
        if given.success != expected.success:
            yield cell("verdict", given.id, "success", f"{given.success}, and the judge gives {expected.success}")
        if given.end_reason != expected.end_reason:
            yield cell(
                "verdict", given.id, "end_reason", f"{given.end_reason}, and the judge gives {expected.end_reason}"
            )
        if expected.distance is not None:
            yield from self._distances("verdict", given, expected.distance, "distance_m")
        if given.reason != expected.text and given.source == "protocol":
            if self.episode.vsnbench_version == __version__:
                yield cell("verdict", given.id, "reason", f"{given.reason!r}, and the judge gives {expected.text!r}")
            else:
                self.other_wording = True

    @staticmethod
    def _distances(table: str, row: Row[Any], expected: GoalDistance, column: str) -> Iterator[Finding]:
        distance_m = getattr(row, column)
        if distance_m is None or not math.isclose(distance_m, expected.distance_m, abs_tol=_TOLERANCE):
            yield cell(table, row.id, column, f"{distance_m}, and the poses give {expected.distance_m:.6f} m")
        if row.distance_source != expected.source:
            text = f"{row.distance_source}, and the final pose is {expected.source}"
            yield cell(table, row.id, "distance_source", text)
        if row.goal_instance != expected.instance:
            yield cell(table, row.id, "goal_instance", f"{row.goal_instance}, and the nearest is {expected.instance}")
        # Records of the first protocol have no value.
        if row.goal_in_sight is not None and row.goal_in_sight != expected.in_sight:
            yield cell(table, row.id, "goal_in_sight", f"{row.goal_in_sight}, and the site gives {expected.in_sight}")

    def _state(self) -> Iterator[Finding]:
        judged = [verdict for verdict in self.verdicts if not verdict.proposed]
        state = EpisodeState.AWAITING
        if judged:
            state = EpisodeState.VOID if judged[-1].success is None else EpisodeState.JUDGED
        if self.episode.state == EpisodeState.AWAITING and self.was_retracted:
            return
        if self.episode.state != state:
            yield self._cell("state", f"{self.episode.state}, and its latest verdict makes it {state}")
