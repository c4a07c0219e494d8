"""A policy whose card is refused."""

from tests.cli.turning import Turning
from vsnbench.values.model.card import ModelCard


class OddCamera(Turning):
    """Has a card whose camera has no height."""

    card = ModelCard("odd-camera", camera={"mount_height_m": "high"})  # type: ignore[arg-type]
