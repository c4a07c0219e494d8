"""What runs the trials of a campaign: this process with its own robot, local workers or a Ray cluster."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

from vsnbench.results.writing.campaigns import OpenCampaign
from vsnbench.results.writing.provenance import Provenance, gather_provenance
from vsnbench.robots.contract import BatteryReader, CameraPreview
from vsnbench.runner.executors.capacity import ClusterRequest, WorkerRequest
from vsnbench.runner.executors.collecting import MergingPool
from vsnbench.runner.executors.contract import TrialPool
from vsnbench.runner.executors.in_process import DrivingModel, InProcessExecutor, SingleModel
from vsnbench.runner.executors.local_pool import SharedWorkers
from vsnbench.runner.executors.pool import PoolExecutor
from vsnbench.runner.executors.process import dismiss_fork_server
from vsnbench.runner.executors.ray_pool import RayTasks
from vsnbench.runner.loop.contract import TrialExecutor
from vsnbench.runner.loop.session_context import SessionContext
from vsnbench.runner.setup.trial_setup import SetupDescription, TrialSetup, TrialSetupSpec, open_trial_setup


class Backend(ABC):
    """A robot and a model that are ready, in this process or in workers."""

    description: SetupDescription
    """Robot and model of every trial of the campaign."""
    glimpse: CameraPreview | None = None
    """Camera image while the robot drives; None for several robots, and for a robot without it."""
    battery: BatteryReader = staticmethod(lambda: None)
    """Reads the battery of the robot's base."""

    def provenance(self) -> Provenance:
        """Describe this process as far as results depend on it."""
        return gather_provenance(of_run=True)

    @abstractmethod
    def halt(self) -> None:
        """Halt every robot, from any thread, before the process is forced to end."""

    @abstractmethod
    def executor(self, context: SessionContext, campaign: OpenCampaign) -> TrialExecutor:
        """Return what runs the trials of a session."""


@contextmanager
def open_backend(
    spec: TrialSetupSpec, request: WorkerRequest | ClusterRequest, shared: SharedWorkers | None = None
) -> Iterator[Backend]:
    """Make the setup in this process, start workers, or connect to a cluster.

    Args:
        spec: setup of every trial.
        request: number of workers, and where.
        shared: workers of this machine that outlive the campaign. Without them, workers end with the context.

    Raises:
        UsageError: something named does not exist, does not fit together, or does not fit into memory.
        VsnbenchError: the model, the robot or the cluster cannot be used.
    """
    if isinstance(request, ClusterRequest):
        with MergingPool(RayTasks(spec, request.address, request.workers, request.gpus_each)) as pool:
            yield _Workers(pool)
    elif request.limit == 1:
        dismiss_fork_server()
        with open_trial_setup(spec) as setup:
            yield _InProcess(setup)
    else:
        own = SharedWorkers() if shared is None else nullcontext(shared)
        with own as workers, workers.prepared(spec, request) as local:
            yield _Workers(local)


class _InProcess(Backend):
    """The trial setup of this process."""

    def __init__(self, setup: TrialSetup) -> None:
        self._setup = setup
        self.description = setup.description
        self.glimpse = setup.robot.preview if setup.robot.has_preview else None
        self.battery = lambda: setup.robot.battery

    def provenance(self) -> Provenance:
        return self._setup.provenance()

    def halt(self) -> None:
        self._setup.robot.halt()

    def executor(self, context: SessionContext, campaign: OpenCampaign) -> TrialExecutor:
        del campaign
        model = DrivingModel(self._setup.policy, self.description.title)
        return InProcessExecutor(context, self._setup.robot, SingleModel(model))


class _Workers(Backend):
    """A pool of workers with simulated robots."""

    def __init__(self, pool: TrialPool) -> None:
        self._pool = pool
        self.description = pool.description

    def halt(self) -> None:
        self._pool.kill()

    def executor(self, context: SessionContext, campaign: OpenCampaign) -> TrialExecutor:
        return PoolExecutor(context, campaign, self._pool)
