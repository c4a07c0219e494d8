"""Messages between the driver process and a local worker: plain values over a socket."""

from dataclasses import dataclass

from vsnbench.errors import VsnbenchError
from vsnbench.models.checkpoints.torch_runtime import GpuMemory
from vsnbench.results.writing.campaigns import Trial
from vsnbench.runner.episode.recorder import RecordingOptions
from vsnbench.runner.executors.contract import ActionsTaken, EpisodeStored
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


@dataclass(frozen=True, slots=True)
class Stop:
    """End the episode as requested, then the process."""

    request: StopRequest


Order = Prepare | RunTrial | Stop


@dataclass(frozen=True, slots=True)
class Prepared:
    """The trial setup is ready."""

    description: SetupDescription
    memory_bytes: int
    """Memory that the process does not share."""
    gpu: GpuMemory | None = None
    """Memory that it takes of a GPU, where it uses one that reports it."""
    sessions: int | None = None
    """Number of clients that the model's server takes; None for a model that every worker has for itself."""


@dataclass(frozen=True, slots=True)
class Free:
    """The trial is over, or another process had claimed it; the worker waits for the next order."""


@dataclass(frozen=True, slots=True)
class Refused:
    """No worker can carry out the order."""

    error: VsnbenchError


Report = Prepared | ActionsTaken | EpisodeStored | Free | Refused
