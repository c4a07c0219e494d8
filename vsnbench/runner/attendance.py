"""Who is there: a person at the terminal where the robot needs one, else nobody; and where progress is shown."""

import contextlib
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from typing import Protocol

from vsnbench.database.journal import Journal
from vsnbench.errors import RecordError
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site
from vsnbench.record.results import ResultsDirectory
from vsnbench.robots.contract import Glimpse, ReadBattery
from vsnbench.runner.attendant import Attendant, Nobody, Overview
from vsnbench.runner.board import Board
from vsnbench.runner.desk import Desk
from vsnbench.runner.emergency_stop import EmergencyStop
from vsnbench.runner.operator import Beside, Operator, require_operator
from vsnbench.runner.progress import CampaignProgress
from vsnbench.runner.session_summary import session_words
from vsnbench.runner.stopping import Stopping


@dataclass(frozen=True, slots=True, kw_only=True)
class Occasion:
    """What somebody attends."""

    label: str
    """Model and site, for people."""
    trials: int
    done: int
    successes: int
    parameters: ProtocolParameters
    needs_a_person: bool
    halt: Callable[[], None]
    """Stands the robot still, from any thread."""
    stop: Stopping
    site: Site
    robot_radius_m: float
    journal: Journal
    results: ResultsDirectory
    campaigns: tuple[int, ...]
    """The numbers in the record of what is run."""
    operator: str = ""
    """Who has started it."""
    blind: bool = False
    """Nobody is to see which model drives, nor what it chooses."""
    beside: tuple[int, int] = (0, 0)
    """Trials of the sweep that this is a campaign of, but for its own: how many are done, out of how many."""
    most_void: int = 3
    """So many void episodes one after another end the session: another attempt will mend nothing."""
    keeps: str = ""
    """What is kept of its episodes, in words; empty where that has been said."""
    glimpse: Glimpse | None = None
    """What the robot's camera sees while it drives; None where it sees between its actions alone."""
    battery: ReadBattery = lambda: None
    """What its base says of its battery."""


class PageOfADesk(Protocol):
    """Serves a desk to browsers."""

    def serve(self, desk: Desk, occasion: Occasion) -> AbstractContextManager[str]:
        """Serve it while the context is entered; what it gives says at the terminal where."""
        ...


class Attendance(Protocol):
    """Finds whoever stands beside the robot."""

    def require(self, profile: RobotProfile) -> None:
        """Make sure that a robot which needs a person has one, before anything is written.

        Raises:
            UsageError: nobody is there.
        """
        ...

    def attend(self, occasion: Occasion) -> AbstractContextManager[Attendant]:
        """Return the attendant, as a context manager."""
        ...

    def oversee(self, occasion: Occasion) -> AbstractContextManager[Overview]:
        """Return where the progress of many workers is shown, as a context manager."""
        ...


@dataclass(frozen=True, slots=True)
class TerminalAttendance:
    """The person at this terminal; nobody where the robot needs nobody, or the run is unattended."""

    unattended: bool = False
    page: "PageOfADesk | None" = None
    """Serves the desk beside the terminal, or in its place."""

    def require(self, profile: RobotProfile) -> None:
        """See that there is a terminal, unless there is a page or the run is unattended."""
        if not self.unattended and self.page is None:
            require_operator(profile)

    def oversee(self, occasion: Occasion) -> CampaignProgress:
        """Show progress."""
        return CampaignProgress(
            *(occasion.label, occasion.trials, occasion.done, occasion.successes, occasion.parameters.max_actions),
            shows_actions=not occasion.blind,
            beside=occasion.beside,
            keeps=occasion.keeps,
        )

    @contextmanager
    def attend(self, occasion: Occasion) -> Iterator[Attendant]:
        """Show progress, and listen for the emergency stop key where a person stands beside the robot."""
        with ExitStack() as stack:
            progress = stack.enter_context(self.oversee(occasion))
            if self.page is None and (not occasion.needs_a_person or self.unattended):
                yield Nobody(progress)
                return
            stack.callback(occasion.journal.nobody_attends)
            emergency = stack.enter_context(EmergencyStop(occasion.halt, occasion.stop.ask))
            occasion.stop.last_acts.append(emergency.give_back)
            desk = Desk(sys.stdin.fileno() if sys.stdin.isatty() else None)
            desk.attends(occasion.halt, occasion.stop.ask)
            desk.board.shows_actions, desk.board.robot_radius_m = not occasion.blind, occasion.robot_radius_m
            desk.board.done, desk.says = occasion.done, progress.say
            desk.board.read_battery = occasion.battery
            stack.callback(_say_what_it_was, occasion, desk.board, progress)
            if self.page is not None:
                progress.console.print(stack.enter_context(self.page.serve(desk, occasion)))
            beside = Beside(occasion.operator, not occasion.needs_a_person, self.page is not None)
            yield Operator(progress, emergency, occasion.stop, desk, beside)


def _say_what_it_was(occasion: Occasion, board: Board, progress: CampaignProgress) -> None:
    """Write the session's summary at the terminal, unless the record cannot be read or has nothing."""
    with contextlib.suppress(RecordError):
        if words := session_words(occasion.journal.engine, occasion.campaigns, board):
            progress.say(words)
