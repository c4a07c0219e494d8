"""What a person's word makes of an episode, whoever asks for it and wherever it is written: pure.

A case is an episode as its judge needs it, just ended or read from the record years later.
"""

from dataclasses import dataclass
from typing import Self

from vsnbench.database.read_shapes import EpisodeDetails
from vsnbench.errors import UsageError
from vsnbench.protocol.fix import PoseSource
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.persons_word import LONGEST_M, collided, declared_void, metres, taped
from vsnbench.protocol.site import Site
from vsnbench.runner.answers import MisreadError, Said, diagonal_m, what_was_touched
from vsnbench.runner.attendant import EndedEpisode, Judgement

SURPRISE_M = 1.0
"""A measured distance that differs from the estimate by more is asked back."""


class UnsureError(MisreadError):
    """An answer that is taken when it is said again: it may be a slip."""


@dataclass(frozen=True, slots=True)
class Word:
    """What a person says of an episode, as it was typed."""

    touched: str = ""
    """`no`, or what it touched; empty where nothing was said of it."""
    distance: str = ""
    """By tape, `0.84` or `84 cm`; empty keeps the estimate."""
    felt: bool = False
    """There was the collision that the robot felt."""
    void: str = ""
    """Why it is no result; empty for one."""
    sure: bool = False
    """It is no slip."""


@dataclass(frozen=True, slots=True)
class Case:
    """An episode that has ended."""

    number: int
    ended_with: EndReason
    actions: int
    estimate: GoalDistance | None
    """The distance that stands: by tape where somebody has measured it."""
    parameters: ProtocolParameters
    longest_m: float
    """No distance can be longer within the site."""
    proposal: Verdict | None = None
    instance: str = ""

    @classmethod
    def of_ended(cls, ended: EndedEpisode) -> Self:
        """Return that of an episode that has just ended."""
        verdict, plan = ended.outcome.verdict, ended.plan
        instance = verdict.distance.instance if verdict.distance else ""
        return cls(
            ended.number,
            verdict.end_reason,
            ended.outcome.actions,
            verdict.distance,
            plan.parameters,
            diagonal_m(plan.site),
            verdict,
            instance,
        )

    @classmethod
    def of_recorded(cls, details: EpisodeDetails) -> Self:
        """Return that of an episode of a record.

        Raises:
            UsageError: it has not ended.
        """
        episode = details.summary
        if details.ended_with is None:
            raise UsageError(f"episode {episode.id} has not ended", advice="judge it when it has")
        estimate = None
        if episode.distance_to_goal_m is not None and episode.distance_source is not None:
            source = PoseSource(episode.distance_source)
            estimate = GoalDistance(episode.distance_to_goal_m, source, details.goal_instance or "")
        return cls(
            episode.id,
            EndReason(details.ended_with),
            episode.actions,
            estimate,
            ProtocolParameters.from_record(details.provenance.protocol),
            _longest_m(details.provenance.site_content),
            _proposal(details),
            details.goal_instance or "",
        )

    def judged_by(self, word: Word, note: str = "") -> Judgement:
        """Return what a person's word makes of it.

        Raises:
            MisreadError: it cannot be taken; its words say what can.
            UnsureError: it can, when it is said to be no slip.
        """
        if word.void:
            return Judgement(declared_void(" ".join(word.void.split())), note)
        if self.ended_with is EndReason.COLLISION:
            if not word.felt or self.proposal is None:
                raise MisreadError("say that there was the collision, or why the episode is void")
            return Judgement(self.proposal, note)
        touched = what_was_touched(word.touched)
        if touched is Said.LATER:
            raise MisreadError("later is no judgement")
        if isinstance(touched, str):
            return Judgement(self.collided(touched), note or touched, called_collision=True)
        if word.distance.strip():
            return Judgement(self.taped(word.distance, sure=word.sure), note)
        if self.proposal is None:
            raise MisreadError("nothing is proposed for it: give the distance by tape, or why it is void")
        return Judgement(self.proposal, note)

    @property
    def robots_estimate(self) -> GoalDistance | None:
        """The distance that counts where nobody measures: the proposal's, whatever somebody has said since."""
        return self.proposal.distance if self.proposal and self.proposal.distance else self.estimate

    def collided(self, what: str) -> Verdict:
        """Return the verdict where a person saw it touch something."""
        return collided(what, self.actions, self.estimate, self.parameters)

    def taped(self, typed: str, *, sure: bool = True) -> Verdict:
        """Return the verdict by a distance as it was typed.

        Raises:
            MisreadError: it is no distance here, or no distance makes a result of this episode.
            UnsureError: it is far from the estimate, and nobody has said that it is right.
        """
        if not self.ended_with.is_result:
            raise MisreadError(
                f"episode {self.number} ended with {self.ended_with.value}, without a STOP: no distance makes a result "
                "of it"
            )
        try:
            measured_m = metres(typed, self.longest_m)
        except UsageError as error:
            raise MisreadError(str(error)) from error
        estimate = self.robots_estimate
        if not sure and estimate and abs(measured_m - estimate.distance_m) > SURPRISE_M:
            raise UnsureError(f"{measured_m:.2f} m, and the estimate is {estimate.distance_m:.2f} m: is that right?")
        return taped(self.ended_with, self.actions, measured_m, self.instance, self.parameters)


def _proposal(details: EpisodeDetails) -> Verdict | None:
    """Return what the protocol proposes for an episode that awaits a person's word."""
    proposals = [verdict for verdict in details.verdicts if verdict.proposed]
    if not proposals:
        return None
    given = proposals[-1]
    distance = None
    if given.distance_m is not None and given.distance_source is not None:
        source, instance = PoseSource(given.distance_source), given.goal_instance or ""
        distance = GoalDistance(given.distance_m, source, instance, given.goal_in_sight is not False)
    return Verdict(EndReason(given.end_reason), given.success, given.reason, distance)


def _longest_m(content: dict[str, object]) -> float:
    """Return the longest distance within the site as it was recorded; a tape's length where it was never surveyed."""
    from pydantic import ValidationError

    try:
        return min(LONGEST_M, diagonal_m(Site.model_validate(content)))
    except ValidationError:
        return LONGEST_M
