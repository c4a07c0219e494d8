"""Checks the tensors of a checkpoint against the network that they are for."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.errors import ModelError

_LONGEST_NAME = 80


def only_tensors(named: Mapping[str, Any], origin: str) -> Mapping[str, npt.NDArray[Any]]:
    """Return the tensors of a checkpoint by name.

    Raises:
        ModelError: one of them is something else.
    """
    broken = next((name for name, tensor in named.items() if not isinstance(tensor, np.ndarray)), None)
    if broken is not None:
        raise ModelError(f"{origin}: {broken[:_LONGEST_NAME]} is not a tensor")
    return named


def fitting_weights(
    named: Mapping[str, npt.NDArray[Any]],
    shapes: Mapping[str, tuple[int, ...]],
    origin: str,
    *,
    surplus_allowed: bool = False,
) -> dict[str, npt.NDArray[np.float32]]:
    """Return the weights of a network as float32, in the order of the network.

    Args:
        named: tensors by name.
        shapes: the network's shapes by name.
        origin: names the file in errors.
        surplus_allowed: whether the file may have other tensors, which are left out.

    Raises:
        ModelError: a weight is missing, has another shape or a number that is not finite, or is not of this network.
    """
    missing, surplus = sorted(shapes.keys() - named.keys()), sorted(named.keys() - shapes.keys())
    if missing:
        raise ModelError(f"{origin}: {len(missing)} of {len(shapes)} weights are missing, first {missing[0]}")
    if surplus and not surplus_allowed:
        raise ModelError(
            f"{origin}: {len(surplus)} weights do not belong to this network, first {surplus[0][:_LONGEST_NAME]}"
        )
    for name, shape in shapes.items():
        if named[name].shape != shape:
            raise ModelError(f"{origin}: {name} has shape {named[name].shape}, the network requires {shape}")
    with np.errstate(over="ignore"):
        weights = {name: named[name].astype(np.float32, order="C") for name in shapes}
    invalid = next((name for name, weight in weights.items() if not np.isfinite(weight).all()), None)
    if invalid is not None:
        raise ModelError(f"{origin}: {invalid} contains NaN or infinite numbers; the file is damaged")
    return weights
