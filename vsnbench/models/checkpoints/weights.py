"""Finds a model's weights: a named file, the directory of weights, or the embedded file."""

import hashlib
import os
from pathlib import Path

from vsnbench.errors import ModelError
from vsnbench.files.home import expanded
from vsnbench.files.package_data import resource_directory
from vsnbench.files.regular import open_regular

WEIGHTS_VARIABLE = "VSNBENCH_WEIGHTS"
EMBEDDED = "embedded"
"""Name of the embedded weights, used instead of a file."""


def weights_directory() -> Path:
    """Return the directory of weights: $VSNBENCH_WEIGHTS, or a directory in the user's data directory."""
    named = os.environ.get(WEIGHTS_VARIABLE)
    if named:
        return expanded(named)
    data = os.environ.get("XDG_DATA_HOME") or "~/.local/share"
    return expanded(data) / "vsnbench" / "weights"


def embedded_weights(file_name: str) -> Path | None:
    """Return the embedded weights of that name, or None."""
    path = resource_directory("weights") / file_name
    return path if path.is_file() else None


def find_weights(model: str, file_name: str, given: Path | None) -> Path:
    """Return the file of a model's weights.

    Args:
        model: the model's name, for the message.
        file_name: name of the file in the directory of weights, such as `pirlnav.ckpt`.
        given: file named by the user, or `embedded`; None for the file in the directory of weights, or else the
            embedded file.

    Raises:
        ModelError: the file does not exist.
    """
    embedded = embedded_weights(file_name)
    if given == Path(EMBEDDED):
        if embedded is None:
            raise ModelError(f"{model} has no embedded weights", advice="name a file with --weights FILE")
        return embedded
    if given is not None:
        if not given.is_file():
            raise ModelError(f"no weights at {given}")
        return given
    path = weights_directory() / file_name
    if path.is_file():
        return path
    if embedded is not None:
        return embedded
    raise ModelError(
        f"{model} needs weights",
        advice=f"name them with --weights FILE, put them at $VSNBENCH_WEIGHTS/{file_name} "
        f"(now {path}), or run `vsnbench models fetch {model} URL`",
    )


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, in hexadecimal."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
