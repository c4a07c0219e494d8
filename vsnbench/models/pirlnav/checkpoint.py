"""Reads a PIRLNav checkpoint of the authors' layout: configuration, training step and checked weights."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vsnbench.errors import ModelError
from vsnbench.models.checkpoints.safe_checkpoint import load_checkpoint
from vsnbench.models.checkpoints.state_dict import fitting_weights, only_tensors
from vsnbench.models.checkpoints.weights import file_sha256
from vsnbench.models.pirlnav.architecture import Architecture, architecture_of
from vsnbench.models.pirlnav.weight_shapes import expected_shapes

CONFIG_CLASSES: Final = frozenset({"habitat.config.default.Config", "yacs.config.CfgNode"})
"""The classes of the pickled configuration; both are dictionaries."""
DEMONSTRATION_TRAINER: Final = "vsnbench-demonstrations"
"""Name of the trainer in checkpoints of `training/`."""
_PREFIXES = ("actor_critic.", "model.", "")
_LANDMARK = "net.visual_encoder.backbone.conv1.weight"
_ACTION_HEAD = "action_distribution.linear.weight"
_GOAL_EMBEDDING = "net.obj_categories_embedding.weight"
_CRITIC = "critic."
_LINEAR_CRITIC = frozenset({"critic.fc.weight", "critic.fc.bias"})
_STATISTICS = "running_mean_and_var."
_FRAME_COUNT = "net.visual_encoder.running_mean_and_var._count"
"""Frames of training: in float16 infinite, because it exceeds 65,504."""
_LONGEST_NAME = 80


@dataclass(frozen=True, slots=True, eq=False)
class Checkpoint:
    """Contents of a checkpoint, ready for an engine."""

    path: Path
    sha256: str
    architecture: Architecture
    weights: Mapping[str, npt.NDArray[np.float32]]
    """Named as in `expected_shapes`."""
    prefix: str
    """Prefix of every name in the file."""
    trainer: str
    training_step: int | None
    """Environment steps of training; None if unknown."""

    @property
    def parameter_count(self) -> int:
        """Number of trained parameters, without the statistics of the normalisation."""
        return sum(weight.size for name, weight in self.weights.items() if _STATISTICS not in name)

    @property
    def fine_tuned(self) -> bool:
        """Whether reinforcement learning followed imitation learning: only then is there a critic."""
        return self.architecture.critic

    @property
    def demonstration(self) -> bool:
        """Whether it is the demonstration model of vsnbench, trained in simulated apartments."""
        return self.trainer == DEMONSTRATION_TRAINER


def read_published(path: Path, *, fine_tuned: bool) -> Checkpoint:
    """Read a checkpoint that should be one of the two that the authors published, for which they state no hash.

    Args:
        path: the file.
        fine_tuned: whether it should be the one after reinforcement learning, which has a critic.

    Raises:
        ModelError: it is no PIRLNav checkpoint, or has another network than the published one.
    """
    checkpoint = read_checkpoint(path)
    if checkpoint.architecture != Architecture(critic=checkpoint.fine_tuned) or checkpoint.demonstration:
        raise ModelError(
            f"{path}: a PIRLNav network of another size than the published one: "
            f"{checkpoint.parameter_count:,} parameters"
        )
    if checkpoint.fine_tuned is not fine_tuned:
        found, wanted = ("after RL", "before RL") if checkpoint.fine_tuned else ("before RL", "after RL")
        raise ModelError(f"{path}: the published checkpoint {found}, not the one {wanted}")
    return checkpoint


def read_checkpoint(path: Path) -> Checkpoint:
    """Read and check a PIRLNav checkpoint.

    Raises:
        ModelError: the file cannot be read safely, is another model's, or its weights do not fit its configuration.
    """
    content = load_checkpoint(path, CONFIG_CLASSES)
    if not isinstance(content, Mapping):
        raise ModelError(
            f"{path}: not a PIRLNav checkpoint: it contains a {type(content).__name__} instead of a state_dict"
        )
    state = content.get("state_dict")
    if not isinstance(state, Mapping):
        what = "VLV weights" if "model_state_dict" in content else "not a PIRLNav checkpoint: it has no state_dict"
        raise ModelError(f"{path}: {what}; PIRLNav's are objectnav_il_hd.ckpt or objectnav_rl_ft_hd.ckpt")
    config = content.get("config")
    if not isinstance(config, Mapping):
        raise ModelError(
            f"{path}: it has no configuration, so the network's sizes are unknown",
            advice="use the file as its authors published it",
        )
    prefix = next((prefix for prefix in _PREFIXES if prefix + _LANDMARK in state), None)
    if prefix is None:
        raise ModelError(f"{path}: not PIRLNav weights: {_LANDMARK} is missing among its {len(state)} keys")
    named = {str(key).removeprefix(prefix): tensor for key, tensor in state.items()}
    weights, architecture = _fitting(named, config, str(path))
    extra = content.get("extra_state")
    step = extra.get("step") if isinstance(extra, Mapping) else None
    trainer = config.get("TRAINER_NAME")
    return Checkpoint(
        path=path,
        sha256=file_sha256(path),
        architecture=architecture,
        weights=weights,
        prefix=prefix,
        trainer=trainer[:_LONGEST_NAME] if isinstance(trainer, str) else "",
        training_step=int(step) if isinstance(step, int | float) and 0 <= step < 2**63 else None,
    )


def _fitting(
    named: Mapping[str, Any], config: Mapping[str, Any], origin: str
) -> tuple[dict[str, npt.NDArray[np.float32]], Architecture]:
    """Return the weights as float32 and the architecture they fill exactly."""
    named = only_tensors(named, origin)
    critic = named.keys() >= _LINEAR_CRITIC
    if not critic:  # another kind of critic: no decision depends on it
        named = {name: weight for name, weight in named.items() if not name.startswith(_CRITIC)}
    count = named.get(_FRAME_COUNT)
    if count is not None and not np.isfinite(count).all():  # no decision depends on it
        named = {**named, _FRAME_COUNT: np.zeros_like(count)}
    architecture = architecture_of(
        config, actions=_rows(named, _ACTION_HEAD), goals=_rows(named, _GOAL_EMBEDDING), critic=critic, origin=origin
    )
    return fitting_weights(named, expected_shapes(architecture), origin), architecture


def _rows(named: Mapping[str, npt.NDArray[Any]], name: str) -> int:
    """Return the first dimension of a weight; 1 if it is missing, which is reported later."""
    weight = named.get(name)
    return weight.shape[0] if weight is not None and weight.ndim else 1
