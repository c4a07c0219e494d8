"""Who drives a scan: a script of actions, or the map itself, which leads to where it has not seen."""

import math
import re
from collections import deque
from pathlib import Path
from typing import Final

import numpy as np

from vsnbench.errors import UsageError
from vsnbench.models.vlv.map_regions import disk, frontier_away_from
from vsnbench.models.vlv.planner import BoolGrid, Planner, Point, Route, path_of
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.protocol.actions import Action
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.robot_profile import Base
from vsnbench.runner.scan import ScanState
from vsnbench.sensing.occupancy_map import OccupancyMap

WORDS: Final = {
    "forward": Action.MOVE_FORWARD,
    "back": Action.MOVE_BACKWARD,
    "left": Action.TURN_LEFT,
    "right": Action.TURN_RIGHT,
}
LOOK_AROUND: Final = "around"
_MOST_ACTIONS: Final = 100_000
_MOST_CHARACTERS: Final = 1_000_000


def turns_around(parameters: ProtocolParameters) -> int:
    """Return how many turns make a full one."""
    return max(1, math.ceil(360 / parameters.turn_deg - 1e-9))


class Script:
    """Actions from a file: `forward 3`, `left`, `around`, one or more a line; `#` begins a comment."""

    def __init__(self, text: str, origin: str, parameters: ProtocolParameters) -> None:
        """Read a script.

        Raises:
            UsageError: a word is no action, or there are too many; the message names the line.
        """
        self._left: deque[Action] = deque()
        for number, line in enumerate(text.splitlines(), 1):
            last: list[Action] = []
            for word in re.split(r"[\s,;]+", line.partition("#")[0].strip()):
                if not word:
                    continue
                if word.isascii() and word.isdecimal() and last and 0 < int(word[:7]) < _MOST_ACTIONS:
                    self._left.extend(last * (int(word[:7]) - 1))
                    last = []
                elif word.lower() == LOOK_AROUND:
                    last = [Action.TURN_LEFT] * turns_around(parameters)
                    self._left.extend(last)
                elif word.lower() in WORDS:
                    last = [WORDS[word.lower()]]
                    self._left.extend(last)
                else:
                    raise UsageError(
                        f"{origin}:{number}: {word[:40]!r} is no action",
                        advice=f"{', '.join(WORDS)} or {LOOK_AROUND}, each with how often behind it: forward 3",
                    )
                if len(self._left) > _MOST_ACTIONS:
                    raise UsageError(f"{origin}:{number}: more than {_MOST_ACTIONS:,} actions")
        if not self._left:
            raise UsageError(f"{origin} has no action in it", advice=f"for instance: {LOOK_AROUND}, forward 3")

    @classmethod
    def of_file(cls, path: Path, parameters: ProtocolParameters) -> "Script":
        """Read a script's file.

        Raises:
            UsageError: it cannot be read, or is none.
        """
        try:
            with path.open(encoding="utf-8") as file:
                text = file.read(_MOST_CHARACTERS + 1)
        except OSError as error:
            raise UsageError(f"cannot read {path}: {error.strerror or error}") from error
        except UnicodeDecodeError as error:
            raise UsageError(f"cannot read {path}: it is no text in UTF-8") from error
        if len(text) > _MOST_CHARACTERS:
            raise UsageError(f"{path} has more than {_MOST_CHARACTERS:,} characters")
        return cls(text, str(path), parameters)

    def next(self, state: ScanState) -> Action | None:
        """Return the next action of the script; None at its end, and where the robot touched something."""
        return self._left.popleft() if self._left and not state.collided else None


class Explorer:
    """Looks around, goes to the nearest border of what is known, and looks around there, until there is none."""

    _APART_M: Final = (1.5, 0.9)
    """What lies nearer than this to a place of looking around does not draw it; less in a second round."""
    _SEEN_FROM_M: Final = 2.2
    """Free floor farther than this from every such place is looked at from nearer."""
    _ARRIVED_M: Final = 0.3
    _GIVEN_UP_M: Final = 0.5
    _BUDGET: Final = 60
    """Actions on the way to one place."""

    def __init__(self, base: Base, parameters: ProtocolParameters) -> None:
        self._planner = Planner(
            VLVSettings(
                robot_radius_m=base.radius_m,
                forward_m=parameters.forward_m,
                turn_deg=parameters.turn_deg,
                look_ahead_m=parameters.depth_guard.distance_m,
            )
        )
        self._around = turns_around(parameters)
        self._turns_left = 0
        self._turn = Action.TURN_RIGHT
        self._looked_from: list[Point] = []
        self._given_up: list[Point] = []
        self._apart_m = list(self._APART_M)
        self._budget = self._BUDGET

    def next(self, state: ScanState) -> Action | None:
        """Return the next action; None when nothing is left to be seen."""
        if not self._looked_from:
            return self._look_around(state)
        if self._turns_left:
            self._turns_left -= 1
            return self._turn
        route = self._route(state)
        if route is None:
            return None
        if route.way_m(state.pose) < self._ARRIVED_M:
            return self._look_around(state)
        action = self._planner.next_action(route, state.pose, forward_refused=state.refused)
        self._budget -= 1
        if action is not None and self._budget > 0:
            return action
        self._given_up.append((path_of(route, state.pose) or (state.pose.position,))[-1])
        return self._look_around(state)

    def _look_around(self, state: ScanState) -> Action:
        self._looked_from.append(state.pose.position)
        self._turns_left, self._budget = self._around - 1, self._BUDGET
        # Left, then right: an odometry that counts turns too long errs less in the end.
        self._turn = Action.TURN_RIGHT if self._turn is Action.TURN_LEFT else Action.TURN_LEFT
        return self._turn

    def _route(self, state: ScanState) -> Route | None:
        """Return the way to the nearest place worth looking from; None where there is none any more."""
        while self._apart_m:
            targets = self._targets(state.map, self._apart_m[0])
            for clearance_m in (0.05, 0.0):
                terrain = self._planner.terrain(state.map, state.pose, clearance_m)
                if route := self._planner.route(terrain, targets, state.pose):
                    return route
            self._apart_m.pop(0)
        return None

    def _targets(self, grid: OccupancyMap, apart_m: float) -> BoolGrid:
        rows, columns = grid.shape
        x_m = grid.origin_x_m + (np.arange(columns) + 0.5) * grid.resolution_m
        y_m = grid.origin_y_m + (np.arange(rows) + 0.5) * grid.resolution_m
        away_m = np.full(grid.shape, np.inf)
        for x, y in self._looked_from:
            np.minimum(away_m, np.hypot(x_m[None, :] - x, y_m[:, None] - y), out=away_m)
        targets = frontier_away_from(grid, (), 0.0) & (away_m > apart_m)
        targets |= grid.known & ~grid.occupied & (away_m > self._SEEN_FROM_M)
        for point in self._given_up:
            targets &= ~disk(grid, point, self._GIVEN_UP_M)
        return targets
