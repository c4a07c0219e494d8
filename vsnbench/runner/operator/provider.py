"""Provides the operator of a session: the person at the terminal or a browser, or a stand-in where there is none."""

import contextlib
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass

from vsnbench.errors import RecordError, UsageError
from vsnbench.models.human.controls import Controls
from vsnbench.runner.loop.contract import Session
from vsnbench.runner.operator.contract import NO_TRIALS, AbsentOperator, Operator, TrialCounts
from vsnbench.runner.operator.progress import ProgressDisplay
from vsnbench.runner.operator.prompts import OperatorPrompts
from vsnbench.runner.operator.session_state import SessionState
from vsnbench.runner.operator.session_summary import session_summary_line
from vsnbench.runner.operator.terminal import TerminalOperator, require_terminal
from vsnbench.runner.stopping.emergency_key import EmergencyStop
from vsnbench.values.robot_profile import RobotProfile

ServePage = Callable[[OperatorPrompts, Session], AbstractContextManager[str]]
"""Serves the operator's prompts to browsers while the context is entered. Its value is the text about the address that
the terminal shows."""


ServeDriver = Callable[[Controls], AbstractContextManager[str]]
"""Serves the controls to the person who drives, in the same way."""


@dataclass(frozen=True, slots=True)
class OperatorProvider:
    """Provides the person at this terminal, or a stand-in where the robot needs none or the run is unattended."""

    unattended: bool = False
    serve_page: ServePage | None = None
    """Serves the prompts to browsers as well."""
    serve_driver: ServeDriver | None = None
    """Serves the page of a person who drives; None for a command without one."""
    label: str = ""
    """Place of the campaign in a sweep, for the display; empty outside of one."""
    before: int = 0
    """Trials of the sweep's campaigns before this one."""
    of_sweep: int = 0
    """Trials of the sweep."""
    shows_episodes: bool = True
    """The display has a line for each episode, and where the session is recorded."""

    def require(self, profile: RobotProfile) -> None:
        """Check that an operator can be reached, before anything is written.

        Raises:
            UsageError: there is neither a terminal nor a page, and the run is not unattended.
        """
        if not self.unattended and self.serve_page is None:
            require_terminal(profile)

    def require_page(self, controls: Controls) -> None:
        """Check that the person who drives has a page, before anything is written.

        Raises:
            UsageError: it has none.
        """
        if self.serve_driver is None:
            raise UsageError(
                f"{controls.driver} drives on a page, which this command does not serve",
                advice=f"vsnbench run --model human:{controls.driver} --goal chair",
                code="no-driver-page",
            )

    def is_present(self, *, needed: bool) -> bool:
        """Return whether a person is there; `needed` says whether the robot needs one."""
        return self.serve_page is not None or (needed and not self.unattended)

    @contextmanager
    def attend(self, session: Session) -> Iterator[Operator]:
        """Show progress, and listen for the emergency stop key where a person is at the robot."""
        robots, stop_requests = session.robots, session.stop_requests
        with ExitStack() as stack:
            progress = stack.enter_context(self._display(session))
            if self.serve_driver is not None and robots.controls is not None:
                progress.console.print(stack.enter_context(self.serve_driver(robots.controls)), soft_wrap=True)
            if not self.is_present(needed=robots.needs_operator):
                yield AbsentOperator(progress)
                return
            stack.callback(session.journal.clear_operator)
            terminal = sys.stdin.fileno() if sys.stdin.isatty() else None
            prompts = OperatorPrompts(terminal, robots.halt, stop_requests.ask)
            keys = EmergencyStop(
                robots.halt, stop_requests.ask, others={b"w": prompts.ask_where, b"a": prompts.declare_arrival}
            )
            emergency = stack.enter_context(keys)
            stop_requests.last_acts.append(emergency.restore_terminal)
            prompts.show_message = progress.say
            state = prompts.state
            state.shows_actions, state.robot_radius_m = not session.is_blind, robots.robot.profile.base.radius_m
            state.done, state.read_battery = session.trials.done, lambda: robots.battery
            stack.callback(_show_summary, session, state, progress)
            if self.serve_page is not None:
                progress.console.print(stack.enter_context(self.serve_page(prompts, session)))
            yield TerminalOperator(
                progress,
                emergency,
                stop_requests,
                prompts,
                name=session.recording.operator_name,
                starts_trials=not robots.needs_operator,
                has_page=self.serve_page is not None,
            )

    def _display(self, session: Session) -> ProgressDisplay:
        """Return the display of a campaign, as a part of the sweep if there is one."""
        label, note, others = session.label, session.recording_note, NO_TRIALS
        if self.label:
            label, note = f"{self.label}: {label}", ""
            others = TrialCounts(max(self.of_sweep - session.trials.total, self.before), self.before)
        return ProgressDisplay(
            label,
            session.trials,
            session.parameters,
            shows_actions=not session.is_blind,
            other_trials=others,
            first_line=note,
            shows_episodes=self.shows_episodes,
        )


def _show_summary(session: Session, state: SessionState, progress: ProgressDisplay) -> None:
    """Print the session's summary, unless the results cannot be read or there are none."""
    with contextlib.suppress(RecordError):
        if line := session_summary_line(session.journal.engine, session.campaign_ids, state):
            progress.say(line)
