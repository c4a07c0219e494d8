"""Three hundred episodes in one process: do threads, file handles and memory stay what they were?

Short episodes of `random` in the apartment with a small camera, recorded in full: images, database, Rerun copy. What
an episode leaves behind would show here, whatever its length.
"""

import argparse
import tempfile
from functools import partial
from pathlib import Path

import psutil

from vsnbench.models.baselines.random_walk import RandomWalk
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.writing.campaigns import CampaignPlan, ModelIdentity
from vsnbench.results.writing.journal import Journal
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.runner.episode.recorder import EpisodeRecorderFanOut, RecordingTarget
from vsnbench.runner.episode.step import EpisodePlan, Step
from vsnbench.runner.executors.in_process import DrivingModel, InProcessExecutor, SingleModel
from vsnbench.runner.loop.campaign import CampaignSource
from vsnbench.runner.loop.run import run
from vsnbench.runner.loop.session_context import RecordingOptions, SessionContext
from vsnbench.runner.operator.contract import AbsentOperator, EndedEpisode, Upcoming
from vsnbench.runner.setup.selection import plan_trials
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.sites.site import load_site
from vsnbench.viewer.live import RerunEpisodes

SETTLED = 20
"""Episodes after which caches are full and everything has been imported."""
PARAMETERS = ProtocolParameters(max_actions=5)


class Watching(AbsentOperator):
    """Notes what the process holds after each episode."""

    def __init__(self) -> None:
        super().__init__()
        self._process = psutil.Process()
        self.threads: list[int] = []
        self.files: list[int] = []
        self.memory_mib: list[float] = []

    def trial_begins(self, upcoming: Upcoming) -> None:
        """Say nothing."""

    def step_taken(self, plan: EpisodePlan, step: Step) -> None:
        """Say nothing."""

    def episode_ended(self, ended: EndedEpisode) -> None:
        """Measure."""
        self.threads.append(self._process.num_threads())
        self.files.append(self._process.num_fds())
        self.memory_mib.append(self._process.memory_info().rss / 2**20)
        if ended.number % SETTLED == 0:
            print(
                f"{ended.number:5d} episodes: {self.threads[-1]:3d} threads, {self.files[-1]:3d} files, "
                f"{self.memory_mib[-1]:6.1f} MiB",
                flush=True,
            )


def drive(episodes: int, directory: Path) -> Watching:
    """Run the episodes as `vsnbench run` does."""
    results, site, watching = ResultsDirectory.locate(directory), load_site("apartment"), Watching()
    results.prepare()
    profile = load_profile("turtlebot2")
    small = profile.camera.model_copy(update={"width": 64, "height": 48})
    robot = SimulatedRobot(site, profile.model_copy(update={"camera": small}), PARAMETERS)
    plan = CampaignPlan(
        site, robot.identity, ModelIdentity("random"), PARAMETERS, 0, plan_trials(["chair"], [1], episodes)
    )
    with Journal.open(results.database_url) as journal, StopRequests() as stop:
        target = RecordingTarget(journal, results, "random", robot.profile, RerunEpisodes(live=False))
        context = SessionContext(journal, watching, stop, site, PARAMETERS, RecordingOptions(results))
        model = SingleModel(DrivingModel(RandomWalk(), partial(EpisodeRecorderFanOut, target)))
        source = CampaignSource(journal, journal.find_or_create_campaign(plan))
        run(source, InProcessExecutor(context, robot, model), watching)
    return watching


def main() -> None:
    """Measure, print, and fail where something grows."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--episodes", type=int, default=300)
    episodes = arguments.parse_args().episodes
    if episodes < SETTLED + 20:
        arguments.error(f"--episodes {episodes}: memory has settled after {SETTLED}, so {SETTLED + 20} at least")
    with tempfile.TemporaryDirectory() as directory:
        seen = drive(episodes, Path(directory))
    settled, late = slice(SETTLED - 1, SETTLED + 20), slice(-20, None)
    growth = max(seen.memory_mib[late]) / max(seen.memory_mib[settled])
    print(f"after {SETTLED} and after {episodes} episodes:")
    print(f"  threads {max(seen.threads[settled])} and {max(seen.threads[late])}")
    print(f"  files   {max(seen.files[settled])} and {max(seen.files[late])}")
    print(f"  memory  x {growth:.3f}")
    kept = max(seen.threads[late]) <= max(seen.threads[settled]) and max(seen.files[late]) <= max(seen.files[settled])
    raise SystemExit(0 if kept and growth < 1.1 else 1)


if __name__ == "__main__":
    main()
