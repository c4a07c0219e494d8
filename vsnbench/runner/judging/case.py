"""An ended episode with everything that a decision about it needs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from vsnbench.errors import UsageError
from vsnbench.protocol.human_verdict import LONGEST_M
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict, distance_to_goal, judge_sequence
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.model import EpisodeRecord, RecordedVerdict
from vsnbench.results.writing.entries import SequenceLeg
from vsnbench.runner.operator.contract import EndedEpisode
from vsnbench.sites.site import Site
from vsnbench.sites.targets import legs_of, reached_words
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.pose import Pose


@dataclass(frozen=True, slots=True)
class Case:
    """An episode that has ended, a moment ago or years ago."""

    number: int
    goal: str
    start: int
    """Number of the starting position."""
    ended_with: EndReason
    actions: int
    parameters: ProtocolParameters
    longest_m: float
    """Longest distance that the site allows, metres."""
    instance: str = ""
    """Site id of the nearest target."""
    measured_to: str = ""
    """What a person measures the distance to; empty for the nearest object of the category."""
    proposal: Verdict | None = None
    """What the protocol proposed; a judgement of a person, retracted or not, is never a proposal."""
    current_verdict: Verdict | None = None
    """The verdict that counts now; None while the episode awaits one."""
    recorded_distance: GoalDistance | None = None
    """The distance in the episode's own row."""
    odometry: GoalDistance | None = None
    """Distance from the pose by the odometry where another pose was measured from images after STOP."""
    legs: tuple[SequenceLeg, ...] = ()
    """The goals of a sequence that were given; a person judges the last one, and `actions` are its own."""
    goals: int = 1
    """Number of goals of the sequence."""

    @classmethod
    def of_ended(cls, ended: EndedEpisode) -> Self:
        """Return the case of an episode that has just ended."""
        verdict, plan = ended.outcome.verdict, ended.plan
        return cls(
            number=ended.number,
            goal=plan.goal,
            start=plan.start.number,
            ended_with=verdict.end_reason,
            actions=_last_actions(ended.outcome.legs, ended.outcome.actions),
            parameters=plan.parameters,
            longest_m=longest_distance_m(plan.site),
            measured_to=reached_words(plan.site, _last_goal(ended.outcome.legs, plan.goal)),
            legs=ended.outcome.legs,
            goals=len(legs_of(plan.site, plan.goal)),
            instance=verdict.distance.instance if verdict.distance else "",
            proposal=verdict,
            odometry=ended.outcome.stop.odometry if ended.outcome.stop and ended.outcome.stop.measured else None,
        )

    @classmethod
    def of_recorded(cls, episode: EpisodeRecord) -> Self:
        """Return the case of an episode in the results database.

        Raises:
            UsageError: the episode has not ended.
        """
        if episode.ended_with is None:
            raise UsageError(f"episode {episode.id} has not ended", advice="judge it when it has")
        recorded = None
        if episode.distance_m is not None and episode.distance_source is not None:
            source = PoseSource(episode.distance_source)
            recorded = GoalDistance(episode.distance_m, source, episode.goal_instance or "")
        site = recorded_site(episode)
        return cls(
            number=episode.id,
            goal=episode.goal,
            start=episode.start,
            ended_with=EndReason(episode.ended_with),
            actions=_last_actions(episode.legs, episode.actions),
            parameters=ProtocolParameters.from_record(episode.provenance.protocol),
            longest_m=longest_distance_m(site) if site else LONGEST_M,
            measured_to=reached_words(site, _last_goal(episode.legs, episode.goal))
            if site
            else f"nearest {episode.goal}",
            legs=episode.legs,
            goals=len(legs_of(site, episode.goal)) if site and episode.legs else 1,
            instance=episode.goal_instance or "",
            proposal=_verdict(episode.proposal),
            current_verdict=_verdict(episode.current_verdict),
            recorded_distance=recorded,
            odometry=_by_odometry(episode, site),
        )

    def of_sequence(self, verdict: Verdict) -> Verdict:
        """Return the verdict of the whole sequence from that of its last goal; the same for another goal."""
        if not self.legs:
            return verdict
        return judge_sequence([leg.success for leg in self.legs[:-1]], verdict, self.goals)

    @property
    def distance(self) -> GoalDistance | None:
        """The distance that counts now: by tape where the current verdict has one."""
        for verdict in (self.current_verdict, self.proposal):
            if verdict is not None and verdict.distance is not None:
                return verdict.distance
        return self.recorded_distance

    @property
    def estimate(self) -> GoalDistance | None:
        """The robot's own estimate, which counts without a measurement."""
        return self.proposal.distance if self.proposal and self.proposal.distance else self.distance

    @property
    def expected_success(self) -> bool | None:
        """Success as proposed, or as judged where there is no proposal; None where neither has a result."""
        if self.proposal is not None and self.proposal.success is not None:
            return self.proposal.success
        return self.current_verdict.success if self.current_verdict is not None else None


def _last_actions(legs: Sequence[SequenceLeg], actions: int) -> int:
    return legs[-1].actions if legs else actions


def _last_goal(legs: Sequence[SequenceLeg], goal: str) -> str:
    return legs[-1].goal if legs else goal


def longest_distance_m(site: Site) -> float:
    """Return the longest distance that a person can measure within a site, metres."""
    corners = [corner for room in site.rooms for corner in room.polygon]
    if not corners:
        return LONGEST_M
    xs, ys = zip(*corners, strict=True)
    return min(LONGEST_M, math.hypot(max(xs) - min(xs), max(ys) - min(ys)))


def recorded_site(episode: EpisodeRecord) -> Site | None:
    """Return the recorded site; None if it is damaged or, as in some imports, was never surveyed."""
    try:
        return Site.model_validate(episode.provenance.site_content)
    except (ValueError, TypeError, AttributeError, RecursionError):
        return None


def _by_odometry(episode: EpisodeRecord, site: Site | None) -> GoalDistance | None:
    """Return the distance from the pose by the odometry; None where it is the only pose, or the site is damaged."""
    stop = episode.stopped
    if stop is None or not stop.determined or stop.odometry_m is None or site is None:
        return None
    pose = stop.pose.pose.compose(Pose(0.0, 0.0).relative_to(stop.offset))
    parameters = ProtocolParameters.from_record(episode.provenance.protocol)
    try:
        distance = distance_to_goal(
            site, _last_goal(episode.legs, episode.goal), Fix(pose, PoseSource.ESTIMATED), parameters
        )
    except ValueError:
        return None
    range_m = (stop.odometry_low_m or 0.0, math.inf if stop.odometry_high_m is None else stop.odometry_high_m)
    return replace(distance, range_m=range_m)


def _verdict(recorded: RecordedVerdict | None) -> Verdict | None:
    if recorded is None:
        return None
    distance = None
    if recorded.distance_m is not None and recorded.distance_source is not None:
        source, instance = PoseSource(recorded.distance_source), recorded.goal_instance or ""
        distance = GoalDistance(recorded.distance_m, source, instance, recorded.goal_in_sight is not False)
    return Verdict(EndReason(recorded.end_reason), recorded.success, recorded.reason, distance)
