"""Whoever runs the trials of a campaign: this process alone with its robot, or workers that it hands them out to."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from vsnbench.database.journal import Journal
from vsnbench.database.provenance import Provenance, gather_provenance
from vsnbench.errors import UsageError
from vsnbench.robots.registry import is_simulated
from vsnbench.runner.attendance import Attendance, Occasion
from vsnbench.runner.bench import Bench, BenchDescription, BenchPlan, open_bench
from vsnbench.runner.pool.capacity import Capacity, Wish, wish_for
from vsnbench.runner.pool.cluster import ClusterAddress, RayTasks
from vsnbench.runner.pool.contract import TrialPool
from vsnbench.runner.pool.handing_out import hand_out
from vsnbench.runner.pool.local import LocalPool
from vsnbench.runner.pool.merging import MergingPool
from vsnbench.runner.pool.messages import Keeping
from vsnbench.runner.recorder import EpisodeRecorderFanOut, RecordingTarget
from vsnbench.runner.session import SessionResult, run_session


@dataclass(frozen=True, slots=True)
class WorkersAsked:
    """How many trials at once somebody asks for, and where."""

    count: int | None = 1
    """None for as many as make sense."""
    cluster: str = ""
    """`ray://host:port`; this machine when empty."""
    gpus_each: float = 0.0
    """How much of a GPU each worker of a cluster holds."""


@dataclass(frozen=True, slots=True)
class ClusterWish:
    """Workers of a cluster."""

    address: ClusterAddress
    workers: int | None
    gpus_each: float


class Crew(Protocol):
    """One who runs trials, or many."""

    @property
    def description(self) -> BenchDescription:
        """The robot and the model, as every trial of the campaign has them."""
        ...

    def provenance(self) -> Provenance:
        """Describe this process, as far as it has a hand in the results."""
        ...

    def halt(self) -> None:
        """Stand everything still that moves, from any thread; before the process is ended for certain."""
        ...

    def run(self, journal: Journal, keeping: Keeping, attendance: Attendance, occasion: Occasion) -> SessionResult:
        """Run what is left of the campaign.

        Raises:
            Stopped: a person or the system asked to stop; what happened until then is recorded.
            VsnbenchError: nothing more can be run or kept.
        """
        ...


@contextmanager
def open_crew(plan: BenchPlan, wish: Wish | ClusterWish) -> Iterator[Crew]:
    """Make the bench here for one, start workers for more, or have a cluster's.

    Raises:
        UsageError: something named does not exist, does not fit together, or does not fit into memory.
        VsnbenchError: the model, the robot or the cluster cannot be used.
    """
    if isinstance(wish, ClusterWish):
        with MergingPool(RayTasks(plan, wish.address, wish.workers, wish.gpus_each)) as pool:
            yield _Several(plan, pool)
    elif wish.at_most == 1:
        with open_bench(plan) as bench:
            yield _Alone(plan, bench)
    else:
        with LocalPool(plan, wish) as local:
            yield _Several(plan, local)


def wish_of(asked: WorkersAsked, plan: BenchPlan, trials: int, *, live: bool) -> Wish | ClusterWish:
    """Return how many workers are wanted, and where.

    Args:
        asked: as it was typed.
        plan: what they would have.
        trials: how many there are at most.
        live: each episode is shown as it happens.

    Raises:
        UsageError: several were asked for where there is only one robot, model or viewer.
    """
    single = ""
    if not is_simulated(plan.robot):
        single = f"robot {plan.robot} is one, and only our own simulated robots can be as many as workers"
    elif plan.pretend_real:
        single = "--pretend-real plays one robot, which one person places"
    elif live:
        single = "--live shows one episode after another"
    elif plan.model.startswith(("ws://", "wss://")):
        single = f"the model at {plan.model} serves one client at a time"
    if asked.gpus_each and not asked.cluster:
        raise UsageError("--gpus is for the workers of a --cluster", advice="name the model's device with --device")
    several = f"--cluster {asked.cluster}" if asked.cluster else f"--workers {asked.count}"
    if single and (asked.cluster or (asked.count or 1) > 1):
        raise UsageError(f"{several}: {single}", advice=f"leave {several.split(maxsplit=1)[0]} out")
    if asked.cluster:
        return ClusterWish(ClusterAddress.parse(asked.cluster), asked.count, asked.gpus_each)
    return Wish(1, asked_for=False) if single else wish_for(asked.count, trials, Capacity.of_this_machine())


class _Alone:
    """This process, with its bench and whoever stands beside the robot."""

    def __init__(self, plan: BenchPlan, bench: Bench) -> None:
        self._plan = plan
        self._bench = bench
        self.description = bench.description

    def provenance(self) -> Provenance:
        return self._bench.provenance()

    def halt(self) -> None:
        self._bench.robot.halt()

    def run(self, journal: Journal, keeping: Keeping, attendance: Attendance, occasion: Occasion) -> SessionResult:
        described = self.description
        target = RecordingTarget(
            journal,
            keeping.results,
            described.title,
            described.robot.profile,
            keeping.viewer,
            keeping.operator,
            self._plan.kept,
        )
        with attendance.attend(occasion) as attendant:
            return run_session(
                journal,
                keeping.campaign,
                self._plan.site,
                self._plan.parameters,
                self._bench.robot,
                self._bench.policy,
                partial(EpisodeRecorderFanOut, target),
                attendant,
                occasion.stop,
                keeping.operator,
            )


class _Several:
    """Workers, none of which anybody stands beside."""

    def __init__(self, plan: BenchPlan, pool: TrialPool) -> None:
        self._plan = plan
        self._pool = pool
        self.description = pool.description

    def provenance(self) -> Provenance:
        return gather_provenance()

    def halt(self) -> None:
        self._pool.kill()

    def run(self, journal: Journal, keeping: Keeping, attendance: Attendance, occasion: Occasion) -> SessionResult:
        site, parameters = self._plan.site, self._plan.parameters
        with attendance.oversee(occasion) as overview:
            return hand_out(journal, keeping, site, parameters, self._pool, overview, occasion.stop)
