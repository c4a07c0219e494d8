"""How many workers: as many as somebody asks for, or as this machine has cores, and memory for."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import psutil

from vsnbench.errors import UsageError
from vsnbench.robots.registry import is_simulated
from vsnbench.runner.bench import BenchPlan
from vsnbench.runner.pool.cluster import ClusterAddress
from vsnbench.runner.pool.messages import Prepared
from vsnbench.runner.pool.process import granted_cores

GIB = 2**30
AMPLE_BYTES = 3 * GIB
"""With so much free for each, workers are started together; with less, one is measured first."""
RUNNING_BYTES = 400 * 2**20
"""What an episode takes over a bench that has only been made: compiled code, images, Rerun, the database."""
_GPU_DEVICES = ("nvidia[0-9]*", "kfd")
"""In /dev, where there is a GPU that PyTorch could use: NVIDIA's, AMD's."""
FEWEST_TRIALS = 10
"""A worker needs some seconds to get ready: fewer trials are run in the driver's own process."""


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


@dataclass(frozen=True, slots=True)
class Wish:
    """How many workers somebody wants."""

    at_most: int
    asked_for: bool
    """By a number; else as many as the machine holds."""


@dataclass(frozen=True, slots=True)
class Capacity:
    """What a machine, or this part of it, has."""

    cores: int
    free_bytes: int
    has_gpu: bool = False
    """A model may run on one; that is known for certain when the first has been made."""

    @classmethod
    def of_this_machine(cls) -> Self:
        """Look, with the limits that a container or a batch system has set for this process."""
        free = psutil.virtual_memory().available
        if (left := _cgroup_memory_left()) is not None:
            free = min(free, left)
        gpu = sys.platform == "darwin" or any(any(Path("/dev").glob(name)) for name in _GPU_DEVICES)
        return cls(granted_cores(), free, gpu)

    def at_first(self, wish: Wish, device: str | None) -> int:
        """Return how many workers are started before anything is known of one of them.

        Args:
            wish: how many somebody wants.
            device: that the model was told to run on; None for whichever it chooses.
        """
        may_be_on_gpu = self.has_gpu and device != "cpu"
        fit = wish.at_most * AMPLE_BYTES <= self.free_bytes
        return wish.at_most if fit and not may_be_on_gpu else 1

    def words(self, workers: int, measured: Prepared) -> str:
        """Say what was chosen, and from what."""
        cores = f"{self.cores} core{'' if self.cores == 1 else 's'}"
        said = (
            f"{workers} worker{'' if workers == 1 else 's'}: {cores}, {self.free_bytes / GIB:.1f} GiB free; "
            f"one takes about {takes_bytes(measured) / GIB:.1f} GiB"
        )
        if gpu := measured.gpu:
            return f"{said} and {gpu.taken_bytes / GIB:.1f} of the GPU's {gpu.total_bytes / GIB:.1f} GiB"
        return f"{said}; the model is on a GPU, whose memory is not known" if measured.description.on_gpu else said


def wish_for(workers: int | None, trials: int, capacity: Capacity) -> Wish:
    """Return how many workers are to be started for so many trials; `workers` None for as many as make sense."""
    if workers is not None:
        return Wish(max(1, min(workers, trials)), asked_for=True)
    return Wish(1 if trials < FEWEST_TRIALS else min(capacity.cores, trials), asked_for=False)


def takes_bytes(measured: Prepared) -> int:
    """Return what a worker takes while it runs trials."""
    return measured.memory_bytes + RUNNING_BYTES


def chosen(wish: Wish, capacity: Capacity, measured: Prepared, started: int = 1) -> int:
    """Return how many workers are to run, once one of them is there.

    Args:
        wish: how many somebody wants.
        capacity: of this machine.
        measured: what one takes. A model on a GPU that does not tell of its memory is there once, unless more were
            asked for.
        started: how many there are already, and on the GPU.

    Raises:
        UsageError: more were asked for than memory holds.
    """
    one_bytes, gpu = takes_bytes(measured), measured.gpu
    held = max(1, capacity.free_bytes // one_bytes)
    held_by_gpu = held if gpu is None else started + gpu.free_bytes // gpu.taken_bytes
    if gpu is None and not wish.asked_for and measured.description.on_gpu:
        return 1
    if wish.at_most <= min(held, held_by_gpu):
        return wish.at_most
    if not wish.asked_for:
        return min(held, held_by_gpu)
    where, takes, free = "", one_bytes, capacity.free_bytes
    if gpu is not None and held_by_gpu < held:
        where, takes, free, held = (
            " of the GPU",
            gpu.taken_bytes,
            started * gpu.taken_bytes + gpu.free_bytes,
            held_by_gpu,
        )
    raise UsageError(
        f"{wish.at_most} workers: one takes about {takes / GIB:.1f} GiB{where} and {free / GIB:.1f} GiB are free, "
        f"which holds {held}",
        advice=f"give --workers {held}, or leave it out",
    )


def _cgroup_memory_left() -> int | None:
    limit, used = (_read(Path(f"/sys/fs/cgroup/memory.{name}")).strip() for name in ("max", "current"))
    return max(int(limit) - int(used), 0) if limit.isdecimal() and used.isdecimal() else None


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii")
    except OSError:
        return ""


def wish_of(
    asked: WorkersAsked, plan: BenchPlan, trials: int, *, live: bool, attended: bool = False
) -> Wish | ClusterWish:
    """Return how many workers are wanted, and where.

    Args:
        asked: as it was typed.
        plan: what they would have.
        trials: how many there are at most.
        live: each episode is shown as it happens.
        attended: somebody stands beside the robot.

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
    elif attended:
        single = "--console has a person beside one robot"
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
