"""Whether PyTorch is here, on which device the neural parts run, and what a process takes of a GPU."""

import sys
from dataclasses import dataclass
from typing import Final

from vsnbench.errors import ModelError, UsageError

INSTALL_HINT: Final = "pip install 'vsnbench[neural]'"
DEVICES: Final = ("auto", "cpu", "cuda", "mps")
_CONTEXT_BYTES: Final = 768 * 2**20
"""What CUDA and its libraries take of a GPU for a process, beside what PyTorch counts: 730 MB on an H100."""


@dataclass(frozen=True, slots=True)
class GpuMemory:
    """A GPU's memory, bytes."""

    taken_bytes: int
    """By this process, about."""
    free_bytes: int
    """What nobody has taken."""
    total_bytes: int


def require_torch() -> None:
    """Check that PyTorch is installed.

    Raises:
        ModelError: it is not; the message says how to install it.
    """
    try:
        import torch  # noqa: F401
    except ImportError as error:
        raise ModelError(f"this model needs PyTorch, which is not installed: {INSTALL_HINT}") from error


def available_device(wanted: str) -> str:
    """Return the device wanted, or for `auto` the best there is.

    Raises:
        UsageError: there is no such kind of device.
        ModelError: this machine has none of that kind.
    """
    import torch

    if wanted not in DEVICES:
        raise UsageError(f"no device {wanted!r}: it is one of {', '.join(DEVICES)}")
    there = {"cpu": True, "cuda": torch.cuda.is_available(), "mps": torch.backends.mps.is_available()}
    if wanted == "auto":
        return next(device for device in ("cuda", "mps", "cpu") if there[device])
    if not there[wanted]:
        raise ModelError(
            f"PyTorch {torch.__version__} finds no {wanted} device here", advice="use --device auto or cpu"
        )
    return wanted


def gpu_name(device: str) -> str:
    """Return what the GPU calls itself; empty for a device that has no name."""
    import torch

    return torch.cuda.get_device_name() if device == "cuda" else ""


def gpu_memory() -> GpuMemory | None:
    """Return how much of its GPU this process takes; None where it uses none, or one that does not tell."""
    torch = sys.modules.get("torch")
    if torch is None or not torch.cuda.is_initialized():
        return None
    free, total = torch.cuda.mem_get_info()
    return GpuMemory(torch.cuda.memory_reserved() + _CONTEXT_BYTES, free, total)
