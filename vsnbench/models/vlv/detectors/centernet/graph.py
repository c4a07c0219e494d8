"""Reads a TensorFlow.js graph model: nodes, attributes and weights, without TensorFlow."""

import base64
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vsnbench.errors import ModelError

_DTYPES: Final[dict[str, np.dtype[Any]]] = {
    "float32": np.dtype("<f4"),
    "float16": np.dtype("<f2"),
    "int32": np.dtype("<i4"),
}


@dataclass(frozen=True, slots=True)
class Node:
    """An operation of the graph."""

    name: str
    op: str
    inputs: tuple[str, ...]
    attributes: Mapping[str, Any]

    def text(self, name: str) -> str:
        """Return a text attribute, which the file has in Base64."""
        return base64.b64decode(self.attributes[name]["s"]).decode()

    def texts(self, name: str) -> list[str]:
        """Return the texts of a list."""
        return [base64.b64decode(item).decode() for item in self.attributes[name]["list"].get("s", [])]

    def integers(self, name: str) -> list[int]:
        """Return the integers of a list."""
        return [int(item) for item in self.attributes[name]["list"]["i"]]

    def flag(self, name: str) -> bool:
        """Return a flag; False if it is absent."""
        return bool(self.attributes.get(name, {}).get("b", False))


@dataclass(frozen=True, slots=True)
class Graph:
    """The nodes by name, and the constants by name."""

    nodes: Mapping[str, Node]
    constants: Mapping[str, npt.NDArray[Any]]

    def needed(self, *outputs: str) -> list[Node]:
        """Return the nodes that compute the outputs, each after its inputs, without constants.

        Raises:
            ModelError: a node is missing.
        """
        done: dict[str, None] = {}
        pending = list(reversed(outputs))
        while pending:
            name = pending[-1]
            if name not in self.nodes:
                raise ModelError(f"the graph has no node {name}", code="not-a-graph-model")
            missing = [item for item in self.nodes[name].inputs if item not in done and item not in self.constants]
            if missing and name not in done:
                pending += reversed(missing)
            else:
                done.setdefault(pending.pop())
        return [self.nodes[name] for name in done]


def read_graph(topology: bytes, weights: bytes) -> Graph:
    """Return the graph of a model's JSON file and the file of its weights.

    Raises:
        ModelError: the files are not a graph model, or do not fit together.
    """
    try:
        model = json.loads(topology)
        nodes = {
            node["name"]: Node(node["name"], node["op"], tuple(node.get("input", ())), node.get("attr", {}))
            for node in model["modelTopology"]["node"]
        }
        constants, offset = {}, 0
        for group in model["weightsManifest"]:
            for entry in group["weights"]:
                stored = _DTYPES[entry.get("quantization", entry)["dtype"]]
                count = int(np.prod(entry["shape"], dtype=np.int64))
                array = np.frombuffer(weights, stored, count=count, offset=offset).reshape(entry["shape"])
                constants[entry["name"]] = array.astype(_DTYPES[entry["dtype"]])
                offset += array.nbytes
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ModelError(
            f"not a TensorFlow.js graph model ({type(error).__name__}: {error})", code="not-a-graph-model"
        ) from error
    return Graph(nodes, constants)
