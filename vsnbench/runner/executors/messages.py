"""Messages between the driver process and a local worker: plain values over a socket."""

from dataclasses import dataclass

from vsnbench.errors import VsnbenchError
from vsnbench.models.checkpoints.torch_runtime import GpuMemory
from vsnbench.results.writing.campaigns import Trial
from vsnbench.runner.episode.recorder import RecordingOptions
from vsnbench.runner.loop.contract import ActionsTaken, LoopEvent
from vsnbench.runner.setup.trial_setup import SetupDescription, TrialSetupSpec
from vsnbench.runner.stopping.requests import StopRequest


@dataclass(frozen=True, slots=True)
class Prepare:
    """Make a trial setup."""

    spec: TrialSetupSpec
    command: str
    """Command line of the driver, for the provenance."""


@dataclass(frozen=True, slots=True)
class RunTrial:
    """Claim a trial, run it and record it."""

    trial: Trial
    recording: RecordingOptions


Order = Prepare | RunTrial | StopRequest
"""A StopRequest ends the episode as requested, then the process."""


@dataclass(frozen=True, slots=True)
class Prepared:
    """The trial setup is ready."""

    description: SetupDescription
    memory_bytes: int
    """Memory that the process does not share."""
    gpu: GpuMemory | None = None
    """Memory that it takes of a GPU, where it uses one that reports it."""


Report = Prepared | ActionsTaken | tuple[LoopEvent, ...] | VsnbenchError
"""A tuple of events, which may be empty, ends a trial: the worker waits for the next order. An error means that no
worker can carry out the order."""
