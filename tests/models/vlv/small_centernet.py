"""A small network with the kinds of operators of the COCO detector, as files of its npm package."""

import base64
import io
import json
import tarfile
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch.nn import functional

from vsnbench.models.vlv.detectors.centernet import package
from vsnbench.models.vlv.detectors.centernet.conversion import convert_centernet
from vsnbench.models.vlv.detectors.centernet.graph import read_graph

Node = dict[str, Any]


class Network:
    """A network with the inputs, outputs and kinds of operators of the real one, and few weights."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self.weights: list[tuple[str, np.ndarray]] = []
        random = np.random.default_rng(5)
        small = {name: random.normal(0, scale, shape).astype(np.float16) for name, scale, shape in _SHAPES}
        self.values = {name: torch.from_numpy(array.astype(np.float32)) for name, array in small.items()}
        self.add("tower_0/images", "Placeholder")
        self.convolve("first", "_FusedConv2D", "tower_0/images", 2, "Relu")
        self.convolve("second", "FusedDepthwiseConv2dNative", "first", 2)
        self.constant("axes", np.array([1, 2], np.int32))
        self.add("mean", "Mean", "second", "axes", keep_dims={"b": True})
        self.add("gate", "Sigmoid", "mean")
        self.add("gated", "Mul", "second", "gate")
        self.convolve("third", "DepthwiseConv2dNative", "gated", 2)
        self.constant("sizes", np.array([128, 128], np.int32))
        self.add("large", "ResizeBilinear", "third", "sizes")
        self.constant("axis", np.array(3, np.int32))
        self.add("both", "ConcatV2", "gated", "large", "axis")
        self.constant("per channel", small["per channel"])
        self.add("sum", "Add", "both", "per channel")
        self.add("limited", "Relu6", "sum")
        self.convolve("classes", "_FusedConv2D", "limited", 1)
        self.add("peaks", "Sigmoid", "classes")
        self.add("tower_0/keypoints", "Identity", "peaks")
        self.convolve("distances", "Conv2D", "limited", 1)
        self.constant("factor", np.array(16, np.float16))
        self.add("scaled", "Mul", "distances", "factor")
        self.add("tower_0/wh", "Identity", "scaled")
        for name, array in small.items():
            if name != "per channel":
                self.constant(name, array)

    def add(self, name: str, op: str, *inputs: str, **attributes: Any) -> None:
        self.nodes.append({"name": name, "op": op, "input": list(inputs), "attr": attributes})

    def convolve(self, name: str, op: str, image: str, stride: int, activation: str = "") -> None:
        fused = {"fused_ops": {"list": {"s": [encoded(part) for part in ("BiasAdd", activation) if part]}}}
        self.add(
            name,
            op,
            *((image, f"{name} weights", f"{name} bias") if "Fused" in op else (image, f"{name} weights")),
            strides={"list": {"i": ["1", str(stride), str(stride), "1"]}},
            dilations={"list": {"i": ["1", "1", "1", "1"]}},
            padding={"s": encoded("SAME")},
            data_format={"s": encoded("NHWC")},
            **(fused if "Fused" in op else {}),
        )

    def constant(self, name: str, array: np.ndarray) -> None:
        self.nodes.append({"name": name, "op": "Const"})
        self.weights.append((name, array))

    def files(self) -> dict[str, bytes]:
        """Return the files of a package."""
        entries = [
            {"name": name, "shape": list(array.shape), "dtype": "int32" if array.dtype == np.int32 else "float32"}
            | ({} if array.dtype == np.int32 else {"quantization": {"dtype": "float16"}})
            for name, array in self.weights
        ]
        topology = {"modelTopology": {"node": self.nodes}, "weightsManifest": [{"weights": entries}]}
        return {
            "models/centernet.json": json.dumps(topology).encode(),
            "models/centernet.bin": b"".join(array.tobytes() for _, array in self.weights),
            "package.json": json.dumps({"name": package.PACKAGE, "version": "3.3.6"}).encode(),
        }

    def convert(self) -> bytes:
        topology, weights, _ = self.files().values()
        return convert_centernet(read_graph(topology, weights))

    def outputs(self, image: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return peaks and edges (channels first), computed with PyTorch and TensorFlow's padding."""
        w = self.values

        def convolve(x: torch.Tensor, name: str, stride: int, *, depthwise: bool = False) -> torch.Tensor:
            kernel = w[f"{name} weights"]
            missing = [max((-(-side // stride) - 1) * stride + kernel.shape[0] - side, 0) for side in x.shape[2:]]
            x = functional.pad(x, (missing[1] // 2, -(-missing[1] // 2), missing[0] // 2, -(-missing[0] // 2)))
            if depthwise:
                channels = kernel.shape[2]
                out = functional.conv2d(x, kernel.permute(2, 3, 0, 1), stride=stride, groups=channels)
            else:
                out = functional.conv2d(x, kernel.permute(3, 2, 0, 1), stride=stride)
            bias = w.get(f"{name} bias")
            return out if bias is None else out + bias[:, None, None]

        x = convolve(convolve(image, "first", 2).relu(), "second", 2, depthwise=True)
        x = x * x.mean((2, 3), keepdim=True).sigmoid()
        small = convolve(x, "third", 2, depthwise=True)
        rows = torch.arange(128) / 2
        low, share = rows.long(), (rows % 1)[:, None]
        high = (low + 1).clamp(max=63)
        tall = small[:, :, low] * (1 - share) + small[:, :, high] * share
        large = tall[..., low] * (1 - share[:, 0]) + tall[..., high] * share[:, 0]
        x = (torch.cat([x, large], 1) + w["per channel"][:, None, None]).clamp(0, 6)
        return convolve(x, "classes", 1).sigmoid(), 16 * convolve(x, "distances", 1)


_SHAPES = (
    ("first weights", 0.004, (3, 3, 3, 4)),
    ("first bias", 0.1, (4,)),
    ("second weights", 0.5, (3, 3, 4, 1)),
    ("second bias", 0.1, (4,)),
    ("third weights", 0.5, (3, 3, 4, 1)),
    ("per channel", 0.5, (8,)),
    ("classes weights", 0.3, (1, 1, 8, 80)),
    ("classes bias", 0.5, (80,)),
    ("distances weights", 0.3, (1, 1, 8, 4)),
)


def encoded(text: str) -> str:
    return base64.b64encode(text.encode()).decode()


def pack(path: Path, files: dict[str, bytes]) -> Path:
    with tarfile.open(path, "w:gz") as archive:
        for name, content in files.items():
            member = tarfile.TarInfo(f"package/{name}")
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    return path
