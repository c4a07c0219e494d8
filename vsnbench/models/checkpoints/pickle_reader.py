"""Reads a PyTorch pickle without calling anything that it names.

A checkpoint's pickle is a program for a small stack machine. This machine implements only the instructions of PyTorch's
files. It represents classes and functions as their names, builds plain containers, and makes arrays from the stored
numbers. It refuses a program that would run code, or whose tensors are larger than the stored numbers.
"""

import io
import pickletools
from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vsnbench.errors import ModelError

_REBUILD_TENSOR: Final = "torch._utils._rebuild_tensor_v2"
_REBUILD_PARAMETER: Final = "torch._utils._rebuild_parameter"
_DICTIONARIES: Final = frozenset({"collections.OrderedDict"})
_FUNCTIONS: Final = frozenset({_REBUILD_TENSOR, _REBUILD_PARAMETER, "torch.Size", "__builtin__.set", "builtins.set"})
"""Names, besides classes of dictionaries, that PyTorch writes into a checkpoint of weights and plain values."""

_BFLOAT16: Final = "torch.BFloat16Storage"
_DTYPES: Final[dict[str, np.dtype[Any]]] = {
    "torch.DoubleStorage": np.dtype("f8"),
    "torch.FloatStorage": np.dtype("f4"),
    "torch.HalfStorage": np.dtype("f2"),
    _BFLOAT16: np.dtype("u2"),
    "torch.LongStorage": np.dtype("i8"),
    "torch.IntStorage": np.dtype("i4"),
    "torch.ShortStorage": np.dtype("i2"),
    "torch.CharStorage": np.dtype("i1"),
    "torch.ByteStorage": np.dtype("u1"),
    "torch.BoolStorage": np.dtype("?"),
}
"""Stored numbers of each kind of storage."""

_MAX_TUPLE_DEPTH = 16
_MAX_TENSORS = 100_000
_MAX_DIMENSIONS = 32
_MAX_PASSED = 100_000
"""Items passed to calls in the whole file. A call copies them, and a list that is written once can be passed often."""
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
_CONSTANTS = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False}
_CONTAINERS: Final[dict[str, type[Any]]] = {"EMPTY_DICT": dict, "EMPTY_LIST": list, "EMPTY_SET": set}
_FILLED: Final[dict[str, type[Any]]] = {"SETITEMS": dict, "APPENDS": list, "ADDITEMS": set}
_SHORT_TUPLES = {"TUPLE1": 1, "TUPLE2": 2, "TUPLE3": 3}


@dataclass(frozen=True, slots=True)
class DeclaredStorage:
    """Memory that the pickle declares: its record in the archive and its size."""

    key: str
    elements: int
    kind: str

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the stored numbers."""
        return _DTYPES[self.kind]

    @property
    def size_bytes(self) -> int:
        """Size of the whole record."""
        return self.elements * self.dtype.itemsize


@dataclass(frozen=True, slots=True)
class _Name:
    """Name of a class or function that the pickle refers to."""

    text: str


class _Tuple(tuple[Any, ...]):
    """A tuple with the depth of the tuples nested in it."""

    depth: int


@dataclass(frozen=True, slots=True, eq=False)
class _Storage:
    """A storage with its numbers. Not a tuple: a pickle could take that apart and combine it with other numbers."""

    declared: DeclaredStorage
    numbers: npt.NDArray[Any]


_MARK: Final = object()
"""The marker to which some instructions collect."""


def read_pickle(
    pickle_bytes: bytes,
    allowed_classes: frozenset[str],
    origin: str,
    stored: Callable[[DeclaredStorage], npt.NDArray[Any]],
) -> Any:
    """Return the content of a PyTorch pickle: plain values, dictionaries, lists, and arrays instead of tensors.

    Args:
        pickle_bytes: the archive's `data.pkl`.
        allowed_classes: names of dictionary classes that the file may contain; they are read as `dict`.
        origin: names the file in errors.
        stored: returns the numbers of a storage, called once for each; of the declared type and size.

    Raises:
        ModelError: the pickle refers to another name, has an instruction that PyTorch does not write, is damaged, or
            has a tensor larger than its storage.
    """
    machine = _Machine(allowed_classes, origin, stored)
    try:
        for opcode, argument, _ in pickletools.genops(io.BytesIO(pickle_bytes)):
            machine.step(opcode.name, argument)
        return machine.result()
    except (ValueError, IndexError, KeyError, TypeError, AttributeError, OverflowError) as error:
        raise ModelError(f"{origin}: its pickle is damaged or forged ({error}); nothing was loaded") from error


class _Machine:
    """The stack machine. Every instruction moves values or is refused."""

    def __init__(
        self, allowed_classes: frozenset[str], origin: str, stored: Callable[[DeclaredStorage], npt.NDArray[Any]]
    ) -> None:
        self.classes = _DICTIONARIES | allowed_classes
        self.allowed = _FUNCTIONS | _DTYPES.keys() | self.classes
        self.origin = origin
        self.stored = stored
        self.stack: list[Any] = []
        self.memo: dict[int, Any] = {}
        self.storages: dict[str, _Storage] = {}
        self.tensors = 0
        self.passed = 0

    def result(self) -> Any:
        """Return the content after the last instruction."""
        value = self._pop()
        if self.stack:
            raise ValueError("values are left over")
        return value

    def step(self, name: str, argument: Any) -> None:
        """Execute one instruction."""
        if name in _VALUES:
            self.stack.append(argument)
        elif name in _CONSTANTS:
            self.stack.append(_CONSTANTS[name])
        elif name == "EMPTY_TUPLE":
            self.stack.append(_tuple(()))
        elif name in _CONTAINERS:
            self.stack.append(_CONTAINERS[name]())
        elif name == "MARK":
            self.stack.append(_MARK)
        elif name == "TUPLE":
            self.stack.append(_tuple(tuple(self._to_mark())))
        elif name in _SHORT_TUPLES:
            self.stack.append(_tuple(tuple(self._pop() for _ in range(_SHORT_TUPLES[name]))[::-1]))
        elif name in _FILLED:
            self._fill(name, self._to_mark())
        elif name == "APPEND":
            self._fill("APPENDS", [self._pop()])
        elif name == "SETITEM":
            value, key = self._pop(), self._pop()
            self._fill("SETITEMS", [key, value])
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
            self._refer(f"{_text(module)}.{_text(attribute)}")
        elif name == "BINPERSID":
            self.stack.append(self._storage(self._pop()))
        elif name in ("REDUCE", "NEWOBJ"):
            arguments, function = self._pop(), self._pop()
            self.stack.append(self._make(function, arguments))
        elif name == "BUILD":  # the attributes of a dictionary's class
            self._pop()
        elif name not in ("PROTO", "FRAME", "STOP"):
            raise ModelError(
                f"{self.origin}: its pickle has the instruction {name}, which no checkpoint needs; nothing was run"
            )

    def _pop(self) -> Any:
        value = self.stack.pop()
        if value is _MARK:
            raise TypeError("a marker instead of a value")
        return value

    def _to_mark(self) -> list[Any]:
        collected: list[Any] = []
        while self.stack[-1] is not _MARK:
            collected.append(self.stack.pop())
        self.stack.pop()
        return collected[::-1]

    def _fill(self, name: str, items: list[Any]) -> None:
        container: Any = self.stack[-1]
        if not isinstance(container, _FILLED[name]):
            raise TypeError(f"{name} of a {type(container).__name__}")
        if name == "SETITEMS":
            container.update(zip(map(_key, items[::2]), items[1::2], strict=True))
        elif name == "ADDITEMS":
            container.update(map(_key, items))
        else:
            container.extend(items)

    def _refer(self, name: str) -> None:
        if name not in self.allowed:
            raise ModelError(
                f"{self.origin}: reading it would call {name[:80]}, which no checkpoint needs; refused, nothing was run"
            )
        self.stack.append(_Name(name))

    def _storage(self, identity: Any) -> _Storage:
        kind, storage_type, key, _location, elements = identity
        if kind != "storage" or not isinstance(elements, int) or elements < 0:
            raise ValueError("a storage without a size")
        declared = DeclaredStorage(_text(key), elements, storage_type.text)
        if declared.key not in self.storages:
            self.storages[declared.key] = _Storage(declared, self.stored(declared))
        if self.storages[declared.key].declared != declared:
            raise ValueError(f"storage {declared.key} is declared twice, differently")
        return self.storages[declared.key]

    def _make(self, function: Any, arguments: Any) -> Any:
        if not isinstance(function, _Name) or not isinstance(arguments, tuple):
            raise TypeError("a call of something other than a name")
        if function.text == _REBUILD_TENSOR:
            return self._tensor(arguments)
        if function.text == _REBUILD_PARAMETER:
            return arguments[0]
        self.passed += len(arguments[0]) if arguments else 0
        if self.passed > _MAX_PASSED:
            raise ValueError(f"more than {_MAX_PASSED} items in calls")
        items = list(arguments[0]) if arguments else []
        if function.text == "torch.Size":
            return _tuple(tuple(items))
        if function.text in self.classes:
            return {_key(key): value for key, value in items}
        return {*map(_key, items)}

    def _tensor(self, arguments: Any) -> npt.NDArray[Any]:
        storage, offset, shape, stride, *_ = arguments
        if not isinstance(storage, _Storage):
            raise TypeError("a tensor without a storage")
        numbers = storage.numbers
        self.tensors += 1
        if self.tensors > _MAX_TENSORS:
            raise ValueError(f"more than {_MAX_TENSORS} tensors")
        if not len(shape) == len(stride) <= _MAX_DIMENSIONS or not all(
            isinstance(n, int) and n >= 0 for n in (offset, *shape, *stride)
        ):
            raise ValueError("a tensor with an impossible shape")
        reach = sum((size - 1) * step for size, step in zip(shape, stride, strict=True))
        count = prod(shape)
        if count and (count > numbers.size or offset + reach >= numbers.size):
            shape_text = "x".join(map(str, shape))[:60]
            raise ModelError(
                f"{self.origin}: a tensor of shape {shape_text} is declared over {numbers.size} stored numbers; "
                "damaged or forged, nothing was loaded"
            )
        if not count:
            return np.zeros(shape, numbers.dtype)
        item_bytes = numbers.dtype.itemsize
        return np.lib.stride_tricks.as_strided(
            numbers[offset:], tuple(shape), [step * item_bytes for step in stride], writeable=False
        )


def numbers_of(storage: DeclaredStorage, record: bytes, *, big_endian: bool) -> npt.NDArray[Any]:
    """Return the numbers of a record; those of bfloat16, which numpy does not have, as float32."""
    numbers = np.frombuffer(record, storage.dtype.newbyteorder(">" if big_endian else "<"))
    if storage.kind == _BFLOAT16:
        return (numbers.astype(np.uint32) << 16).view(np.float32)
    return numbers.astype(storage.dtype, copy=False)


def _tuple(items: tuple[Any, ...]) -> _Tuple:
    made = _Tuple(items)
    made.depth = 1 + max((item.depth for item in items if isinstance(item, _Tuple)), default=0)
    if made.depth > _MAX_TUPLE_DEPTH:
        raise ValueError("tuples are nested too deeply")
    return made


def _key(value: Any) -> Any:
    """Return a key of a dictionary or element of a set; hashing a nested tuple could take for ever.

    Longer integers can all have the same hash, which makes a dictionary quadratic.
    """
    if value is not None and not isinstance(value, str | int | float):
        raise TypeError(f"a {type(value).__name__} as a key")
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise ValueError("an integer of more than 64 bits as a key")
    return value


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"a {type(value).__name__} instead of a text")
    return value
