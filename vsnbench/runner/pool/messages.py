"""What the driver and a worker of this machine say to each other: plain values over a socket of their own."""

from dataclasses import dataclass

from vsnbench.database.campaign_plan import OpenCampaign, Trial
from vsnbench.errors import VsnbenchError
from vsnbench.models.torch_runtime import GpuMemory
from vsnbench.record.entries import EpisodeViewer
from vsnbench.record.results import ResultsDirectory
from vsnbench.runner.bench import BenchDescription, BenchPlan
from vsnbench.runner.episode import EpisodeOutcome
from vsnbench.runner.stopping import StopRequest


@dataclass(frozen=True, slots=True)
class Prepare:
    """Make this bench."""

    plan: BenchPlan
    command: tuple[str, ...]
    """What was typed, for the record."""


@dataclass(frozen=True, slots=True)
class Keeping:
    """Where the episodes of a campaign are kept, and how."""

    campaign: OpenCampaign
    results: ResultsDirectory
    viewer: EpisodeViewer | None
    """Whoever copies the episodes; a plain value, since every worker has its own."""
    operator: str


@dataclass(frozen=True, slots=True)
class RunTrial:
    """Claim this trial, run it, and keep it."""

    trial: Trial
    keeping: Keeping
    cores_left: bool
    """There are more cores than workers: steps can be kept while the next one is driven."""


@dataclass(frozen=True, slots=True)
class Stop:
    """End the episode as somebody asks, and then yourself."""

    request: StopRequest


Order = Prepare | RunTrial | Stop


@dataclass(frozen=True, slots=True)
class Prepared:
    """The bench stands."""

    description: BenchDescription
    memory_bytes: int
    """What the process has to itself."""
    gpu: GpuMemory | None = None
    """What it takes of a GPU, where it uses one that tells."""


@dataclass(frozen=True, slots=True)
class Acted:
    """So many actions were taken and kept since the last such report."""

    actions: int


@dataclass(frozen=True, slots=True)
class Ended:
    """An episode has ended, and is kept."""

    number: int
    trial: Trial
    outcome: EpisodeOutcome


@dataclass(frozen=True, slots=True)
class Free:
    """The trial is over, or was somebody else's; the worker waits for the next."""


@dataclass(frozen=True, slots=True)
class Refused:
    """What was ordered cannot be done, by any worker."""

    error: VsnbenchError


Report = Prepared | Acted | Ended | Free | Refused
