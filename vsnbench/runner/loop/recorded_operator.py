"""Records what an operator does in a session: trials started, interventions and judgements."""

import logging

from vsnbench.errors import JudgedMeanwhileError
from vsnbench.results.writing.entries import INTERVENTION
from vsnbench.runner.episode.episode import EpisodeOperator
from vsnbench.runner.episode.step import EpisodePlan, Step
from vsnbench.runner.loop.contract import Session
from vsnbench.runner.loop.follow_up import strands_robot
from vsnbench.runner.operator.contract import EndedEpisode, Judgement, Upcoming
from vsnbench.runner.operator.placing import Placing
from vsnbench.runner.study.blinding import hide_choice, hide_end
from vsnbench.sites.site import StartingPosition

logger = logging.getLogger(__name__)

PROPOSAL_ONLY = 1
"""Number of verdicts of an episode that the operator is asked to judge. More means that it was judged meanwhile."""


class RecordedOperator(EpisodeOperator):
    """Passes calls on to a session's operator and records the answers.

    In a blind study, the operator sees neither the model's errors and diagnostics nor its computing times.
    """

    def __init__(self, session: Session) -> None:
        self._journal = session.journal
        self._operator = session.operator
        self._is_blind = session.is_blind
        self._default_name = session.recording.operator_name
        """Author of answers if no other is known."""
        self._controls = session.robots.controls
        self._stranded: EndedEpisode | None = None
        """Episode whose failure left the robot where only a person can move it."""
        self._upcoming = 0
        """Number of the episode that is about to run."""

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Show a trial, and wait until it may begin."""
        self._upcoming = upcoming.number
        self._operator.trial_begins(upcoming)
        self._record_name()

    def place(self, start: StartingPosition, problem: str, placing: Placing) -> None:
        """Have the robot placed. Fetching it after a failure is an intervention in the episode that failed."""
        self._operator.place(start, problem, placing)
        self._record_name()
        if (failed := self._stranded) is not None:
            self._stranded = None
            self._record_intervention(failed, f"moved by hand after {failed.outcome.verdict.end_reason}")

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Show an action, and tell a person who drives whether it was refused."""
        if self._controls is not None:
            self._controls.refused = step.blocked
        self._operator.step_taken(plan, hide_choice(step) if self._is_blind else step)

    def asks_where(self, *, can_measure: bool) -> bool:
        """Return whether the operator has asked for the robot's pose."""
        return self._operator.asks_where(can_measure=can_measure)

    def show_where(self, text: str) -> None:
        """Show where the robot is."""
        self._operator.show_where(text)

    def show_message(self, text: str) -> None:
        """Show a line."""
        self._operator.show_message(text)

    def says_arrived(self) -> bool:
        """Return whether the operator says that the robot has arrived."""
        return self._operator.says_arrived()

    def episode_ended(self, ended: EndedEpisode, *, session_stopped: bool = False) -> None:
        """Show how an episode ended, and have its proposed verdict judged unless the session stopped with it."""
        ended = hide_end(ended) if self._is_blind else ended
        self._operator.episode_ended(ended)
        if session_stopped:
            return
        if strands_robot(ended.outcome):
            self._stranded = ended
        if ended.outcome.proposed and ended.outcome.verdict.end_reason.is_result:
            judgement = self._operator.judge(ended)
            if judgement is not None:
                self._record_judgement(ended, judgement)

    def _record_judgement(self, ended: EndedEpisode, judgement: Judgement) -> None:
        author = judgement.author or self._default_name
        try:
            self._journal.judge(ended.number, judgement.verdict, author=author, note=judgement.note, seen=PROPOSAL_ONLY)
        except JudgedMeanwhileError as meanwhile:
            logger.warning("%s", meanwhile)
            return
        if judgement.called_collision:
            self._record_intervention(ended, f"collision called: {judgement.verdict.text}", judgement.author)

    def _record_name(self) -> None:
        if name := self._operator.name:
            self._journal.set_operator(self._upcoming, name)

    def _record_intervention(self, ended: EndedEpisode, description: str, author: str = "") -> None:
        author, step = author or self._default_name, ended.outcome.actions or None
        self._journal.add_event(INTERVENTION, description, author=author, episode_id=ended.number, step_number=step)
