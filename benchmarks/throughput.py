"""Measures actions per second of a recorded run against the bare loop.

Drives the same random actions twice in one process: as a bare loop (observe at 640x480 RGB-D, guard, execute) and as a
recorded run (database, image files, Rerun). Prints the actions per second of both, their ratio, and milliseconds per
action of each part of the bare loop.

    python benchmarks/throughput.py [--episodes 6] [--keep images]

With `--camera`, the recorded run renders only RGB at that size:

    python benchmarks/throughput.py --keep none --camera 256x256
"""

import argparse
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from vsnbench.models.baselines.random_walk import RandomWalk
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import KeepFiles, ResultsDirectory
from vsnbench.results.writing.campaigns import CampaignPlan, trial_seed
from vsnbench.results.writing.journal import Journal
from vsnbench.robots.contract import Robot
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.registry import open_robot
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.depth_guard import look_ahead
from vsnbench.runner.episode.recorder import RecordingOptions
from vsnbench.runner.episode.step import EpisodePlan, Step
from vsnbench.runner.executors.in_process import DrivingModel, InProcessExecutor
from vsnbench.runner.loop.campaign import CampaignSource
from vsnbench.runner.loop.contract import Session
from vsnbench.runner.loop.run import run
from vsnbench.runner.operator.contract import AbsentOperator, EndedEpisode, Upcoming
from vsnbench.runner.setup.selection import plan_trials
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.runtime.threads import compute_with_one_thread
from vsnbench.sites.site import Site, load_site
from vsnbench.values.decision import Decision
from vsnbench.values.model.card import ModelCard
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation, Sensor
from vsnbench.viewer.live import RerunEpisodes

START = 5
PARAMETERS = ProtocolParameters(max_actions=60)


class Wanderer(RandomWalk):
    """The random baseline without its STOP: episodes end at the cap or at a collision."""

    def act(self, observation: Observation) -> Decision:
        """Turn where the random baseline would stop."""
        decision = super().act(observation)
        return Decision(Action.TURN_LEFT) if decision.action is Action.STOP else decision


@dataclass
class Tally:
    """Number of actions, total seconds, and seconds by part."""

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
    """Operator that counts the actions of all episodes and prints nothing."""

    def __init__(self, tally: Tally) -> None:
        super().__init__()
        self._tally = tally

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Do nothing."""

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:  # noqa: ARG002
        """Count the action."""
        self._tally.actions += 1

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Do nothing."""


def drive_bare(robot: SimulatedRobot, site: Site, episodes: int) -> Tally:
    """Run the bare loop: observe, guard, execute, without recording."""
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
            result = None if blocked else robot.drive(PARAMETERS.movement_of(action))
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
        model=ModelCard("wanderer"),
        protocol=PARAMETERS,
        seed=0,
        trials=plan_trials(["chair"], [START], episodes),
    )
    with Journal.open(results.database_url) as journal, StopRequests() as stop:
        campaign = journal.find_or_create_campaign(plan)
        viewer = RerunEpisodes(live=False) if kept is KeepFiles.ALL else None
        recording = RecordingOptions(results, viewer, keep=kept)
        began = time.perf_counter()
        model = DrivingModel(Wanderer(), "wanderer")
        session = Session(
            journal=journal,
            robots=InProcessExecutor(robot, lambda _trial: model),
            recording=recording,
            site=site,
            parameters=PARAMETERS,
            stop_requests=stop,
            operator=Counting(tally),
        )
        run(CampaignSource(session, campaign), session)
        tally.seconds = time.perf_counter() - began
    return tally


def main() -> None:
    """Run the measurement and print the rates."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--episodes", type=int, default=6, help="episodes of up to 60 actions each")
    arguments.add_argument(
        "--keep", type=KeepFiles, default=KeepFiles.ALL, choices=list(KeepFiles), help="files to keep"
    )
    arguments.add_argument("--camera", default="", help="WIDTHxHEIGHT of the only image that the recorded run renders")
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
        drive_bare(robot, site, 1)
        drive_recorded(recording, site, 1, Path(directory) / "warm-up", kept)
        bare = drive_bare(robot, site, episodes)
        recorded = drive_recorded(recording, site, episodes, Path(directory) / "measured", kept)
    print(f"bare loop     {bare.rate:6.1f} actions/s  ({bare.actions} actions)")
    for part, spent_s in (("observe", bare.observe_s), ("guard", bare.guard_s), ("execute", bare.execute_s)):
        print(f"  {part:<11} {spent_s / bare.actions * 1000:6.2f} ms per action")
    print(f"recorded run  {recorded.rate:6.1f} actions/s  ({recorded.actions} actions, --keep {kept})")
    print(f"ratio         {recorded.rate / bare.rate:6.2f}")


if __name__ == "__main__":
    main()
