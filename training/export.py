"""Export of the trained network in the format of PIRLNav's checkpoints, in half precision."""

from collections import OrderedDict
from pathlib import Path

import torch

from training.atomic_files import write_atomic
from vsnbench.models.pirlnav.checkpoint import DEMONSTRATION_TRAINER
from vsnbench.models.pirlnav.network import PIRLNavNetwork


def write_checkpoint(network: PIRLNavNetwork, frames: int, path: Path) -> None:
    """Write a checkpoint; `frames` is its number of training steps.

    Raises:
        TrainingError: the disk is full or not writable.
    """
    sizes = network.architecture
    config = {
        "TRAINER_NAME": DEMONSTRATION_TRAINER,
        "POLICY": {
            "RGB_ENCODER": {
                "backbone": sizes.backbone,
                "image_size": sizes.image_size_px,
                "resnet_baseplanes": sizes.base_planes,
                "hidden_size": sizes.visual_size,
                "avgpooled_image": False,
            },
            "STATE_ENCODER": {
                "hidden_size": sizes.hidden_size,
                "rnn_type": sizes.recurrent_type,
                "num_recurrent_layers": sizes.recurrent_layers,
            },
            "SEQ2SEQ": {"use_prev_action": True},
        },
    }
    weights = OrderedDict(
        (f"actor_critic.{name}", weight.to(torch.float16).contiguous()) for name, weight in network.state_dict().items()
    )
    content = {"state_dict": weights, "config": config, "extra_state": {"step": frames}}
    write_atomic(path, lambda file: torch.save(content, file))
