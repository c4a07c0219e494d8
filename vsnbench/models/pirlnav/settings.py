"""The settings of PIRLNav. The defaults are the correct conditions, not the published ones."""

from enum import StrEnum

from pydantic import BaseModel, ConfigDict, Field


class Choice(StrEnum):
    """Choice of an action from the probabilities."""

    AUTO = "auto"
    """As in the authors' evaluation: sampled for weights with a critic (fine-tuned by RL), greedy for imitation only.
    Sampled for the embedded demonstration weights."""
    GREEDY = "greedy"
    SAMPLED = "sampled"


class CompassSource(StrEnum):
    """Source of the heading."""

    ODOMETRY = "odometry"
    TURNS = "turns"
    """Counted from the turning movements (paper, Section 3.2.2)."""


class Runtime(StrEnum):
    """Software that runs the network."""

    AUTO = "auto"
    """On a CPU, the faster of onnxruntime and PyTorch if it is installed, measured once per machine."""
    TORCH = "torch"
    ONNXRUNTIME = "onnxruntime"


class Precision(StrEnum):
    """Precision of the image encoder."""

    SINGLE = "single"
    """The same on every device, so that results from a GPU and a CPU belong to one model."""
    HALF = "half"
    """CUDA only; for single images, not faster on an H100."""


class PIRLNavSettings(BaseModel):
    """The settings file of PIRLNav."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    decision: Choice = Field(default=Choice.AUTO, description="auto, greedy or sampled")
    compass: CompassSource = Field(default=CompassSource.ODOMETRY, description="odometry or turns")
    turn_deg: float = Field(default=30.0, gt=0, le=180, description="angle of one turn, for compass: turns")
    as_published: bool = Field(
        default=False,
        description="use the input of the published ROS4VSN code: raw odometry (x, +y) that is not relative to the "
        "episode's start, and images with the training augmentation",
    )
    runtime: Runtime = Field(default=Runtime.AUTO, description="auto, torch or onnxruntime")
    precision: Precision = Field(default=Precision.SINGLE, description="single, or half (needs CUDA)")
    threads: int | None = Field(
        default=None, ge=1, le=256, description="number of CPU threads; null: the cores, at most 8"
    )
