"""The PIRLNav network as an ONNX file, made from a checkpoint's weights without PyTorch.

The operations are those that PyTorch's exporter writes for `PIRLNavNetwork`, so that the numbers are the same.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.models.checkpoints.onnx_file import FLOAT, INT64, OnnxGraph
from vsnbench.models.pirlnav.architecture import Architecture
from vsnbench.models.pirlnav.weight_shapes import BACKBONE, ENCODER, GRU, ResidualBlock, residual_blocks

Weights = Mapping[str, npt.NDArray[np.float32]]
VARIANCE_FLOOR: Final = 1e-2
"""Minimum of the variance of training images."""
_EPSILON: Final = 1e-5
"""Of group norm."""
_VERSIONS: Final = (8, 17)
"""Of the file format and of the operators. Later versions of group norm are slower in onnxruntime."""


def network_file(sizes: Architecture, weights: Weights) -> bytes:
    """Return the file of the network for one robot and single steps."""
    graph = _Graph(sizes, weights)
    graph.add_encoder()
    graph.add_memory()
    memory = (FLOAT, (sizes.recurrent_layers, 1, sizes.hidden_size))
    return graph.file(
        "pirlnav",
        {
            "image": (FLOAT, (1, sizes.image_size_px, sizes.image_size_px, 3)),
            "gps": (FLOAT, (1, 2)),
            "compass": (FLOAT, (1, 1)),
            "goal": (INT64, (1,)),
            "previous": (INT64, (1,)),
            "mask": (FLOAT, (1, 1)),
            "hidden": memory,
        },
        {"logits": (FLOAT, (1, sizes.actions)), "value": (FLOAT, (1, 1)), "hidden_after": memory},
        versions=_VERSIONS,
    )


class _Graph(OnnxGraph):
    """Adds the parts of the network."""

    def __init__(self, sizes: Architecture, weights: Weights) -> None:
        super().__init__()
        self._sizes = sizes
        self._weights = weights

    def add_encoder(self) -> None:
        """Add the image's normalisation, backbone, compression and last layer; the output is `visual`."""
        groups = self._sizes.base_planes // 2
        variance = np.maximum(self._weights[f"{ENCODER}.running_mean_and_var._var"], np.float32(VARIANCE_FLOOR))
        self.add("Transpose", ["image"], "channels first", perm=[0, 3, 1, 2])
        self.add("Sub", ["channels first", self._weight(f"{ENCODER}.running_mean_and_var._mean")], "centred")
        self.add("Div", ["centred", self.tensor("deviation", np.sqrt(variance))], "normalised")
        name = self._convolution("normalised", f"{BACKBONE}.conv1", f"{BACKBONE}.bn1", groups, stride=2)
        self.add("Relu", [name], "stem")
        name = self.add("MaxPool", ["stem"], "pooled", kernel_shape=[3, 3], strides=[2, 2], pads=[1, 1, 1, 1])
        for block in residual_blocks(self._sizes):
            name = self._block(name, block, groups)
        name = self._convolution(name, f"{ENCODER}.compression.0", f"{ENCODER}.compression.1", 1)
        self.add("Relu", [name], "compressed")
        self.add("Flatten", ["compressed"], "flat", axis=1)
        self.add("Relu", [self._linear("flat", "net.visual_fc.1", "visual before activation")], "visual")

    def _block(self, name: str, block: ResidualBlock, groups: int) -> str:
        same = name
        if block.resized:
            same = self._convolution(
                name, f"{block.name}.downsample.0", f"{block.name}.downsample.1", groups, block.stride
            )
        for number, stride in ((1, 1), (2, block.stride), (3, 1)):
            name = self._convolution(name, f"{block.name}.conv{number}", f"{block.name}.bn{number}", groups, stride)
            if number < 3:
                name = self.add("Relu", [name], f"{name} relu")
        self.add("Add", [name, same], f"{block.name} sum")
        return self.add("Relu", [f"{block.name} sum"], block.name)

    def _convolution(self, name: str, layer: str, norm: str, groups: int, stride: int = 1) -> str:
        """Add a convolution and its group norm. Returns the name of the output."""
        kernel = self._weights[f"{layer}.weight"].shape[-1]
        pads, shape = [kernel // 2] * 4, [kernel, kernel]
        made = self.add(
            "Conv", [name, self._weight(f"{layer}.weight")], layer, kernel_shape=shape, pads=pads, strides=[stride] * 2
        )
        grouped = self.add("Reshape", [made, self.integers(0, groups, -1)], f"{norm} groups")
        unit = self.tensor(f"{groups} ones", np.ones(groups, np.float32))
        zero = self.tensor(f"{groups} zeros", np.zeros(groups, np.float32))
        self.add("InstanceNormalization", [grouped, unit, zero], f"{norm} normalised", epsilon=_EPSILON)
        self.add("Shape", [made], f"{norm} shape")
        self.add("Reshape", [f"{norm} normalised", f"{norm} shape"], f"{norm} channels")
        self.add("Mul", [f"{norm} channels", self._per_channel(f"{norm}.weight")], f"{norm} scaled")
        return self.add("Add", [f"{norm} scaled", self._per_channel(f"{norm}.bias")], norm)

    def add_memory(self) -> None:
        """Add the embeddings, the GRU, the action head and the critic."""
        sizes, first = self._sizes, self.integers(0)
        for function in ("Cos", "Sin"):
            self.add(function, ["compass"], function)
        self.add("Concat", ["Cos", "Sin"], "direction", axis=1)
        parts = [
            "visual",
            self._linear("gps", "net.gps_embedding", "gps embedding"),
            self._linear("direction", "net.compass_embedding", "compass embedding"),
            self.add("Gather", [self._weight("net.obj_categories_embedding.weight"), "goal"], "goal embedding"),
            self.add("Gather", [self._weight("net.prev_action_embedding.weight"), "previous"], "previous embedding"),
        ]
        self.add("Concat", parts, "inputs", axis=1)
        name = self.add("Unsqueeze", ["inputs", first], "inputs 0")
        self.add("Unsqueeze", ["mask", first], "mask 3d")
        self.add("Mul", ["hidden", "mask 3d"], "hidden before")
        for layer in range(sizes.recurrent_layers):
            before = self.add(
                "Slice", ["hidden before", self.integers(layer), self.integers(layer + 1), first], f"before {layer}"
            )
            weights = [self._gates(kind, layer) for kind in ("weight_ih", "weight_hh", "bias")]
            outputs = f"outputs {layer}", f"after {layer}"
            options = {"hidden_size": sizes.hidden_size, "linear_before_reset": 1}
            self.add("GRU", [name, *weights, "", before], *outputs, **options)
            name = self.add("Squeeze", [outputs[0], self.integers(1)], f"inputs {layer + 1}")
        self.add("Concat", [f"after {layer}" for layer in range(sizes.recurrent_layers)], "hidden_after", axis=0)
        self.add("Squeeze", [name, first], "features")
        self._linear("features", "action_distribution.linear", "logits")
        if sizes.critic:
            self._linear("features", "critic.fc", "value")
        else:
            self.add("Identity", [self.tensor("no critic", np.full((1, 1), np.nan, np.float32))], "value")

    def _gates(self, kind: str, layer: int) -> str:
        """Add weights of a GRU with its gates in ONNX's order: update, reset, new. Returns their name."""
        kinds = ("bias_ih", "bias_hh") if kind == "bias" else (kind,)
        parts = []
        for part in kinds:
            reset, update, new = np.split(self._weights[f"{GRU}.{part}_l{layer}"], 3)
            parts += [update, reset, new]
        return self.tensor(f"{kind} {layer}", np.concatenate(parts)[None])

    def _linear(self, name: str, layer: str, output: str) -> str:
        return self.add(
            "Gemm", [name, self._weight(f"{layer}.weight"), self._weight(f"{layer}.bias")], output, transB=1
        )

    def _per_channel(self, name: str) -> str:
        return self.tensor(name, self._weights[name].reshape(-1, 1, 1))

    def _weight(self, name: str) -> str:
        return self.tensor(name, self._weights[name])
