"""Trials on a robot that has nothing of vsnbench: PyBullet's Husky, whose skidding its odometry does not see.

`vsnbench doctor` and `vsnbench run` are typed as by a person, who also places the robot and judges with a tape.
"""

import json
import math
import re
import sqlite3
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from ruamel.yaml import YAML

from tests.processes import Process, wait_until
from tests.ros.ros2.graph import Graph2, live_graph, send_line
from tests.ros.ros2.husky.operator import converse

pytestmark = [pytest.mark.long, pytest.mark.ros2, pytest.mark.timeout(900)]

HERE = Path(__file__).parent
PROFILE, SITE = HERE / "husky.yaml", HERE / "room.yaml"
PATIENCE_S = 600.0
ATTEMPTS = 5
"""On a machine with other work a sensor may fall silent for a second: the episode is void, and is run again."""
ESTIMATE_LIMIT_M = 0.5
"""Largest error of the estimated distance. The base turns about a point 0.18 m behind its centre, which its odometry
does not see: 0.36 m after half a turn. The rest is the error of the measured start."""
TURNS = {"TURN_LEFT": 1, "TURN_RIGHT": -1}
MOVE_LIMIT_M, TURN_LIMIT_DEG = 0.005, 0.1
CREEP_M, CREEP_DEG = 0.001, 0.02
"""Motion of the base from the end of a movement to the next image."""


class Reading(NamedTuple):
    """Odometry and true pose of the base at one time."""

    stamp_s: float
    x_m: float
    y_m: float
    heading_rad: float
    true_x_m: float
    true_y_m: float
    true_heading_rad: float

    def ahead_m(self, after: "Reading") -> float:
        """Return how far the odometry has moved along this heading."""
        east_m, north_m = after.x_m - self.x_m, after.y_m - self.y_m
        return math.cos(self.heading_rad) * east_m + math.sin(self.heading_rad) * north_m

    def turned_deg(self, after: "Reading") -> float:
        return math.degrees(after.heading_rad - self.heading_rad)

    def slid_m(self, after: "Reading") -> float:
        """Return how far the centre has moved without the odometry, in the frame of this pose."""
        measured = _seen_from((self.x_m, self.y_m, self.heading_rad), (after.x_m, after.y_m))
        true = _seen_from((self.true_x_m, self.true_y_m, self.true_heading_rad), (after.true_x_m, after.true_y_m))
        return math.dist(measured, true)


def _seen_from(pose: tuple[float, float, float], point: tuple[float, float]) -> tuple[float, float]:
    east_m, north_m = point[0] - pose[0], point[1] - pose[1]
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return cos * east_m + sin * north_m, cos * north_m - sin * east_m


@dataclass
class Session:
    """Three trials, with what PyBullet knows of them."""

    graph: Graph2
    base: Process
    results: Path
    log: Path
    judged: list[dict[str, Any]] = field(default_factory=list)
    """The truth at each judgement."""
    doctor_output: str = ""
    output: str = ""

    def tell(self, words: str) -> dict[str, Any]:
        """Send a line to the robot and return its answer."""
        answered = len(self._answers())
        send_line(self.base, words)
        wait_until(lambda: len(self._answers()) > answered, "the robot answers")
        answer: dict[str, Any] = json.loads(self._answers()[-1])
        return answer

    def _answers(self) -> list[str]:
        return re.findall(r"^\{.*\}$", self.base.output, re.MULTILINE)

    def place(self, asked: "re.Match[str]") -> str:
        """Put the robot at the starting position that the program names."""
        starts = YAML(typ="safe").load(SITE.read_text(encoding="utf-8"))["starts"]
        (start,) = [start for start in starts if start["number"] == int(asked[1])]
        self.tell(f"put {start['position'][0]} {start['position'][1]} {start['heading_deg']}")
        return ""

    def touched(self, _asked: "re.Match[str]") -> str:
        truth = self.tell("where")
        self.judged.append(truth)
        return ", ".join(truth["touched"]) or "no"

    def tape(self, _asked: "re.Match[str]") -> str:
        return f"{self.judged[-1]['chair_m']:.3f}"

    def doctor(self) -> int:
        self.tell("put 1.4 2.6 0")
        words = ["doctor", "--robot", PROFILE, "--move", "--results", self.results]
        done = self.graph.vsnbench(*words, COLUMNS="200")
        code, self.doctor_output = done.wait(120), done.output
        return code

    def run(self) -> int:
        """Run the trials, again if episodes were void, and return the last exit code."""
        answers = {
            r"starting position (\d+)\W[\s\S]*Enter when it is in place[^:]*:": self.place,
            r"Enter to go[^:]*:": lambda _asked: "",
            r"touch anything\?[^:]*:": self.touched,
            r"Metres by tape[^:]*:": self.tape,
            r"Is that right\?[^:]*:": lambda _asked: "yes",
        }
        words = ["run", "--robot", str(PROFILE), "--site", str(SITE), "--model", "oracle", "--goal", "chair"]
        command = [sys.executable, "-m", "vsnbench", *words, "--results", str(self.results)]
        environment = self.graph.environment | {"COLUMNS": "200"}
        for _ in range(ATTEMPTS):
            code, output = converse(command, environment, answers, PATIENCE_S)
            self.output += output
            if "the same command resumes" not in output:
                break
        return code

    def rows(self, query: str) -> list[tuple]:
        with sqlite3.connect(self.results / "vsnbench.db") as connection:
            return connection.execute(query).fetchall()

    def readings(self) -> dict[int, Reading]:
        """Return the readings of the base by stamp in microseconds."""
        lines = self.log.read_text(encoding="utf-8").splitlines()[:-1]  # the last one may be half written
        readings = [Reading(*json.loads(line)) for line in lines]
        return {round(reading.stamp_s * 1e6): reading for reading in readings}


class Movement(NamedTuple):
    """A recorded step of a judged episode with the readings of the base at its image and at the next one."""

    episode: int
    number: int
    action: str
    executed: bool
    displacement_m: float
    turn_rad: float
    before: Reading
    after: Reading
    first: Reading
    """At the first image of the episode."""


def movements(session: Session) -> list[Movement]:
    readings = session.readings()
    query = """
        select episode_id, number, action, completed and not blocked, displacement_m, turn_rad, stamp_s
        from step join episode on episode.id = episode_id where state = 'judged' order by episode_id, number
    """
    steps = session.rows(query)
    found, first = [], readings[round(steps[0][-1] * 1e6)]
    for step, following in pairwise(steps):
        before, after = (readings[round(row[-1] * 1e6)] for row in (step, following))
        first = before if step[1] == 1 else first
        if step[0] == following[0]:
            found.append(Movement(step[0], step[1], step[2], bool(step[3]), step[4], step[5], before, after, first))
    return found


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Session]:
    """A Husky on which `doctor` and three trials have run."""
    pytest.importorskip("pybullet", reason="`make test-long` installs it where it has a wheel")
    directory = tmp_path_factory.mktemp("husky")
    with live_graph(directory) as graph:
        base = graph.start(HERE / "base.py", SITE, directory / "base.log")
        session = Session(graph, base, directory / "results", directory / "base.log")
        assert session.doctor() == 0, session.doctor_output
        assert session.run() == 0, session.output[-5000:]
        yield session


def test_doctor_measures_the_watchdog_of_a_foreign_base(session) -> None:
    assert "the base stopped 0." in session.doctor_output
    assert "answered True; the odometry turned" in session.doctor_output


def test_three_trials_end_with_stop_and_are_judged(session) -> None:
    query = "select start, end_reason from trial join episode on trial.id = trial_id where state = 'judged' order by 1"
    assert session.rows(query) == [(1, "stop"), (2, "stop"), (3, "stop")]
    assert session.rows("select kind, simulated from robot") == [("ros2", 0)]


def test_the_recorded_distance_is_that_of_the_tape_and_the_estimate_is_near_it(session) -> None:
    query = "select distance_source, distance_m, success from verdict where {} order by episode_id, id"
    taped = session.rows(query.format("source = 'person'"))
    estimated = session.rows(query.format("proposed and distance_source in ('estimated', 'measured')"))
    true_m = [truth["chair_m"] for truth in session.judged]
    for (source, estimate_m, _), truth_m in zip(estimated, true_m, strict=True):
        sys.stdout.write(f"{source} {estimate_m:.3f} m, true {truth_m:.3f} m\n")
    assert [row[0] for row in taped] == ["tape"] * 3
    assert [row[1] for row in taped] == pytest.approx(true_m, abs=0.001)
    assert [bool(row[2]) for row in taped] == [truth_m < 1.0 for truth_m in true_m]
    assert [row[1] for row in estimated] == pytest.approx(true_m, abs=ESTIMATE_LIMIT_M)


def test_movements_answered_true_were_true_by_the_odometry_of_the_base(session) -> None:
    done = [movement for movement in movements(session) if movement.executed]
    assert len({movement.episode for movement in done}) == 3
    headings: dict[int, int] = {}
    for movement in done:
        before, after = movement.before, movement.after
        sys.stdout.write(
            f"{movement.episode}.{movement.number} {movement.action}: {before.ahead_m(after):.4f} m, "
            f"{before.turned_deg(after):.2f} degrees, slid {before.slid_m(after):.3f} m\n"
        )
        if movement.action == "MOVE_FORWARD":
            assert before.ahead_m(after) == pytest.approx(0.25, abs=MOVE_LIMIT_M + CREEP_M)
            assert movement.displacement_m == pytest.approx(before.ahead_m(after), abs=CREEP_M)
        else:
            turns = headings[movement.episode] = headings.get(movement.episode, 0) + TURNS[movement.action]
            assert movement.first.turned_deg(after) == pytest.approx(30 * turns, abs=TURN_LIMIT_DEG + CREEP_DEG)
            assert math.degrees(movement.turn_rad) == pytest.approx(before.turned_deg(after), abs=CREEP_DEG)


def test_the_robot_touched_nothing_and_stands_still_at_the_end(session) -> None:
    assert [truth["touched"] for truth in session.judged] == [[]] * 3
    truth = session.tell("where")
    assert truth["touched"] == []
    assert truth["linear_m_s"] < 0.002
    assert truth["angular_rad_s"] < 0.002
