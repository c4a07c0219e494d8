"""The person beside a robot that nothing else can place: asked to put it down, to measure, and to look.

With no terminal there is nobody to ask, and a run refuses to begin unless it was told to go on unattended; then a
distance is reckoned from the surveyed start and the odometry, and recorded as `estimated`.
"""

import math
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Protocol

from rich.console import Console
from rich.markup import escape

from vsnbench.errors import RobotError, UsageError
from vsnbench.protocol.fix import PoseSource
from vsnbench.protocol.judge import EndReason, GoalDistance, Verdict, judge
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import StartingPosition
from vsnbench.runner.emergency_stop import EmergencyStop
from vsnbench.runner.episode import EpisodeOutcome

LEFT_STANDING = (EndReason.MOTION_FAILED, EndReason.SENSOR_LOST)
"""After these the robot stands where it failed, and a person must get it out of there."""


class Notes(Protocol):
    """Where the person's judgements and interventions are kept."""

    def verdict(self, episode_id: int, verdict: Verdict) -> None:
        """Let the person's judgement of an episode stand."""
        ...

    def intervention(self, episode_id: int, step_number: int, what: str) -> None:
        """Note what the person did to the robot; `step_number` is the episode's last action, 0 for none."""
        ...


class Display(Protocol):
    """Where the campaign's progress is shown, and how it makes room for a question."""

    console: Console

    def paused(self) -> AbstractContextManager[None]:
        """Take the progress bar away while a person types."""
        ...

    def episode_begins(self, goal: str, start: int) -> None:
        """A trial is about to be run."""
        ...

    def episode_ends(self, number: int, goal: str, start: int, outcome: EpisodeOutcome) -> None:
        """An episode has ended."""
        ...


def require_operator(profile: RobotProfile, *, unattended: bool) -> None:
    """Make sure that somebody can be asked.

    Raises:
        UsageError: there is no terminal, and nobody said that the robot is to run unattended.
    """
    if not unattended and not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise UsageError(
            f"{profile.name} must be put at each starting position by a person, and there is no terminal to ask one: "
            "run in a terminal, or with --unattended (distances are then estimated from odometry)"
        )


class Absent:
    """Nobody is there: the robot is taken to stand where it should."""

    def put_at(self, start: StartingPosition, problem: str) -> None:
        """Accept at once.

        Raises:
            RobotError: something is wrong that only a person could put right.
        """
        if problem:
            raise RobotError(f"starting position {start.number}: {problem}, and the run is unattended")


class Operator:
    """A person at the terminal; also watches the session, to ask after every episode what the robot cannot know."""

    def __init__(
        self,
        display: Display,
        parameters: ProtocolParameters,
        notes: Notes,
        emergency: EmergencyStop,
        read_line: Callable[[str], str] = input,
    ) -> None:
        self._display = display
        self._parameters = parameters
        self._notes = notes
        self._emergency = emergency
        self._read_line = read_line
        self._left_standing: tuple[int, EpisodeOutcome] | None = None

    def put_at(self, start: StartingPosition, problem: str) -> None:
        """Name the starting position and wait for Enter; note it when the robot had to be fetched from a failure."""
        x, y = start.position
        where = f"x {x:.2f} m, y {y:.2f} m, facing {start.heading_deg:g}°"
        with self._emergency.off(), self._display.paused():
            if problem:
                self._display.console.print(f"[yellow]not yet[/yellow]: {escape(problem)}")
            note = f" ({start.note})" if start.note else ""
            self._display.console.print(
                f"Put the robot at [bold]starting position {start.number}[/bold]: {where}{escape(note)}"
            )
            self._read_line("Enter when it stands there, Ctrl-C to end the session: ")
        if self._left_standing is not None:
            number, outcome = self._left_standing
            self._left_standing = None
            self._notes.intervention(number, outcome.actions, f"moved by hand after {outcome.verdict.end_reason}")
        self._display.console.print("[dim]driving; the space bar stops the robot and ends the episode[/dim]")

    def episode_begins(self, goal: str, start: int) -> None:
        """Pass it on to the display."""
        self._display.episode_begins(goal, start)

    def episode_ends(self, number: int, goal: str, start: int, outcome: EpisodeOutcome) -> None:
        """Pass it on to the display, and ask for collisions and the measured distance."""
        self._display.episode_ends(number, goal, start, outcome)
        if outcome.verdict.end_reason in LEFT_STANDING:
            self._left_standing = (number, outcome)
        if outcome.verdict.end_reason not in (EndReason.STOP, EndReason.STEP_LIMIT):
            return
        with self._emergency.off(), self._display.paused():
            verdict = self._asked(goal, outcome)
        if verdict != outcome.verdict:
            self._notes.verdict(number, verdict)
            if verdict.end_reason is EndReason.COLLISION:
                self._notes.intervention(number, outcome.actions, f"collision called: {verdict.text}")
            self._display.console.print(f"[dim]#{number} judged by you:[/dim] {escape(verdict.text)}")

    def _asked(self, goal: str, outcome: EpisodeOutcome) -> Verdict:
        """Return the verdict with what the person saw and measured."""
        given = outcome.verdict
        distance = given.distance
        touched = self._read_line("Did the robot touch anything? What? (Enter: nothing): ").strip()
        if touched and touched.lower() not in ("n", "no"):
            verdict = judge(EndReason.COLLISION, outcome.actions, distance, self._parameters)
            return replace(verdict, text=f"{verdict.text}: {touched} (seen by a person)")
        if given.end_reason is not EndReason.STOP:
            return given
        known = f"{distance.distance_m:.2f} m, {distance.source}" if distance else "unknown"
        metres = self._number(f"Measured distance to the nearest {goal}, metres (Enter: keep {known}): ")
        if metres is None:
            return given
        taped = GoalDistance(metres, PoseSource.TAPE, distance.instance if distance else "")
        return judge(EndReason.STOP, outcome.actions, taped, self._parameters)

    def _number(self, question: str) -> float | None:
        """Ask until the answer is a distance or nothing."""
        while True:
            answer = self._read_line(question).strip().lower().removesuffix("m").replace(",", ".").strip()
            if not answer:
                return None
            try:
                metres = float(answer)
            except ValueError:
                metres = math.nan
            if math.isfinite(metres) and 0 <= metres < 100:
                return metres
            self._display.console.print("[yellow]a distance in metres, like 0.84[/yellow]")
