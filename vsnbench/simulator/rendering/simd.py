"""SIMD values of four float32 lanes for compiled code: the colour channels of a pixel in one register.

Each lane is rounded like the same scalar operation on every processor; the order of operations does not change. This
module uses numba's extension interface and llvmlite, both with an upper bound in pyproject.toml.
"""

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import intrinsic, models, overload, register_model

_FLOAT = ir.FloatType()
_FOUR = ir.VectorType(_FLOAT, 4)


class _FourLanes(types.Type):
    """Type of four float32 lanes inside compiled code."""

    def __init__(self) -> None:
        super().__init__("FourLanes")


_LANES = _FourLanes()


@register_model(_FourLanes)
class _FourLanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _FOUR)


def _row_pointer(context: Any, builder: Any, kind: Any, value: Any, row: Any) -> Any:
    """Return a pointer to a row of four items in a C-contiguous array, without a bounds check."""
    data = context.make_array(kind)(context, builder, value).data
    return builder.gep(data, [builder.mul(row, ir.Constant(row.type, 4))])


@intrinsic
def four_at(typing: Any, array: Any, row: Any) -> Any:  # noqa: ARG001
    """Read a row of an (N, 4) array of float32 or uint8, without a bounds check."""
    if array.layout != "C" or array.ndim != 2 or array.dtype not in (types.float32, types.uint8):
        raise TypingError("four_at reads C-contiguous (N, 4) arrays of float32 or uint8")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = signature.args[0]
        start = _row_pointer(context, builder, kind, *arguments)
        item = ir.VectorType(context.get_data_type(kind.dtype), 4)
        lanes = builder.load(builder.bitcast(start, item.as_pointer()), align=kind.dtype.bitwidth // 8)
        return lanes if kind.dtype == types.float32 else builder.uitofp(lanes, _FOUR)

    return _LANES(array, types.intp), generate


@intrinsic
def _spread(typing: Any, number: Any) -> Any:  # noqa: ARG001
    """Return a float32 in every lane."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        vector = builder.insert_element(ir.Constant(_FOUR, ir.Undefined), arguments[0], ir.Constant(ir.IntType(32), 0))
        mask = ir.Constant(ir.VectorType(ir.IntType(32), 4), [0, 0, 0, 0])
        return builder.shuffle_vector(vector, ir.Constant(_FOUR, ir.Undefined), mask)

    return _LANES(types.float32), generate


def _lane_by_lane(instruction: str) -> Any:
    """Return an intrinsic that applies an instruction to two values of four lanes."""

    @intrinsic
    def combine(typing: Any, left: Any, right: Any) -> Any:  # noqa: ARG001
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
            return getattr(builder, instruction)(*arguments)

        return _LANES(_LANES, _LANES), generate

    return combine


_add, _multiply = _lane_by_lane("fadd"), _lane_by_lane("fmul")


def _operator(sign: Any, combine: Any) -> None:
    """Define an operator for four lanes with four lanes, and for four lanes with a float32."""

    def lanes(left: Any, right: Any) -> Any:
        return combine(left, right)

    def one(left: Any, right: Any) -> Any:
        return combine(left, _spread(right))

    @overload(sign)
    def choose(left: Any, right: Any) -> Any:
        if left != _LANES:
            return None
        return lanes if right == _LANES else one if right == types.float32 else None


_operator(operator.add, _add)
_operator(operator.mul, _multiply)


@intrinsic
def first_three_steps(typing: Any, lanes: Any, last: Any) -> Any:  # noqa: ARG001
    """Return the integer parts of the first three lanes, at most `last`, as a tuple."""
    result = types.UniTuple(types.uintp, 3)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        whole = builder.fptosi(arguments[0], ir.VectorType(ir.IntType(32), 4))
        numbers = []
        for lane in range(3):
            step = builder.sext(builder.extract_element(whole, ir.Constant(ir.IntType(32), lane)), ir.IntType(64))
            above = builder.icmp_signed(">", step, arguments[1])
            numbers.append(builder.select(above, arguments[1], step))
        return context.make_tuple(builder, signature.return_type, numbers)

    return result(_LANES, types.intp), generate
