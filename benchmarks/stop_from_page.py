"""From a thumb on the page's STOP to zero velocity on the wire, over a real ROS network, in the midst of a movement.

    python benchmarks/stop_from_page.py --stops 100
    python benchmarks/stop_from_page.py --stops 100 --delay 200        # the page's network holds each byte 200 ms
    .venv-ros2/bin/python benchmarks/stop_from_page.py --ros ros2
    python benchmarks/stop_from_page.py --stops 20 --continuous        # the robot drives on while its model thinks
    python benchmarks/stop_from_page.py --stops 20 --continuous --route  # the page's request, without a browser

`vsnbench robots simulate` plays a robot in an empty hall, `vsnbench run --console` drives it, and a Chromium at phone
size presses Go and STOP at a random moment of a movement, one trial after another. The time runs from the browser's own
stamp of the press to the zero command that a node of its own hears, after which none moves, and to the odometry at
rest. A press between two movements does not count. The delay is a relay between browser and run that holds every byte
back, each way. Bar: 0.3 s over the network, 0.05 s of a robot that drives on, and the delay of the way there. Exits
with 1 where a stop took longer.
"""

import argparse
import os
import random
import re
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.ros.ros2.graph import Domain
from tests.web.blind_study import quiet_port, wait_until
from tests.web.browser import Browser
from tests.web.phone import Phone, chromium_of_phones, phone_in
from tests.web.tcp_relay import TcpRelay

HALL = """
name: hall
rooms: [{name: hall, polygon: [[-25, -25], [25, -25], [25, 25], [-25, 25]]}]
walls:
- {start: [-25, -25], end: [25, -25]}
- {start: [25, -25], end: [25, 25]}
- {start: [25, 25], end: [-25, 25]}
- {start: [-25, 25], end: [-25, -25]}
objects: [{id: chair-1, category: chair, position: [20, 20], size_m: [0.5, 0.5, 0.9]}]
starts: [{number: 1, position: [-20, 0], heading_deg: 17}]
"""
LISTENER = Path(__file__).with_name("nodes") / "velocity_listener.py"
PROFILES = {"ros1": "turtlebot2", "ros2": "turtlebot4"}
AT_REST = 0.01
"""|m/s| + |rad/s| of an odometry that stands."""
BAR_S, CONTINUOUS_BAR_S = 0.3, 0.05
FORWARD, ONWARD = ("--model", "forward"), ("--model", "tests.robots.onward:Onward", "--continuous", "0.3")
"""Models that drive straight ahead: from rest to rest, and without a stop."""
STAMP = """() => document.getElementById("stop").addEventListener("pointerdown",
  (event) => { window.pressed = (performance.timeOrigin + event.timeStamp) / 1000; }, { capture: true })"""


@dataclass
class Listener:
    """What a node of its own hears."""

    process: "subprocess.Popen[str]"
    commands: list[tuple[float, float]] = field(default_factory=list)
    odometry: list[tuple[float, float]] = field(default_factory=list)

    def read(self) -> None:
        """Keep what it writes, until it ends."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            at, what, speed = line.split()
            kept = self.commands if what == "command" else self.odometry
            kept.append((float(at), float(speed)))

    @property
    def speed(self) -> float:
        return self.odometry[-1][1] if self.odometry else 0.0


@dataclass(frozen=True)
class Halt:
    """One press."""

    to_zero_s: float
    to_rest_s: float


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--stops", type=int, default=100)
    options.add_argument("--delay", type=float, default=0.0, metavar="MS", help="of the page's network, each way")
    options.add_argument("--ros", choices=PROFILES, default="ros1")
    options.add_argument("--continuous", action="store_true", help="stop a robot that drives on")
    options.add_argument("--route", action="store_true", help="send the request of STOP without a browser")
    options.add_argument("--seed", type=int, default=1)
    asked = options.parse_args()
    model, bar_s = (ONWARD, CONTINUOUS_BAR_S) if asked.continuous else (FORWARD, BAR_S)
    with ExitStack() as stack:
        robot = SimulatedRobot(stack, asked.ros, random.Random(asked.seed))
        if asked.route:
            halts = by_route(robot, model, asked.stops)
        else:
            halts = measured(stack, robot, model, asked.stops, asked.delay / 1000)
    zero, rest = sorted(one.to_zero_s for one in halts), sorted(one.to_rest_s for one in halts)
    print("| network | stops | zero velocity: median | 95 % | worst | at rest: median | 95 % | worst | load |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    how = f"{', driving on' if asked.continuous else ''}{', without a browser' if asked.route else ''}"
    network = f"{asked.ros}{how}, {asked.delay:.0f} ms each way"
    print(f"| {network} | {len(halts)} | {line(zero)} | {line(rest)} | {os.getloadavg()[1]:.1f} |")
    return 0 if zero[-1] < bar_s + asked.delay / 1000 else 1


def line(times_s: list[float]) -> str:
    """Return median, 95 % and worst in milliseconds."""
    of = (statistics.median(times_s), times_s[min(len(times_s) - 1, round(0.95 * len(times_s)))], times_s[-1])
    return " | ".join(f"{one * 1000:.0f} ms" for one in of)


class SimulatedRobot:
    """A robot that `vsnbench robots simulate` plays in an empty hall, its motion server, and a node that listens."""

    def __init__(self, stack: ExitStack, ros: str, chance: random.Random) -> None:
        """Bring everything up, and return when the base sends its odometry."""
        self._stack, self._ros, self.chance = stack, ros, chance
        self.directory = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        self.profile, self.hall, self.log = (self.directory / name for name in ("robot.yaml", "hall.yaml", "log"))
        self.hall.write_text(HALL)
        self.profile.write_text(with_small_camera(PROFILES[ros], ros))
        self._sink = stack.enter_context(self.log.open("w"))
        self._set_environment()
        if ros == "ros1":
            import shutil

            from vsnbench.ros.ros1.master import Master

            rosmaster = shutil.which("rosmaster", path=f"{sys.prefix}/bin:/usr/bin") or "rosmaster"
            self.start(rosmaster, "--core", "-p", self._master, stdout=self._sink)
            Master.from_environment().wait(60)
        self.vsnbench("robots", "simulate", self.profile, "--site", self.hall)
        self.motion_server = self.vsnbench("robots", "serve", self.profile)
        self.listener = Listener(self.start(LISTENER, ros, self.profile, stdout=subprocess.PIPE))
        threading.Thread(target=self.listener.read, daemon=True).start()
        wait_until(lambda: self.listener.odometry, "the base sends its odometry")

    def start(self, *words: object, **how: object) -> "subprocess.Popen[str]":
        """Start a Python program that ends with this one."""
        started = subprocess.Popen([sys.executable, *map(str, words)], stderr=self._sink, text=True, **how)
        self._stack.callback(started.wait)
        self._stack.callback(started.terminate)
        return started

    def vsnbench(self, *words: object) -> "subprocess.Popen[str]":
        """Start a command of vsnbench."""
        return self.start("-m", "vsnbench.cli.main", *words, stdout=self._sink, stdin=subprocess.DEVNULL)

    def run(self, *words: object) -> "subprocess.Popen[str]":
        """Start a run."""
        trials = ("--goal", "chair", "--results", self.directory / "results", "--keep", "images")
        return self.vsnbench("run", "--robot", self.profile, "--site", self.hall, *trials, *words)

    def _set_environment(self) -> None:
        self._master = quiet_port(self.chance)
        os.environ.update(
            ROS_MASTER_URI=f"http://127.0.0.1:{self._master}",
            ROS_IP="127.0.0.1",
            ROS_HOME=str(self.directory),
            ROS_LOG_DIR=str(self.directory),
            ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST",
            ROS_DOMAIN_ID=str(self._stack.enter_context(closing(Domain())).number),
            PYTHONPATH=str(Path(__file__).resolve().parent.parent),
        )

    def run_with_page(self, *words: object) -> tuple[int, str]:
        """Start a run with the operator's page; return its port and address."""
        port = quiet_port(self.chance)
        run = self.run(*words, f"--console=:{port}")
        wait_until(lambda: run.poll() is not None or "token=" in self.log.read_text(), "the page is served")
        address = re.search(r"http://\S+token=\S+", self.log.read_text())
        assert address is not None, self.log.read_text()
        return port, address[0]

    def drive_for_a_while(self) -> None:
        """Return at a random moment while the robot drives."""
        wait_until(lambda: self.listener.speed > 5 * AT_REST, f"it moves: {self.log.read_text()[-500:]}")
        time.sleep(self.chance.uniform(0.1, 1.2))
        wait_until(lambda: self.listener.speed > 5 * AT_REST, "it moves")

    def halt_after(self, asked_s: float) -> Halt | None:
        """Return how the robot came to rest after a request; None where it was not told to move then."""
        commands, odometry = self.listener.commands, self.listener.odometry
        if max((one for one in commands if one[0] < asked_s), default=(0.0, 0.0))[1] <= AT_REST:
            return None
        return Halt(first_after(commands, asked_s) - asked_s, first_after(odometry, asked_s) - asked_s)


def by_route(robot: SimulatedRobot, model: tuple[str, ...], stops: int) -> list[Halt]:
    """Stop the robot so many times by the request that the page sends."""
    _, address = robot.run_with_page(*model)
    anna = Browser(address).enter()
    anna.csrf_token = anna.ask("GET", "/state").json["csrf_token"]
    anna.cookie = anna.post("/sign-in", name="Anna").headers["set-cookie"].partition(";")[0]
    anna.csrf_token = anna.ask("GET", "/state").json["csrf_token"]
    halts: list[Halt] = []
    while len(halts) < stops:
        wait_until(lambda: anna.ask("GET", "/state").json["question"], "the page asks")
        question = anna.ask("GET", "/state").json["question"]
        if question["kind"] == "finish":
            break
        anna.post("/answer", question=question["number"], answer="go")
        robot.drive_for_a_while()
        asked_s = time.time()
        assert anna.post("/stop").status == 200
        wait_until(lambda: anna.ask("GET", "/state").json["question"], "the page asks")
        if (halt := robot.halt_after(asked_s)) is not None:
            halts.append(halt)
            print(f"{len(halts)}: {halt.to_zero_s * 1000:.0f} ms, {halt.to_rest_s * 1000:.0f} ms", file=sys.stderr)
    return halts


def measured(stack: ExitStack, robot: SimulatedRobot, model: tuple[str, ...], stops: int, delay_s: float) -> list[Halt]:
    """Stop the robot so many times by a press in a browser."""
    port, address = robot.run_with_page(*model)
    relay = stack.enter_context(TcpRelay(port, delay_s))
    browser = stack.enter_context(chromium_of_phones(("127.0.0.1", relay, port)))
    phone = phone_in(browser, "Anna", "127.0.0.1", relay, address)
    phone.page.goto(phone.address)
    phone.page.wait_for_selector("#sign-in:not([hidden])")
    phone.sign_in()
    phone.page.evaluate(STAMP)
    halts: list[Halt] = []
    while len(halts) < stops:
        phone.page.wait_for_selector("#go:visible, #finish:visible", timeout=120_000)
        if phone.screen().name == "finish":  # a trial that ended by itself, say with a wheel drop
            break
        if (halt := one_stop(phone, robot)) is not None:
            halts.append(halt)
            print(f"{len(halts)}: {halt.to_zero_s * 1000:.0f} ms, {halt.to_rest_s * 1000:.0f} ms", file=sys.stderr)
    return halts


def one_stop(phone: Phone, robot: SimulatedRobot) -> Halt | None:
    """Press Go, and STOP at a random moment; None where the robot was not told to move then."""
    page = phone.page
    page.click("#go")
    page.wait_for_selector("#stop", state="visible")
    robot.drive_for_a_while()
    box = page.locator("#stop").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.up()
    page.wait_for_selector("#go:visible, #finish:visible", timeout=120_000)
    return robot.halt_after(float(page.evaluate("window.pressed")) - clock_ahead_s(page))


def first_after(heard: list[tuple[float, float]], since: float) -> float:
    """Return when the first message of standing came after the last one of moving."""
    later = [one for one in heard if one[0] >= since]
    last = max((number for number, (_, speed) in enumerate(later) if speed > AT_REST), default=-1)
    return later[last + 1][0]


def clock_ahead_s(page: object) -> float:
    """Return how far the browser's clock is ahead of this process's."""
    tries = []
    for _ in range(5):
        before = time.time()
        there = page.evaluate("(performance.timeOrigin + performance.now()) / 1000")  # type: ignore[attr-defined]
        after = time.time()
        tries.append((after - before, there - (before + after) / 2))
    return min(tries)[1]


def with_small_camera(name: str, ros: str) -> str:
    """Return a profile whose camera costs next to nothing: pictures are not what is measured here."""
    from vsnbench.robots.profiles import embedded_profiles

    text = embedded_profiles()[name].read_text()
    text = re.sub(r"width: \d+", "width: 64", re.sub(r"height: \d+", "height: 48", text))
    return re.sub(rf"kind: {ros}", f"kind: {ros}\n  camera_rate_hz: 10", text)


if __name__ == "__main__":
    sys.exit(main())
