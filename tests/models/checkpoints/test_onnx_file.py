"""Files of our writer are those that the onnx package writes, byte for byte."""

import numpy as np
import onnx
from hypothesis import given
from hypothesis import strategies as st
from onnx import TensorProto, helper, numpy_helper

from vsnbench.models.checkpoints.onnx_file import FLOAT, INT64, OnnxGraph

TEXTS = st.text(min_size=1, max_size=200)
INTEGERS = st.integers(-(2**63), 2**63 - 1)
ATTRIBUTES = st.dictionaries(
    st.text("abcdefgh", min_size=1).filter(lambda name: name not in ("name", "domain", "doc_string", "overload")),
    st.one_of(INTEGERS, TEXTS, st.lists(INTEGERS, min_size=1, max_size=5), st.floats(width=32, allow_nan=False)),
    max_size=4,
)


@given(attributes=ATTRIBUTES, inputs=st.lists(TEXTS, max_size=3), size=st.integers(0, 300), key=TEXTS)
def test_bytes_equal_those_of_the_onnx_package(
    attributes: dict[str, object], inputs: list[str], size: int, key: str
) -> None:
    numbers = np.arange(2 * size, dtype=np.float32).reshape(2, size)
    graph = OnnxGraph()
    graph.add("Conv", inputs, "a", "b", **attributes)
    graph.tensor("numbers", numbers)
    graph.integers(-1, size)
    ours = graph.file(
        "name",
        {"x": (FLOAT, (1, "width"))},
        {"a": (INT64, (size,))},
        versions=(8, 17),
        properties={key: "text"},
    )
    theirs = helper.make_model(
        helper.make_graph(
            [helper.make_node("Conv", inputs, ["a", "b"], **attributes)],
            "name",
            [helper.make_tensor_value_info("x", TensorProto.FLOAT, [1, "width"])],
            [helper.make_tensor_value_info("a", TensorProto.INT64, [size])],
            [
                numpy_helper.from_array(numbers, "numbers"),
                numpy_helper.from_array(np.array([-1, size]), f"integers {(-1, size)}"),
            ],
        ),
        opset_imports=[helper.make_opsetid("", 17)],
        ir_version=8,
    )
    helper.set_model_props(theirs, {key: "text"})
    assert ours == theirs.SerializeToString(deterministic=True)
    assert onnx.load_model_from_string(ours) == theirs
