"""What can be chosen about PIRLNav; the defaults are the correct conditions, not the published ones."""

from enum import StrEnum

from pydantic import BaseModel, ConfigDict, Field


class Choice(StrEnum):
    """How an action is chosen from the probabilities."""

    AUTO = "auto"
    """As the authors evaluated: sampled for weights with a critic (fine-tuned by RL), greedy for imitation-only; the
    embedded demonstration weights are sampled."""
    GREEDY = "greedy"
    SAMPLED = "sampled"


class CompassSource(StrEnum):
    """Where the heading comes from."""

    ODOMETRY = "odometry"
    TURNS = "turns"
    """Counted from the turning movements (paper, Section 3.2.2)."""


class Runtime(StrEnum):
    """What runs the network."""

    AUTO = "auto"
    """On a CPU the faster of onnxruntime, where it is installed, and PyTorch: measured once a machine."""
    TORCH = "torch"
    ONNXRUNTIME = "onnxruntime"


class Precision(StrEnum):
    """Width of the numbers in the image encoder."""

    SINGLE = "single"
    """The same on every device, so that one lab's GPU and another's CPU run one model."""
    HALF = "half"
    """On CUDA; of one image at a time, no faster on an H100."""


class PIRLNavSettings(BaseModel):
    """The settings file of PIRLNav."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    decision: Choice = Field(default=Choice.AUTO, description="auto, greedy or sampled")
    compass: CompassSource = Field(default=CompassSource.ODOMETRY, description="odometry or turns")
    turn_deg: float = Field(default=30.0, gt=0, le=180, description="angle of one turn, for compass: turns")
    as_published: bool = Field(
        default=False,
        description="feed what the published ROS4VSN code fed: raw odometry (x, +y) that is not relative to the "
        "episode's start, and images with the training augmentation",
    )
    runtime: Runtime = Field(default=Runtime.AUTO, description="auto, torch or onnxruntime")
    precision: Precision = Field(default=Precision.SINGLE, description="single, or half (needs CUDA)")
    threads: int | None = Field(default=None, ge=1, le=256, description="CPU threads; at most 8 when not given")
