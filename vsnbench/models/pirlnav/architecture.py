"""The sizes of a PIRLNav network, from the configuration in its checkpoint."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vsnbench.errors import ModelError

GPS_SIZE = 2
COMPASS_SIZE = 2
"""Cosine and sine of the compass."""
EMBEDDING_SIZE = 32
"""Width of the embeddings of GPS, compass, goal and previous action."""
ENCODER_STRIDE = 32
"""Factor by which the ResNet reduces the image size."""
COMPRESSED_SIZE = 2048
"""Number of outputs of the compression layer, for every image size."""

_Planes = Annotated[int, Field(ge=2, le=256, multiple_of=2)]
_Width = Annotated[int, Field(ge=1, le=16384)]


class Architecture(BaseModel):
    """Sizes of the network, with limits because they come from a file of unknown origin."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    backbone: Literal["resnet50"] = "resnet50"
    image_size_px: int = Field(default=256, ge=ENCODER_STRIDE, le=1024, multiple_of=ENCODER_STRIDE)
    base_planes: _Planes = 32
    visual_size: _Width = 512
    hidden_size: _Width = 2048
    recurrent_layers: int = Field(default=2, ge=1, le=8)
    recurrent_type: Literal["GRU"] = "GRU"
    uses_previous_action: Literal[True] = True
    pools_image: Literal[False] = False
    actions: int = Field(default=6, ge=1, le=64)
    goals: int = Field(default=6, ge=1, le=1024)
    critic: bool = True

    @property
    def final_grid_px(self) -> int:
        """Width and height of the encoder's last feature map."""
        return self.image_size_px // ENCODER_STRIDE

    @property
    def compressed_channels(self) -> int:
        """Channels of the compression layer."""
        return round(COMPRESSED_SIZE / self.final_grid_px**2)

    @property
    def recurrent_input_size(self) -> int:
        """Width of the GRU's input."""
        return self.visual_size + 4 * EMBEDDING_SIZE

    @property
    def summary(self) -> str:
        """One line for tables."""
        return (
            f"ResNet-50-GN (base planes {self.base_planes}), visual {self.visual_size}, "
            f"{self.recurrent_layers}-layer GRU-{self.hidden_size}, {'with' if self.critic else 'no'} critic"
        )


_FIELDS: dict[str, tuple[str, ...]] = {
    "backbone": ("RGB_ENCODER", "backbone"),
    "image_size_px": ("RGB_ENCODER", "image_size"),
    "base_planes": ("RGB_ENCODER", "resnet_baseplanes"),
    "visual_size": ("RGB_ENCODER", "hidden_size"),
    "pools_image": ("RGB_ENCODER", "avgpooled_image"),
    "hidden_size": ("STATE_ENCODER", "hidden_size"),
    "recurrent_layers": ("STATE_ENCODER", "num_recurrent_layers"),
    "recurrent_type": ("STATE_ENCODER", "rnn_type"),
    "uses_previous_action": ("SEQ2SEQ", "use_prev_action"),
}
"""Path of each field in the authors' configuration, under POLICY."""


def architecture_of(config: Mapping[str, Any], *, actions: int, goals: int, critic: bool, origin: str) -> Architecture:
    """Read the network's sizes from a checkpoint's configuration, which has neither actions nor goals nor critic.

    `origin` names the file in errors.

    Raises:
        ModelError: the configuration lacks a size or has an unsupported one.
    """
    found: dict[str, Any] = {}
    for field, path in _FIELDS.items():
        value: Any = config.get("POLICY")
        for part in path:
            value = value.get(part) if isinstance(value, Mapping) else None
        if value is None and field not in ("pools_image", "uses_previous_action"):
            raise ModelError(f"{origin}: its configuration has no POLICY.{'.'.join(path)}: not a PIRLNav checkpoint")
        if value is not None and not isinstance(value, str | int | float):
            raise ModelError(f"{origin}: POLICY.{'.'.join(path)} is a {type(value).__name__}: not a PIRLNav checkpoint")
        if value is not None:
            found[field] = value
    try:
        return Architecture(**found, actions=actions, goals=goals, critic=critic)
    except ValidationError as error:
        first = error.errors()[0]
        field = str(first["loc"][0])
        name = "POLICY." + ".".join(_FIELDS[field]) if field in _FIELDS else field
        raise ModelError(
            f"{origin}: {name} is {first['input']!r:.80}, which this network does not support: {first['msg']}"
        ) from error
