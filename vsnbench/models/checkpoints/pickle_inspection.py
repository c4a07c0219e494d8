"""Reads the declarations of a PyTorch pickle without calling anything.

A checkpoint's pickle is a program for a small stack machine. This machine implements only the instructions of PyTorch's
files, and represents names as strings and tensors as their declared sizes. It finds a program that would run code, or
allocate more memory than the file's size, before anything is loaded.

PyTorch's weights-only reader, which reads the file afterwards, runs no code either, but was not sufficient (2.13): a
file of 521 bytes gave a tensor of 10^12 numbers over one stored number, which takes 4 TB at its first use; and 40 pairs
nested by reference as a dictionary's key, in 434 bytes, were hashed without end.
"""

import io
import pickletools
from dataclasses import dataclass
from math import prod
from typing import Any, Final

from vsnbench.errors import ModelError

HARMLESS_NAMES: Final = frozenset(
    {
        "collections.OrderedDict",
        "torch._utils._rebuild_tensor_v2",
        "torch._utils._rebuild_parameter",
        "torch.Size",
        "__builtin__.set",
        "builtins.set",
    }
)
"""Names that PyTorch writes into a checkpoint of weights and plain values."""

ELEMENT_BYTES: Final = {
    "torch.DoubleStorage": 8,
    "torch.FloatStorage": 4,
    "torch.HalfStorage": 2,
    "torch.BFloat16Storage": 2,
    "torch.LongStorage": 8,
    "torch.IntStorage": 4,
    "torch.ShortStorage": 2,
    "torch.CharStorage": 1,
    "torch.ByteStorage": 1,
    "torch.BoolStorage": 1,
}
"""Element size of each kind of storage."""

_MAX_TUPLE_DEPTH = 16
_MAX_TENSORS = 100_000
_VALUES = {
    "BININT",
    "BININT1",
    "BININT2",
    "LONG1",
    "BINFLOAT",
    "BINUNICODE",
    "SHORT_BINUNICODE",
    "SHORT_BINSTRING",
    "BINSTRING",
}
_CONSTANTS = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False, "EMPTY_TUPLE": ()}
_SHORT_TUPLES = {"TUPLE1": 1, "TUPLE2": 2, "TUPLE3": 3}


@dataclass(frozen=True, slots=True)
class DeclaredStorage:
    """Memory that the pickle declares: its record in the archive and its size."""

    key: str
    elements: int
    element_bytes: int

    @property
    def size_bytes(self) -> int:
        """Size of the whole record."""
        return self.elements * self.element_bytes


@dataclass(frozen=True, slots=True)
class _Name:
    """Name of a class or function that the pickle refers to."""

    text: str


@dataclass(frozen=True, slots=True)
class _Tuple:
    items: tuple[Any, ...]
    depth: int


class _Opaque:
    """A container or object whose content is not inspected."""


class _Mark:
    """The marker to which some instructions collect."""


def declared_storages(pickle_bytes: bytes, allowed_classes: frozenset[str], origin: str) -> list[DeclaredStorage]:
    """Return the storages of every tensor in a PyTorch pickle.

    Args:
        pickle_bytes: the archive's `data.pkl`.
        allowed_classes: names of further data classes that the file may refer to.
        origin: names the file in errors.

    Raises:
        ModelError: the pickle refers to another name, has an instruction that PyTorch does not write, is damaged, or
            has a tensor larger than its storage.
    """
    machine = _Machine(HARMLESS_NAMES | set(ELEMENT_BYTES) | allowed_classes, origin)
    try:
        for opcode, argument, _ in pickletools.genops(io.BytesIO(pickle_bytes)):
            machine.step(opcode.name, argument)
    except (ValueError, IndexError, KeyError, TypeError, AttributeError, OverflowError) as error:
        raise ModelError(f"{origin}: its pickle is damaged or forged ({error}); nothing was loaded") from error
    return list(machine.storages.values())


class _Machine:
    """The stack machine. Every instruction moves symbols or is refused."""

    def __init__(self, allowed: frozenset[str], origin: str) -> None:
        self.allowed = allowed
        self.origin = origin
        self.stack: list[Any] = []
        self.memo: dict[int, Any] = {}
        self.storages: dict[str, DeclaredStorage] = {}
        self.tensors = 0

    def step(self, name: str, argument: Any) -> None:
        """Execute one instruction."""
        if name in _VALUES:
            self.stack.append(argument)
        elif name in _CONSTANTS:
            self.stack.append(_tuple(()) if name == "EMPTY_TUPLE" else _CONSTANTS[name])
        elif name in ("EMPTY_DICT", "EMPTY_LIST", "EMPTY_SET"):
            self.stack.append(_Opaque())
        elif name == "MARK":
            self.stack.append(_Mark())
        elif name == "TUPLE":
            self.stack.append(_tuple(tuple(self._to_mark())))
        elif name in _SHORT_TUPLES:
            self.stack.append(_tuple(tuple(self._pop() for _ in range(_SHORT_TUPLES[name]))[::-1]))
        elif name in ("APPENDS", "SETITEMS", "ADDITEMS"):
            self._to_mark()
        elif name == "APPEND":
            self._pop()
        elif name == "SETITEM":
            self._pop()
            self._pop()
        elif name in ("BINPUT", "LONG_BINPUT"):
            self.memo[argument] = self.stack[-1]
        elif name == "MEMOIZE":
            self.memo[len(self.memo)] = self.stack[-1]
        elif name in ("BINGET", "LONG_BINGET"):
            self.stack.append(self.memo[argument])
        elif name == "GLOBAL":
            self._refer(argument.replace(" ", "."))
        elif name == "STACK_GLOBAL":
            attribute, module = self._pop(), self._pop()
            self._refer(f"{module}.{attribute}")
        elif name == "BINPERSID":
            self.stack.append(self._storage(self._pop()))
        elif name in ("REDUCE", "NEWOBJ"):
            arguments, function = self._pop(), self._pop()
            self._make(function, arguments)
        elif name == "BUILD":
            self._pop()
        elif name not in ("PROTO", "FRAME", "STOP"):
            raise ModelError(
                f"{self.origin}: its pickle has the instruction {name}, which no checkpoint needs; nothing was run"
            )

    def _pop(self) -> Any:
        value = self.stack.pop()
        if isinstance(value, _Mark):
            raise TypeError("a marker instead of a value")
        return value

    def _to_mark(self) -> list[Any]:
        collected: list[Any] = []
        while not isinstance(self.stack[-1], _Mark):
            collected.append(self.stack.pop())
        self.stack.pop()
        return collected[::-1]

    def _refer(self, name: str) -> None:
        if name not in self.allowed:
            raise ModelError(
                f"{self.origin}: reading it would call {name[:80]}, which no checkpoint needs; refused, nothing was run"
            )
        self.stack.append(_Name(name))

    def _storage(self, identity: Any) -> DeclaredStorage:
        kind, storage_type, key, _location, elements = identity.items
        if kind != "storage" or not isinstance(elements, int) or elements < 0:
            raise ValueError("a storage without a size")
        storage = DeclaredStorage(str(key), elements, ELEMENT_BYTES[storage_type.text])
        if self.storages.setdefault(storage.key, storage) != storage:
            raise ValueError(f"storage {storage.key} is declared twice, differently")
        return storage

    def _make(self, function: Any, arguments: Any) -> None:
        if not isinstance(function, _Name):
            raise TypeError("a call of something other than a name")
        if function.text != "torch._utils._rebuild_tensor_v2":
            self.stack.append(_Opaque())
            return
        storage, offset, shape, stride, *_ = arguments.items
        self.tensors += 1
        if self.tensors > _MAX_TENSORS:
            raise ValueError(f"more than {_MAX_TENSORS} tensors")
        numbers = (offset, *shape.items, *stride.items)
        if len(shape.items) != len(stride.items) or not all(isinstance(n, int) and n >= 0 for n in numbers):
            raise ValueError("a tensor with an impossible shape")
        reach = sum((size - 1) * step for size, step in zip(shape.items, stride.items, strict=True))
        count = prod(shape.items)
        if count and (count > storage.elements or offset + reach >= storage.elements):
            shape_text = "x".join(map(str, shape.items))[:60]
            raise ModelError(
                f"{self.origin}: a tensor of shape {shape_text} is declared over {storage.elements} stored numbers; "
                "damaged or forged, nothing was loaded"
            )
        self.stack.append(_Opaque())


def _tuple(items: tuple[Any, ...]) -> _Tuple:
    depth = 1 + max((item.depth for item in items if isinstance(item, _Tuple)), default=0)
    if depth > _MAX_TUPLE_DEPTH:
        raise ValueError("tuples are nested too deeply")
    return _Tuple(items, depth)
