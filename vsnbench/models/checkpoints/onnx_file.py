"""Writes ONNX files: nodes, constants and metadata in the protocol buffers of onnx.proto, without the onnx package.

The bytes are those of the onnx package's deterministic serialization.
"""

import struct
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

FLOAT: Final = 1
INT64: Final = 7
"""ONNX's numbers of element types."""
_ELEMENT_TYPES: Final = {np.dtype(np.float32): FLOAT, np.dtype(np.int64): INT64}
_ATTRIBUTE_FLOAT, _ATTRIBUTE_INT, _ATTRIBUTE_STRING, _ATTRIBUTE_INTS = 1, 2, 3, 7
_VARINT, _BYTES, _FIXED32 = 0, 2, 5
"""Wire types of protocol buffers."""
Shape = Sequence[int | str]
"""Sizes of the dimensions; a name for a size that is not fixed."""


class OnnxGraph:
    """Collects the nodes and constants of a graph, and writes its file."""

    def __init__(self) -> None:
        self._nodes: list[bytes] = []
        self._constants: dict[str, bytes] = {}

    def add(self, op: str, inputs: Sequence[str], *outputs: str, **attributes: Any) -> str:
        """Add a node. Returns the name of its first output."""
        node = [_text(1, name) for name in inputs] + [_text(2, name) for name in outputs] + [_text(4, op)]
        node += [_bytes(5, _attribute(name, attributes[name])) for name in sorted(attributes)]
        self._nodes.append(b"".join(node))
        return outputs[0]

    def tensor(self, name: str, array: npt.NDArray[Any]) -> str:
        """Add a constant of float32 or int64, of at least one dimension, unless its name exists. Returns the name."""
        if name not in self._constants:
            little = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
            dimensions = b"".join(_integer(1, size) for size in little.shape)
            kind = _integer(2, _ELEMENT_TYPES[array.dtype])
            self._constants[name] = dimensions + kind + _text(8, name) + _bytes(9, little.tobytes())
        return name

    def number(self, name: str, value: float) -> str:
        """Add a constant number. Returns its name."""
        return self.tensor(name, np.array(value, np.float32))

    def integers(self, *values: int) -> str:
        """Add a constant of integers. Returns its name."""
        return self.tensor(f"integers {values}", np.array(values, np.int64))

    def file(
        self,
        name: str,
        inputs: Mapping[str, tuple[int, Shape]],
        outputs: Mapping[str, tuple[int, Shape]],
        *,
        versions: tuple[int, int],
        properties: Mapping[str, str] | None = None,
    ) -> bytes:
        """Return the file.

        Args:
            name: name of the graph.
            inputs: element type and shape of each input.
            outputs: the same for the outputs.
            versions: of the file format (IR) and of the operators (opset).
            properties: metadata.
        """
        graph = [_bytes(1, node) for node in self._nodes] + [_text(2, name)]
        graph += [_bytes(5, constant) for constant in self._constants.values()]
        graph += [_bytes(11, _value(title, *kind)) for title, kind in inputs.items()]
        graph += [_bytes(12, _value(title, *kind)) for title, kind in outputs.items()]
        ir_version, opset = versions
        model = [_integer(1, ir_version), _bytes(7, b"".join(graph)), _bytes(8, _text(1, "") + _integer(2, opset))]
        model += [_bytes(14, _text(1, key) + _text(2, text)) for key, text in (properties or {}).items()]
        return b"".join(model)


def _attribute(name: str, value: Any) -> bytes:
    if isinstance(value, str):
        return _text(1, name) + _text(4, value) + _integer(20, _ATTRIBUTE_STRING)
    if isinstance(value, float):
        return _text(1, name) + _tag(2, _FIXED32) + struct.pack("<f", value) + _integer(20, _ATTRIBUTE_FLOAT)
    if isinstance(value, int):
        return _text(1, name) + _integer(3, value) + _integer(20, _ATTRIBUTE_INT)
    return _text(1, name) + b"".join(_integer(8, item) for item in value) + _integer(20, _ATTRIBUTE_INTS)


def _value(name: str, element_type: int, shape: Shape) -> bytes:
    dimensions = (_text(2, size) if isinstance(size, str) else _integer(1, size) for size in shape)
    tensor = _integer(1, element_type) + _bytes(2, b"".join(_bytes(1, dimension) for dimension in dimensions))
    return _text(1, name) + _bytes(2, _bytes(1, tensor))


def _text(field: int, value: str) -> bytes:
    return _bytes(field, value.encode())


def _bytes(field: int, value: bytes) -> bytes:
    return _tag(field, _BYTES) + _varint(len(value)) + value


def _integer(field: int, value: int) -> bytes:
    return _tag(field, _VARINT) + _varint(value % 2**64)


def _tag(field: int, wire_type: int) -> bytes:
    return _varint(field << 3 | wire_type)


def _varint(value: int) -> bytes:
    parts = bytearray()
    while value > 0x7F:
        parts.append(value & 0x7F | 0x80)
        value >>= 7
    parts.append(value)
    return bytes(parts)
