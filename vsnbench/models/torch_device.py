"""Which device the neural parts run on."""

import torch

from vsnbench.errors import ModelError, UsageError

DEVICES = ("auto", "cpu", "cuda", "mps")


def available_device(wanted: str) -> str:
    """Return the device wanted, or for `auto` the best there is.

    Raises:
        UsageError: there is no such kind of device.
        ModelError: this machine has none of that kind.
    """
    if wanted not in DEVICES:
        raise UsageError(f"no device {wanted!r}: it is one of {', '.join(DEVICES)}")
    there = {"cpu": True, "cuda": torch.cuda.is_available(), "mps": torch.backends.mps.is_available()}
    if wanted == "auto":
        return next(device for device in ("cuda", "mps", "cpu") if there[device])
    if not there[wanted]:
        raise ModelError(f"PyTorch {torch.__version__} finds no {wanted} device here; use --device auto or cpu")
    return wanted
