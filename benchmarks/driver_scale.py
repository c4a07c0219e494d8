"""Measures the driver's time per episode of a cluster.

python benchmarks/driver_scale.py                           1,000 workers, 3,000 episodes; a minute
python benchmarks/driver_scale.py --workers 200 --actions 20

From it follows the number of workers that one driver can serve. Only the workers are simulated: each sleeps for the
duration of an episode and returns a copy of one real episode bundle. The claims, messages, files and database rows are
real and go through the functions that merge the results of a cluster.
"""

import argparse
import heapq
import os
import pickle
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.writing.campaigns import CampaignPlan, Trial
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.episode.recorder import RecordingOptions
from vsnbench.runner.executors.collecting import MergingPool, TaskRunner
from vsnbench.runner.executors.episode_bundle import EpisodeBundle, run_bundled
from vsnbench.runner.loop.campaign import CampaignSource
from vsnbench.runner.loop.contract import Session, TrialReturned
from vsnbench.runner.loop.run import run
from vsnbench.runner.setup.trial_setup import SetupDescription, TrialSetupSpec, open_trial_setup
from vsnbench.runner.stopping.requests import StopRequests
from vsnbench.sites.site import load_site


class Sleepers(TaskRunner):
    """Workers that sleep instead of driving, and return a pickled episode bundle as over a network."""

    def __init__(self, description: SetupDescription, bundle: EpisodeBundle, workers: int, episode_s: float) -> None:
        self.description = description
        self._capacity = workers + max(1, workers // 8)
        self.summary = f"{workers} sleeping workers"
        self._packed = pickle.dumps(bundle, protocol=pickle.HIGHEST_PROTOCOL)
        self._workers, self._episode_s = workers, episode_s
        self._free_at = [0.0] * workers
        self._asleep: list[tuple[float, int, Trial]] = []
        self.waited_s = 0.0
        self.megabytes = len(self._packed) / 1e6

    @property
    def capacity(self) -> int:
        return self._capacity

    def submit(self, trial: Trial, seed: int) -> None:
        del seed
        begins_s = max(heapq.heappop(self._free_at), time.monotonic())
        # Spread the durations: a thousand workers that start together would also finish together.
        wakes_s = begins_s + self._episode_s * (0.5 + (trial.id * 0.618) % 1.0)
        heapq.heappush(self._free_at, wakes_s)
        heapq.heappush(self._asleep, (wakes_s, trial.id, trial))

    def results(self, timeout_s: float) -> Sequence[EpisodeBundle | TrialReturned]:
        wait_s = min(timeout_s, self._asleep[0][0] - time.monotonic()) if self._asleep else timeout_s
        if wait_s > 0:
            self.waited_s += wait_s
            time.sleep(wait_s)
        if not self._asleep or self._asleep[0][0] > time.monotonic():
            return []
        trial = heapq.heappop(self._asleep)[2]
        bundle: EpisodeBundle = pickle.loads(self._packed)
        return [replace(bundle, trial=trial)]

    def cancel(self) -> None:
        self._asleep.clear()


def main() -> None:
    """Run the campaign and print the driver's rates."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--workers", type=int, default=1000)
    parser.add_argument("--episodes", type=int, default=3000)
    parser.add_argument("--actions", type=int, default=20, help="actions per episode")
    parser.add_argument("--episode-s", type=float, default=1.0, help="mean seconds that a worker sleeps per episode")
    parser.add_argument("--without-images", action="store_true", help="transfer only the database rows")
    asked = parser.parse_args()
    site, parameters = load_site("apartment"), ProtocolParameters(max_actions=asked.actions)
    plan = TrialSetupSpec(site, "random", ("chair",), parameters=parameters)
    with open_trial_setup(plan) as setup, tempfile.TemporaryDirectory(prefix="vsnbench-driver-") as directory:
        for seed in range(100):  # the random walk may stop early
            bundle = run_bundled(setup, setup.provenance("typed"), plan, Trial("chair", 1, id=1, campaign_id=1), seed)
            if bundle.outcome.actions == asked.actions:
                break
        if asked.without_images:
            bundle = replace(bundle, files={})
        results = ResultsDirectory.locate(Path(directory))
        results.prepare()
        described = setup.description
        trials = [Trial("chair", 1, number) for number in range(1, asked.episodes + 1)]
        campaign = CampaignPlan(site, described.robot, described.model, parameters, 0, trials, described.conditions)
        sleepers = Sleepers(described, bundle, asked.workers, asked.episode_s)
        with Journal.open(results.database_url) as journal, StopRequests() as stop, MergingPool(sleepers) as pool:
            session = Session(
                journal=journal,
                robots=pool,
                recording=RecordingOptions(results),
                site=site,
                parameters=parameters,
                stop_requests=stop,
            )
            began_s, busy_s = time.perf_counter(), time.process_time()
            source = CampaignSource(session, journal.find_or_create_campaign(campaign))
            result = source.result(run(source, session))
            taken_s, busy_s = time.perf_counter() - began_s, time.process_time() - busy_s
    rate = result.episodes / taken_s
    offered = asked.workers / asked.episode_s
    size = f"{bundle.outcome.actions} actions and {sleepers.megabytes:.1f} MB"
    print(f"load before: {os.getloadavg()[0]:.2f}; {size} per episode")
    print(f"offered   {offered:8.0f} episodes/s by {asked.workers} workers of {asked.episode_s:g} s per episode")
    print(f"merged    {rate:8.1f} episodes/s, {rate * sleepers.megabytes:.0f} MB/s; {result.left} left")
    wall_ms, processor_ms = (total_s / result.episodes * 1000 for total_s in (taken_s, busy_s))
    idle = sleepers.waited_s / taken_s
    print(f"driver    {wall_ms:8.2f} ms per episode, {processor_ms:.2f} ms of processor time; idle {idle:.0%}")
    print(f"keeps up with {rate * 4:.0f} workers whose episodes take 4 s, with {rate * 30:.0f} at 30 s")


if __name__ == "__main__":
    main()
