"""The COCO detector: conversion of a TensorFlow.js graph, checked against PyTorch, and the package it comes from."""

import hashlib
import os
import tarfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch
from torch.nn import functional

from tests.models.vlv.small_centernet import Network, Node, encoded, pack
from vsnbench.errors import VsnbenchError
from vsnbench.models.vlv.detectors.centernet import package
from vsnbench.models.vlv.detectors.centernet.graph import read_graph


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
        ("first", "padding", {"s": encoded("EXPLICIT")}),
        ("first", "fused_ops", {"list": {"s": [encoded("BiasAdd"), encoded("Elu")]}}),
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


def test_a_graph_without_the_outputs_is_refused() -> None:
    odd = Network()
    odd.nodes = [node for node in odd.nodes if node["name"] != "gate"]
    with pytest.raises(VsnbenchError, match="no node gate"):
        odd.convert()


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
