"""How much of the simulator's speed is left when everything is recorded.

Drives the same random actions twice in one process: bare (observe at 640x480 RGB-D, guard, execute) and as a whole
recorded run (database, image files, Rerun). Prints actions per second, their ratio, and where the time goes.

    python benchmarks/throughput.py [--episodes 6] [--keep images]

With a camera's size, the recorded run draws only that, for a model that reads RGB, beside the bare loop of an earlier
commit at 640x480 with everything drawn:

    python benchmarks/throughput.py --keep none --camera 256x256 --base 56931d3
"""

import argparse
import statistics
import tempfile
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from single_core import Driver, earlier_tree

from vsnbench.models.baselines.random_walk import RandomWalk
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import KeepFiles, ResultsDirectory
from vsnbench.results.writing.campaigns import CampaignPlan, ModelIdentity, trial_seed
from vsnbench.results.writing.journal import Journal
from vsnbench.robots.contract import Robot
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.registry import open_robot
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.depth_guard import look_ahead
from vsnbench.runner.episode.recorder import EpisodeRecorderFanOut, RecordingTarget
from vsnbench.runner.episode.step import EpisodePlan, Step
from vsnbench.runner.executors.in_process import DrivingModel, InProcessExecutor, SingleModel
from vsnbench.runner.loop.campaign import CampaignSource
from vsnbench.runner.loop.run import run
from vsnbench.runner.loop.session_context import RecordingOptions, SessionContext
from vsnbench.runner.operator.contract import AbsentOperator, EndedEpisode, Upcoming
from vsnbench.runner.setup.selection import plan_trials
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.runtime.threads import compute_with_one_thread
from vsnbench.sites.site import Site, load_site
from vsnbench.values.action import Action
from vsnbench.values.decision import Decision
from vsnbench.values.observation import Observation, Sensor
from vsnbench.viewer.live import RerunEpisodes

START = 5
ROUNDS = 5
PARAMETERS = ProtocolParameters(max_actions=60)


class Wanderer(RandomWalk):
    """The random baseline without its STOP: episodes end at the cap or at a collision."""

    def act(self, observation: Observation) -> Decision:
        """Turn where the random baseline would stop."""
        decision = super().act(observation)
        return Decision(Action.TURN_LEFT) if decision.action is Action.STOP else decision


@dataclass
class Tally:
    """Actions, seconds, and where the seconds went."""

    actions: int = 0
    seconds: float = 0.0
    observe_s: float = 0.0
    guard_s: float = 0.0
    execute_s: float = 0.0

    @property
    def rate(self) -> float:
        """Actions per second."""
        return self.actions / self.seconds


class Counting(AbsentOperator):
    """Counts the actions of the episodes that it is told of, and shows nothing."""

    def __init__(self, tally: Tally) -> None:
        super().__init__()
        self._tally = tally

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Say nothing."""

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:  # noqa: ARG002
        """Count."""
        self._tally.actions += 1

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Say nothing."""


def drive_bare(robot: SimulatedRobot, site: Site, episodes: int) -> Tally:
    """Observe, guard, execute; keep nothing."""
    tally, policy = Tally(), Wanderer()
    began = time.perf_counter()
    for repetition in range(1, episodes + 1):
        seed = trial_seed(0, "chair", START, repetition)
        robot.begin(site.start(START), seed)
        policy.reset("chair", seed)
        for _ in range(PARAMETERS.max_actions):
            t0 = time.perf_counter()
            observation = robot.observe()
            t1 = time.perf_counter()
            action = policy.act(observation).action
            guard = look_ahead(observation, robot.profile.base, PARAMETERS.depth_guard)
            t2 = time.perf_counter()
            blocked = action is Action.MOVE_FORWARD and guard.blocked
            result = None if blocked else robot.execute(action)
            tally.observe_s += t1 - t0
            tally.guard_s += t2 - t1
            tally.execute_s += time.perf_counter() - t2
            tally.actions += 1
            if result is not None and result.collision:
                break
    tally.seconds = time.perf_counter() - began
    return tally


def drive_recorded(robot: Robot, site: Site, episodes: int, directory: Path, kept: KeepFiles) -> Tally:
    """Run the same episodes as `vsnbench run` does."""
    tally = Tally()
    results = ResultsDirectory.locate(directory)
    results.prepare()
    plan = CampaignPlan(
        site=site,
        robot=robot.identity,
        model=ModelIdentity("wanderer"),
        protocol=PARAMETERS,
        seed=0,
        trials=plan_trials(["chair"], [START], episodes),
    )
    with Journal.open(results.database_url) as journal, StopRequests() as stop:
        campaign = journal.find_or_create_campaign(plan)
        viewer = RerunEpisodes(live=False) if kept is KeepFiles.ALL else None
        target = RecordingTarget(journal, results, "wanderer", robot.identity.profile, viewer, kept=kept)
        recorder = partial(EpisodeRecorderFanOut, target)
        began = time.perf_counter()
        operator = Counting(tally)
        context = SessionContext(journal, operator, stop, site, PARAMETERS, RecordingOptions(results))
        executor = InProcessExecutor(context, robot, SingleModel(DrivingModel(Wanderer(), recorder)))
        run(CampaignSource(journal, campaign), executor, operator)
        tally.seconds = time.perf_counter() - began
    return tally


def compare_with(base: str, robot: Robot, site: Site, episodes: int, directory: Path, kept: KeepFiles) -> None:
    """Drive a bare round of the earlier commit and a recorded one of this tree by turns, and print the ratios."""
    drive_recorded(robot, site, 1, directory / "warm-up", kept)
    with earlier_tree(base, directory / "base") as tree:
        earlier = Driver(tree, "simulated", 100, lean=False)
        rates = []
        for number in range(ROUNDS):
            before = earlier.rate()
            rates.append((before, drive_recorded(robot, site, episodes, directory / f"{number}", kept).rate))
        earlier.close()
    for before, after in rates:
        print(f"{base} bare {before:6.1f} actions/s, recorded here {after:6.1f}  ({after / before:.2f} times)")
    print(f"median ratio  {statistics.median(after / before for before, after in rates):6.2f}")


def main() -> None:
    """Measure and print."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--episodes", type=int, default=6, help="episodes of up to 60 actions each")
    arguments.add_argument(
        "--keep", type=KeepFiles, default=KeepFiles.ALL, choices=list(KeepFiles), help="what is kept"
    )
    arguments.add_argument("--camera", default="", help="WIDTHxHEIGHT that the recorded run draws")
    arguments.add_argument("--base", default="", help="an earlier commit, whose bare loop is driven by turns with it")
    asked = arguments.parse_args()
    compute_with_one_thread()
    episodes, kept = asked.episodes, asked.keep
    site = load_site("apartment")
    robot = SimulatedRobot(site, load_profile("turtlebot2"), PARAMETERS)
    recording: Robot = robot
    if asked.camera:
        read = frozenset({Sensor.RGB, Sensor.ODOMETRY})
        recording = open_robot(f"simulated:turtlebot2@{asked.camera}", site, PARAMETERS, read=read)
    with tempfile.TemporaryDirectory() as directory:
        if asked.base:
            compare_with(asked.base, recording, site, episodes, Path(directory), kept)
            return
        drive_bare(robot, site, 1)
        drive_recorded(recording, site, 1, Path(directory) / "warm-up", kept)
        bare = drive_bare(robot, site, episodes)
        recorded = drive_recorded(recording, site, episodes, Path(directory) / "measured", kept)
    print(f"bare loop     {bare.rate:6.1f} actions/s  ({bare.actions} actions)")
    for part, spent_s in (("observe", bare.observe_s), ("guard", bare.guard_s), ("execute", bare.execute_s)):
        print(f"  {part:<11} {spent_s / bare.actions * 1000:6.2f} ms an action")
    print(f"recorded run  {recorded.rate:6.1f} actions/s  ({recorded.actions} actions, --keep {kept})")
    print(f"ratio         {recorded.rate / bare.rate:6.2f}")


if __name__ == "__main__":
    main()
