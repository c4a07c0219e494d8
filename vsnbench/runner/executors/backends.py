"""Opens what runs the trials of a campaign: this process with its own robot, local workers or a Ray cluster."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

from vsnbench.runner.executors.capacity import WorkerOptions, WorkerRequest
from vsnbench.runner.executors.collecting import MergingPool
from vsnbench.runner.executors.in_process import InProcessExecutor
from vsnbench.runner.executors.local_pool import SharedWorkers
from vsnbench.runner.executors.process import dismiss_fork_server
from vsnbench.runner.executors.ray_pool import RayTasks
from vsnbench.runner.loop.contract import TrialExecutor
from vsnbench.runner.setup.trial_setup import TrialSetupSpec, open_trial_setup


@contextmanager
def open_executor(
    spec: TrialSetupSpec, request: WorkerRequest | None, options: WorkerOptions, shared: SharedWorkers | None = None
) -> Iterator[TrialExecutor]:
    """Make the setup in this process, start workers, or connect to a cluster.

    Args:
        spec: the setup.
        request: workers of this machine; None for the cluster of the options.
        options: options of the command line about workers.
        shared: workers of this machine that outlive the campaign. Without them, workers end with the context.

    Raises:
        UsageError: something named does not exist, does not fit together, or does not fit into memory.
        VsnbenchError: the model, the robot or the cluster cannot be used.
    """
    if request is None:
        with MergingPool(RayTasks(spec, options)) as pool:
            yield pool
    elif request.limit == 1:
        dismiss_fork_server()
        with open_trial_setup(spec) as setup:
            yield InProcessExecutor.of_setup(setup)
    else:
        own = SharedWorkers() if shared is None else nullcontext(shared)
        with own as workers, workers.prepared(spec, request) as local:
            yield local
