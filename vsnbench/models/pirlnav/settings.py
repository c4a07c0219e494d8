"""The settings of PIRLNav. The defaults are the correct conditions, not the published ones."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

Runtime = Literal["auto", "torch", "onnxruntime"]
Precision = Literal["single", "half"]


class PIRLNavSettings(BaseModel):
    """The settings file of PIRLNav."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    decision: Literal["auto", "greedy", "sampled"] = Field(default="auto", description="auto, greedy or sampled")
    """Choice of an action from the probabilities. `auto` is as in the authors' evaluation: sampled for weights with a
    critic (fine-tuned by RL), greedy for imitation only; sampled for the embedded demonstration weights."""
    compass: Literal["odometry", "turns"] = Field(default="odometry", description="odometry or turns")
    """Source of the heading; `turns` counts the turning movements (paper, Section 3.2.2)."""
    turn_deg: float = Field(default=30.0, gt=0, le=180, description="angle of one turn, for compass: turns")
    as_published: bool = Field(
        default=False,
        description="use the input of the published ROS4VSN code: raw odometry (x, +y) that is not relative to the "
        "episode's start, and images with the training augmentation",
    )
    runtime: Runtime = Field(default="auto", description="auto, torch or onnxruntime")
    """Software that runs the network. `auto`: on a CPU, the faster of onnxruntime and PyTorch if it is installed,
    measured once per machine."""
    precision: Precision = Field(default="single", description="single, or half (needs CUDA)")
    """Precision of the image encoder. Single is the same on every device, so that results from a GPU and a CPU belong
    to one model; half is for CUDA only, and for single images not faster on an H100."""
    threads: int | None = Field(
        default=None, ge=1, le=256, description="number of CPU threads; null: the cores, at most 8"
    )
