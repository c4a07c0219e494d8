"""The COCO detector: conversion of a TensorFlow.js graph, checked against PyTorch, and the package it comes from."""

import base64
import hashlib
import io
import json
import os
import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import pytest
import torch
from torch.nn import functional

from vsnbench.errors import VsnbenchError
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
        fused = {"fused_ops": {"list": {"s": [_text(part) for part in ("BiasAdd", activation) if part]}}}
        self.add(
            name,
            op,
            *((image, f"{name} weights", f"{name} bias") if "Fused" in op else (image, f"{name} weights")),
            strides={"list": {"i": ["1", str(stride), str(stride), "1"]}},
            dilations={"list": {"i": ["1", "1", "1", "1"]}},
            padding={"s": _text("SAME")},
            data_format={"s": _text("NHWC")},
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
        """Return peaks and edges (channels first) by PyTorch, with TensorFlow's padding."""
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


def _text(text: str) -> str:
    return base64.b64encode(text.encode()).decode()


@pytest.fixture(scope="module")
def network() -> Network:
    return Network()


def test_the_converted_network_finds_the_boxes_that_pytorch_finds(network: Network) -> None:
    image = np.random.default_rng(3).random((1, 3, 384, 512), np.float32)
    session = onnxruntime.InferenceSession(network.convert(), providers=["CPUExecutionProvider"])
    boxes, labels, scores = session.run(["boxes", "labels", "scores"], {"image": image})

    square = torch.zeros(1, 3, 512, 512)
    square[:, :, :384] = torch.from_numpy(image) * 255
    peaks, edges = network.outputs(square)
    peaks = torch.where(functional.max_pool2d(peaks, 3, 1, 1) == peaks, peaks, 0.0)
    expected, index = peaks.flatten().topk(100)
    label, row, column = index // 128**2, index % 128**2 // 128, index % 128
    left, top, right, bottom = edges[0][:, row, column]
    expected_boxes = torch.stack([4 * column - left, 4 * row - top, 4 * column + right, 4 * row + bottom], 1)
    assert np.allclose(scores, expected, atol=1e-5)
    assert len(np.unique(scores)) > 50
    alike = (labels[:, None] == label.numpy()) & (np.abs(boxes[:, None] - expected_boxes.numpy()).max(2) < 0.01)
    assert alike.any(axis=0).sum() >= 98  # nearly equal scores at the end of the list can differ


def test_boxes_are_in_pixels_of_an_image_of_another_size(network: Network) -> None:
    session = onnxruntime.InferenceSession(network.convert(), providers=["CPUExecutionProvider"])
    small = np.full((1, 3, 128, 256), 0.5, np.float32)
    boxes, scores = session.run(["boxes", "scores"], {"image": small})
    twice, same = session.run(["boxes", "scores"], {"image": small.repeat(2, 2).repeat(2, 3)})
    assert np.allclose(scores, same, atol=1e-3)
    assert twice[0] == pytest.approx(2 * boxes[0], abs=0.1)


def test_the_same_weights_give_the_same_file(network: Network) -> None:
    assert network.convert() == Network().convert()


def test_an_unknown_operator_is_named() -> None:
    odd = Network()
    next(node for node in odd.nodes if node["name"] == "limited")["op"] = "Softplus"
    with pytest.raises(VsnbenchError, match=r"operator Softplus \(limited\)") as caught:
        odd.convert()
    assert caught.value.code == "unknown-operator"


@pytest.mark.parametrize(
    ("name", "attribute", "value"),
    [
        ("large", "half_pixel_centers", {"b": True}),
        ("mean", "keep_dims", {"b": False}),
        ("first", "padding", {"s": _text("EXPLICIT")}),
        ("first", "fused_ops", {"list": {"s": [_text("BiasAdd"), _text("Elu")]}}),
    ],
)
def test_an_unknown_form_of_an_operator_is_refused(name: str, attribute: str, value: Node) -> None:
    odd = Network()
    next(node for node in odd.nodes if node["name"] == name)["attr"][attribute] = value
    with pytest.raises(VsnbenchError) as caught:
        odd.convert()
    assert caught.value.code == "unknown-operator"


@pytest.mark.parametrize("topology", [b"", b"[]", b"{}", b'{"modelTopology": {"node": [1]}}', b"\xff"])
def test_a_file_that_is_not_a_graph_is_refused(topology: bytes) -> None:
    with pytest.raises(VsnbenchError) as caught:
        read_graph(topology, b"")
    assert caught.value.code == "not-a-graph-model"


def test_weights_that_are_cut_off_are_refused(network: Network) -> None:
    topology, weights, _ = network.files().values()
    with pytest.raises(VsnbenchError) as caught:
        read_graph(topology, weights[:-2])
    assert caught.value.code == "not-a-graph-model"


# The package


@pytest.fixture
def packed(network: Network, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a package with the small network, which counts as the expected one."""
    files = network.files()
    hashes = {name: hashlib.sha256(files[name]).hexdigest() for name in list(files)[:2]}
    monkeypatch.setattr(package, "_SHA256", hashes)
    return pack(tmp_path / "human.tgz", files)


def pack(path: Path, files: dict[str, bytes]) -> Path:
    with tarfile.open(path, "w:gz") as archive:
        for name, content in files.items():
            member = tarfile.TarInfo(f"package/{name}")
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    return path


def refused(source: Path | None, directory: Path) -> tuple[str, str]:
    with pytest.raises(VsnbenchError) as caught:
        package.fetch_coco_detector(directory / "weights" / "d.onnx", source)
    assert not (directory / "weights").exists()
    assert "\n" not in str(caught.value)
    return caught.value.code, str(caught.value)


def test_the_detector_comes_from_a_package_file_or_an_installed_package(packed: Path, tmp_path: Path) -> None:
    destination = tmp_path / "weights" / "d.onnx"
    assert package.fetch_coco_detector(destination, packed)
    assert not package.fetch_coco_detector(destination, packed)
    with tarfile.open(packed) as archive:
        archive.extractall(tmp_path, filter="data")
    assert not package.fetch_coco_detector(destination, tmp_path / "package")
    destination.write_bytes(b"mine")
    with pytest.raises(VsnbenchError) as caught:
        package.fetch_coco_detector(destination, packed)
    assert caught.value.code == "file-exists"
    assert destination.read_bytes() == b"mine"


def test_another_version_is_named(packed: Path, network: Network, tmp_path: Path) -> None:
    files = network.files() | {"package.json": b'{"name": "@vladmandic/human", "version": "3.2.0"}'}
    files["models/centernet.bin"] += b"\0"
    code, message = refused(pack(tmp_path / "other.tgz", files), tmp_path)
    assert code == "wrong-package"
    assert "@vladmandic/human 3.2.0" in message
    assert package.VERSION in message


def test_a_package_without_the_network_is_refused(tmp_path: Path) -> None:
    code, message = refused(pack(tmp_path / "other.tgz", {"package.json": b"{"}), tmp_path)
    assert code == "wrong-package"
    assert "models/centernet.json" in message


def test_a_damaged_package_and_a_missing_one_are_refused(packed: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.tgz"
    broken.write_bytes(packed.read_bytes()[:-300])
    assert refused(broken, tmp_path)[0] == "unreadable-package"
    assert refused(tmp_path / "none.tgz", tmp_path)[0] == "no-such-file"


@pytest.fixture
def npm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Return a function that puts a program `npm` with a script into the path."""

    def install(script: str) -> None:
        program = tmp_path / "bin" / "npm"
        program.parent.mkdir(exist_ok=True)
        program.write_text(f"#!/bin/sh\n{script}\n")
        program.chmod(0o755)
        monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")

    return install


def test_npm_downloads_the_pinned_version(packed: Path, tmp_path: Path, npm: Callable[[str], None]) -> None:
    npm(f'echo "$@" > {tmp_path}/arguments; cp {packed} human-3.3.6.tgz')
    assert package.fetch_coco_detector(tmp_path / "d.onnx", None)
    assert (tmp_path / "arguments").read_text().startswith("pack @vladmandic/human@3.3.6 --ignore-scripts")


def test_npm_that_fails_is_quoted(tmp_path: Path, npm: Callable[[str], None]) -> None:
    npm('echo "npm error code E404" >&2; exit 1')
    code, message = refused(None, tmp_path)
    assert code == "npm-failed"
    assert "E404" in message


def test_without_npm_another_way_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    code, message = refused(None, tmp_path)
    assert code == "npm-missing"
    assert "--from" in message
