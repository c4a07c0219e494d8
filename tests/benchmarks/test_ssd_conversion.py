"""The second detector of the look's benchmark: decoding of boxes, and its suppression of the same object's boxes."""

import numpy as np
import onnxruntime
import pytest

from benchmarks.support.ssd_conversion import _CLASSES, _HEADS, SSDBuilder, _outputs
from vsnbench.models.vlv.detectors.centernet.conversion import detector_file

ANCHOR = np.array([0.2, 0.3, 0.6, 0.5], np.float32)
"""Top, left, bottom, right."""


def detect(encoded: list[list[float]], logits: list[dict[int, float]]) -> list[np.ndarray]:
    """Return boxes, labels and scores of an image of 200 x 100 pixels, with one anchor for each head."""
    builder = SSDBuilder()
    builder.prepare_image()
    for head, name in enumerate(_outputs("BoxEncoding")):
        builder.tensor(name, np.array(encoded[head], np.float32).reshape(1, 4, 1, 1))
    for head, name in enumerate(_outputs("Class")):
        values = np.full(_CLASSES, -20, np.float32)
        for label, logit in logits[head].items():
            values[label] = logit
        builder.tensor(name, values.reshape(1, -1, 1, 1))
    builder.find_boxes(np.tile(ANCHOR, (_HEADS, 1)))
    session = onnxruntime.InferenceSession(detector_file(builder, "ssd", "objects", {}))
    return list(session.run(["boxes", "labels", "scores"], {"image": np.zeros((1, 3, 100, 200), np.float32)}))


def test_boxes_are_decoded_from_their_anchors() -> None:
    # The centre moves by half the anchor's height and a quarter of its width; the box is twice as wide.
    shift = [10 * 0.5, 10 * 0.25, 0, 5 * np.log(2)]
    boxes, labels, scores = detect([shift] * _HEADS, [{62: 0.0}, *[{}] * (_HEADS - 1)])
    assert boxes == pytest.approx(np.array([[50.0, 40.0, 130.0, 80.0]]), abs=1e-3)
    assert labels.tolist() == [62]
    assert scores == pytest.approx([0.5])


def test_a_class_keeps_the_best_of_the_same_boxes_and_the_background_is_not_a_class() -> None:
    same = [[0.0] * 4] * _HEADS
    _, labels, scores = detect(same, [{62: 0.0, 0: 9.0}, {62: 1.0}, {63: -1.0}, {}, {}, {}])
    assert labels.tolist() == [62, 63]
    assert scores == pytest.approx([0.731, 0.269], abs=1e-3)
