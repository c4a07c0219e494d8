"""Converts the CenterNet of the npm package @vladmandic/human to an ONNX detector (docs/vlv.md).

The network is TensorFlow's, with channels last; ONNX has them first. It takes an RGB image of 512 x 512 pixels with
numbers from 0 to 255. It returns a map of peaks for each class, and the distances from each cell to its box's edges.
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np

from vsnbench.errors import ModelError
from vsnbench.models.checkpoints.onnx_file import FLOAT, INT64, OnnxGraph
from vsnbench.models.vlv.detectors.centernet.graph import Graph, Node
from vsnbench.models.vlv.detectors.coco import CLASSES_80

_INPUT, _PEAKS, _EDGES = "tower_0/images", "tower_0/keypoints", "tower_0/wh"
_SIDE_PX: Final = 512
_CELL_PX: Final = 4
_CELLS: Final = _SIDE_PX // _CELL_PX
_OBJECTS: Final = 100
_TITLE: Final = "CenterNet MobileNetV3, COCO"
_RELIABILITY: Final = {
    "bed": {"threshold": 0.4, "precision": 0.59, "recall": 0.41},
    "chair": {"threshold": 0.15, "precision": 0.60, "recall": 0.60},
    "couch": {"threshold": 0.15, "precision": 0.64, "recall": 0.67},
    "dining table": {"threshold": 0.15, "precision": 0.41, "recall": 0.32},
    "toilet": {"threshold": 0.25, "precision": 0.64, "recall": 0.67},
}
"""Minimum score with the best F1 over 2000 views of generated flats: `benchmarks/coco_detector.py views`."""
_OPSET, _IR_VERSION = 18, 8
"""Fixed, so that the same weights give the same file everywhere: its hash is part of a model's identity."""


def convert_centernet(graph: Graph) -> bytes:
    """Return the ONNX file.

    Raises:
        ModelError: the graph has an operator or a form of it that the converter does not know.
    """
    builder = Builder()
    builder.prepare_image()
    add_nodes(builder, graph, (_PEAKS, _EDGES), CONVERTERS)
    builder.find_boxes()
    properties = {"title": _TITLE, "names": str(list(CLASSES_80)), "reliability": json.dumps(_RELIABILITY)}
    return detector_file(builder, "centernet", _OBJECTS, properties)


def add_nodes(builder: "Builder", graph: Graph, outputs: Sequence[str], converters: Mapping[str, "Converter"]) -> None:
    """Add the nodes that compute the outputs.

    Raises:
        ModelError: the graph has an operator or a form of it that the converters do not know.
    """
    for node in graph.needed(*outputs):
        converter = converters.get(node.op)
        if converter is None:
            raise ModelError(
                f"the converter does not know the operator {node.op} ({node.name})",
                advice=f"it knows {', '.join(sorted(converters))}",
                code="unknown-operator",
            )
        try:
            converter(builder, node, graph)
        except (KeyError, IndexError, ValueError) as error:
            raise ModelError(
                f"the converter does not know this form of the operator {node.op} ({node.name}: {error})",
                code="unknown-operator",
            ) from error


def detector_file(builder: "Builder", name: str, count: int | str, properties: Mapping[str, str]) -> bytes:
    """Return the ONNX file of a graph from `image` to `boxes`, `labels` and `scores` of `count` objects."""
    return builder.file(
        name,
        {"image": (FLOAT, (1, 3, "height", "width"))},
        {"boxes": (FLOAT, (count, 4)), "labels": (INT64, (count,)), "scores": (FLOAT, (count,))},
        versions=(_IR_VERSION, _OPSET),
        properties=dict(properties),
    )


class Builder(OnnxGraph):
    """Adds what the network does not have: the fitting of its image and the search for boxes."""

    def prepare_image(self) -> None:
        """Fit the image of numbers from 0 to 1 into the upper left of the network's square, and fill the rest."""
        side = self.integers(_SIDE_PX, _SIDE_PX)
        fit = {"axes": [2, 3], "mode": "linear", "keep_aspect_ratio_policy": "not_larger"}
        self.add("Resize", ["image", "", "", side], "resized", **fit)
        self.add("Shape", ["resized"], "resized shape", start=2)
        self.add("Sub", [side, "resized shape"], "rest")
        self.add("Concat", [self.integers(0, 0), "rest"], "pads", axis=0)
        self.add("Pad", ["resized", "pads", "", self.integers(2, 3)], "square")
        self.add("Mul", ["square", self.number("brightest", 255)], _INPUT)

    def find_boxes(self) -> None:
        """Take the highest local maxima of the peaks as the centres of boxes, in pixels of the image."""
        kernel = {"kernel_shape": [3, 3], "pads": [1, 1, 1, 1]}
        self.add("MaxPool", [_PEAKS], "highest nearby", **kernel)
        self.add("Equal", [_PEAKS, "highest nearby"], "is peak")
        self.add("Where", ["is peak", _PEAKS, self.number("zero", 0)], "only peaks")
        self.add("Reshape", ["only peaks", self.integers(-1)], "all peaks")
        self.add("TopK", ["all peaks", self.integers(_OBJECTS)], "scores", "index")
        cells = self.integers(_CELLS**2)
        self.add("Div", ["index", cells], "labels")
        self.add("Mod", ["index", cells], "cell")
        self.add("Div", ["cell", self.integers(_CELLS)], "row")
        self.add("Mod", ["cell", self.integers(_CELLS)], "column")
        self.add("Reshape", [_EDGES, self.integers(4, -1)], "edges of cells")
        self.add("Gather", ["edges of cells", "cell"], "edges", axis=1)
        signs = self.tensor("signs", np.array([[-1], [-1], [1], [1]], np.float32))
        self.add("Mul", ["edges", signs], "from centre")
        for name in ("row", "column"):
            self.add("Unsqueeze", [name, self.integers(0)], f"{name} 2d")
        self.add("Concat", ["column 2d", "row 2d", "column 2d", "row 2d"], "centre cell", axis=0)
        self.add("Cast", ["centre cell"], "centre number", to=FLOAT)
        self.add("Mul", ["centre number", self.number("cell size", _CELL_PX)], "centre")
        self.add("Add", ["centre", "from centre"], "box")
        self.add("Transpose", ["box"], "network boxes", perm=[1, 0])
        self.add("Shape", ["image"], "size", start=2)
        self.add("ReduceMax", ["size"], "longer side", keepdims=0)
        self.add("Cast", ["longer side"], "longer side number", to=FLOAT)
        self.add("Div", ["longer side number", self.number("side", _SIDE_PX)], "scale")
        self.add("Mul", ["network boxes", "scale"], "boxes")


Converter = Callable[[Builder, Node, Graph], None]
"""Adds the nodes of one operator."""


def _convolution(builder: Builder, node: Node, graph: Graph) -> None:
    """Add a convolution with its bias and activation."""
    image, weights_name, *rest = node.inputs
    weights = graph.constants[weights_name]
    height, width, channels, count = weights.shape
    depthwise = "Depthwise" in node.op
    if depthwise:
        kernel, groups = weights.reshape(height, width, 1, channels * count).transpose(3, 2, 0, 1), channels
    else:
        kernel, groups = weights.transpose(3, 2, 0, 1), 1
    fused = node.texts("fused_ops") if "fused_ops" in node.attributes else []
    if fused not in ([], ["BiasAdd"], ["BiasAdd", "Relu"]) or node.text("data_format") != "NHWC":
        raise ValueError(f"{fused} {node.text('data_format')}")
    inputs = [image, builder.tensor(weights_name, kernel)]
    if fused:
        inputs.append(builder.tensor(rest[0], graph.constants[rest[0]]))
    output = f"{node.name} before activation" if "Relu" in fused else node.name
    builder.add(
        "Conv",
        inputs,
        output,
        auto_pad={"SAME": "SAME_UPPER", "VALID": "VALID"}[node.text("padding")],
        strides=node.integers("strides")[1:3],
        dilations=node.integers("dilations")[1:3],
        kernel_shape=[height, width],
        group=groups,
    )
    if "Relu" in fused:
        builder.add("Relu", [output], node.name)


def _arithmetic(builder: Builder, node: Node, graph: Graph) -> None:
    """Add a sum or product; a constant is a number, or a number for each channel."""
    inputs = []
    for name in node.inputs:
        if name in graph.constants:
            constant = graph.constants[name]
            if constant.ndim > 1:
                raise ValueError(f"constant of shape {constant.shape}")
            inputs.append(builder.tensor(name, constant.reshape(-1, 1, 1) if constant.ndim else constant))
        else:
            inputs.append(name)
    builder.add(node.op, inputs, node.name)


def _mean(builder: Builder, node: Node, graph: Graph) -> None:
    if list(graph.constants[node.inputs[1]]) != [1, 2] or not node.flag("keep_dims"):
        raise ValueError("not a mean over the image")
    builder.add("GlobalAveragePool", [node.inputs[0]], node.name)


def _concatenation(builder: Builder, node: Node, graph: Graph) -> None:
    if int(graph.constants[node.inputs[-1]]) not in (3, -1):
        raise ValueError("not along the channels")
    builder.add("Concat", list(node.inputs[:-1]), node.name, axis=1)


def _resizing(builder: Builder, node: Node, graph: Graph) -> None:
    """Add TensorFlow 1's bilinear resizing, which aligns the upper left corners of pixels."""
    if node.flag("align_corners") or node.flag("half_pixel_centers"):
        raise ValueError("aligned by corners or by centres")
    height, width = (int(side) for side in graph.constants[node.inputs[1]])
    # The size of the input is not in the graph: all are enlarged to parts of the network's side.
    if height != width or not math.log2(_SIDE_PX / height).is_integer():
        raise ValueError(f"to {height} x {width}")
    scales = builder.tensor("double", np.array([1, 1, 2, 2], np.float32))
    builder.add(
        "Resize", [node.inputs[0], "", scales], node.name, mode="linear", coordinate_transformation_mode="asymmetric"
    )


def _limited(builder: Builder, node: Node, graph: Graph) -> None:  # noqa: ARG001 - the signature of converters
    builder.add("Clip", [node.inputs[0], builder.number("zero", 0), builder.number("six", 6)], node.name)


def _same(builder: Builder, node: Node, graph: Graph) -> None:  # noqa: ARG001
    builder.add(node.op, list(node.inputs), node.name)


def _input(builder: Builder, node: Node, graph: Graph) -> None:  # noqa: ARG001
    if node.name != _INPUT:
        raise ValueError("a second input")


CONVERTERS: Final[dict[str, Converter]] = {
    "Placeholder": _input,
    "Conv2D": _convolution,
    "_FusedConv2D": _convolution,
    "DepthwiseConv2dNative": _convolution,
    "FusedDepthwiseConv2dNative": _convolution,
    "Add": _arithmetic,
    "Mul": _arithmetic,
    "Mean": _mean,
    "ConcatV2": _concatenation,
    "ResizeBilinear": _resizing,
    "Relu6": _limited,
    "Relu": _same,
    "Sigmoid": _same,
    "Identity": _same,
}
