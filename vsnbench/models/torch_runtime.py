"""Whether PyTorch is here, and on which device the neural parts run."""

from typing import Final

from vsnbench.errors import ModelError, UsageError

INSTALL_HINT: Final = "pip install 'vsnbench[neural]'"
DEVICES: Final = ("auto", "cpu", "cuda", "mps")


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
