"""Provides the operator of a session: the person at the terminal or a browser, or a stand-in where there is none."""

import contextlib
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from typing import Protocol

from vsnbench.errors import RecordError
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.writing.journal import Journal
from vsnbench.robots.contract import BatteryReader, CameraPreview
from vsnbench.runner.operator.contract import AbsentOperator, Operator
from vsnbench.runner.operator.progress import NO_TRIALS, CampaignProgress, TrialCounts
from vsnbench.runner.operator.prompts import OperatorPrompts
from vsnbench.runner.operator.session_state import SessionState
from vsnbench.runner.operator.session_summary import session_summary_line
from vsnbench.runner.operator.terminal import OperatorDuties, TerminalOperator, require_terminal
from vsnbench.runner.stopping.emergency_key import EmergencyStop
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.sites.site import Site
from vsnbench.values.robot_profile import RobotProfile


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorSession:
    """A session as operators and their displays need it."""

    label: str
    """Model and site, for the display."""
    trials: TrialCounts
    parameters: ProtocolParameters
    needs_operator: bool
    """A person must place the robot."""
    halt: Callable[[], None]
    """Halts the robot, from any thread."""
    stop_requests: StopRequests
    site: Site
    robot_radius_m: float
    journal: Journal
    results: ResultsDirectory
    campaign_ids: tuple[int, ...]
    operator_name: str = ""
    """Name of the person who started the session."""
    is_blind: bool = False
    """The operator must not see which model drives or what it chooses."""
    other_trials: TrialCounts = NO_TRIALS
    """Trials of the sweep's other campaigns."""
    recording_note: str = ""
    """What is stored of the episodes; empty where this was shown before."""
    glimpse: CameraPreview | None = None
    """Camera image while the robot drives; None for a robot without it."""
    battery: BatteryReader = lambda: None
    """Reads the battery of the robot's base."""


class OperatorPageServer(Protocol):
    """Serves the operator's prompts to browsers."""

    def serve(self, prompts: OperatorPrompts, session: OperatorSession) -> AbstractContextManager[str]:
        """Serve while the context is entered. Its value is the text about the address that the terminal shows."""
        ...


class OperatorProvider(ABC):
    """Provides the operator of a session."""

    @abstractmethod
    def require(self, profile: RobotProfile) -> None:
        """Check that an operator can be reached, before anything is written.

        Raises:
            UsageError: no operator can be reached.
        """

    @abstractmethod
    def attend(self, session: OperatorSession) -> AbstractContextManager[Operator]:
        """Return the operator of a session, as a context manager."""


@dataclass(frozen=True, slots=True)
class TerminalOperatorProvider(OperatorProvider):
    """The person at this terminal; absent where the robot needs none or the run is unattended."""

    unattended: bool = False
    page: OperatorPageServer | None = None
    """Serves the prompts to browsers as well."""

    def require(self, profile: RobotProfile) -> None:
        """Check that there is a terminal, unless there is a page or the run is unattended."""
        if not self.unattended and self.page is None:
            require_terminal(profile)

    @contextmanager
    def attend(self, session: OperatorSession) -> Iterator[Operator]:
        """Show progress, and listen for the emergency stop key where a person is at the robot."""
        with ExitStack() as stack:
            progress = stack.enter_context(
                CampaignProgress(
                    session.label,
                    session.trials,
                    session.parameters,
                    shows_actions=not session.is_blind,
                    other_trials=session.other_trials,
                    first_line=session.recording_note,
                )
            )
            if self.page is None and (not session.needs_operator or self.unattended):
                yield AbsentOperator(progress)
                return
            stack.callback(session.journal.clear_operator)
            emergency = stack.enter_context(EmergencyStop(session.halt, session.stop_requests.ask))
            session.stop_requests.last_acts.append(emergency.restore_terminal)
            terminal = sys.stdin.fileno() if sys.stdin.isatty() else None
            prompts = OperatorPrompts(terminal, session.halt, session.stop_requests.ask)
            prompts.show_message = progress.say
            state = prompts.state
            state.shows_actions, state.robot_radius_m = not session.is_blind, session.robot_radius_m
            state.done, state.read_battery = session.trials.done, session.battery
            stack.callback(_show_summary, session, state, progress)
            if self.page is not None:
                progress.console.print(stack.enter_context(self.page.serve(prompts, session)))
            duties = OperatorDuties(session.operator_name, not session.needs_operator, self.page is not None)
            yield TerminalOperator(progress, emergency, session.stop_requests, prompts, duties)


def _show_summary(session: OperatorSession, state: SessionState, progress: CampaignProgress) -> None:
    """Print the session's summary, unless the results cannot be read or there are none."""
    with contextlib.suppress(RecordError):
        if line := session_summary_line(session.journal.engine, session.campaign_ids, state):
            progress.say(line)
