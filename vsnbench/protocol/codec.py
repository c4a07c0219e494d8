"""The one codec of observation, decision and diagnostics: to values that JSON or msgpack carry, and back.

The recorder writes with it, the viewer and exports read with it, and a model elsewhere is talked to in it. What is
read is checked as a policy's own answer is (`decision_check`), because a record or a peer may have made it: whatever
it is, either it becomes plain values of bounded size or a DecisionError or ObservationError says what was wrong.
"""

import base64
import binascii
import math
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import ValidationError

from vsnbench.errors import DecisionError, ObservationError
from vsnbench.harmless_text import harmless
from vsnbench.protocol.actions import Action
from vsnbench.protocol.camera import Camera
from vsnbench.protocol.decision import Box, Decision, Diagnostics, GridMap
from vsnbench.protocol.decision_check import (
    MOST_MAP_CELLS,
    MOST_NAME_CHARACTERS,
    SENSING,
    SHOWN,
    checked_decision,
    checked_diagnostics,
)
from vsnbench.protocol.observation import Observation, Sensor, observation_of
from vsnbench.protocol.pictures import (
    decode_picture,
    depth_metres,
    depth_millimetres,
    encode_jpeg,
    encode_png,
    picture_size,
)
from vsnbench.protocol.pose import Pose

_MOST_PNG_BYTES = 2 * MOST_MAP_CELLS**2

RgbEncoding = Literal["raw", "jpeg"]
DepthEncoding = Literal["f32", "mm16"]


def decision_to_message(decision: Decision) -> dict[str, Any]:
    """Return a decision as values that JSON carries."""
    diagnostics = decision.diagnostics
    details = {"details": dict(diagnostics.details)} if diagnostics.details else {}
    return {
        "action": decision.action.value,
        "raw_action": decision.raw_action,
        "probabilities": dict(diagnostics.probabilities),
        "diagnostics": _shown(diagnostics) | details,
    }


def decision_from_message(message: object) -> Decision:
    """Return the decision of a message; `raw_action`, `probabilities` and `diagnostics` may be missing.

    Raises:
        DecisionError: it is none, or a part of it cannot be shown and recorded.
    """
    if not isinstance(message, Mapping):
        raise DecisionError(f"it is no decision but a {type(message).__name__}")
    try:
        action = Action(message["action"])
    except (KeyError, ValueError) as error:
        raise DecisionError(f"its action is none of {', '.join(Action)}") from error
    parts = message.get("diagnostics") or {}
    if not isinstance(parts, Mapping):
        raise DecisionError(f"its diagnostics are no mapping but a {type(parts).__name__}")
    diagnostics = _diagnostics(message.get("probabilities") or {}, parts, parts.get("details") or {})
    return checked_decision(Decision(action, message.get("raw_action") or "", diagnostics))


def diagnostics_to_details(diagnostics: Diagnostics) -> dict[str, Any]:
    """Return the `details` of a recorded step: the policy's own, and beside them what the viewer shows.

    Probabilities have a column of their own.
    """
    shown = _shown(diagnostics)
    return {**diagnostics.details, SHOWN: shown} if shown else dict(diagnostics.details)


def decision_from_record(action: Action, raw_action: str, probabilities: object, details: object) -> Decision:
    """Return the decision of a recorded step, from its four columns.

    Diagnostics that cannot be read are replaced by a note that says why: the step is still worth seeing.
    """
    try:
        diagnostics = _recorded_diagnostics(probabilities, details)
    except DecisionError as error:
        diagnostics = Diagnostics(note=f"The diagnostics of this step cannot be read: {error}")
    return Decision(action, harmless(raw_action[:MOST_NAME_CHARACTERS]), diagnostics)


def _recorded_diagnostics(probabilities: object, details: object) -> Diagnostics:
    if not isinstance(details or {}, Mapping):
        raise DecisionError(f"details are no mapping but a {type(details).__name__}")
    own = dict(details or {})  # type: ignore[call-overload]
    shown = own.pop(SHOWN, None) or {}
    own.pop(SENSING, None)
    if not isinstance(shown, Mapping):
        raise DecisionError(f"what is shown is no mapping but a {type(shown).__name__}")
    if isinstance(probabilities, Mapping):
        probabilities = {name: value for name, value in probabilities.items() if value is not None}
    return checked_diagnostics(_diagnostics(probabilities or {}, shown, own))


def observation_to_message(
    observation: Observation, *, rgb: RgbEncoding = "raw", depth: DepthEncoding = "f32"
) -> dict[str, Any]:
    """Return an observation as values that msgpack carries: those of JSON, and bytes or views of them for pixels.

    Args:
        observation: what is not shown in it is None in the message.
        rgb: `raw`, or `jpeg`, which is a tenth of the bytes and not the same pixels.
        depth: `f32` metres, or `mm16` millimetres, half the bytes.
    """
    there = observation.sensors
    message: dict[str, Any] = {
        "stamp_s": observation.stamp_s,
        "camera": observation.camera.model_dump(mode="json"),
        "rgb": None,
        "depth": None,
        "pose": None,
    }
    if Sensor.RGB in there:
        pixels = observation.rgb
        message["rgb"] = _image(rgb, pixels, _bytes_of(pixels, "u1") if rgb == "raw" else encode_jpeg(pixels))
    if Sensor.DEPTH in there and observation.depth_m is not None:
        metres = observation.depth_m
        data = _bytes_of(metres, "<f4") if depth == "f32" else _bytes_of(depth_millimetres(metres), "<u2")
        message["depth"] = _image(depth, metres, data)
    if Sensor.ODOMETRY in there:
        pose = observation.pose
        message["pose"] = [pose.x_m, pose.y_m, pose.heading_rad]
    return message


def observation_from_message(message: object) -> Observation:
    """Return the observation of a message, with the sensors that it has and no others.

    Raises:
        ObservationError: it is none.
    """
    if not isinstance(message, Mapping):
        raise ObservationError(f"an observation is no {type(message).__name__}")
    try:
        camera = Camera.model_validate(message.get("camera"))
        measured: dict[str, Any] = {}
        if (rgb := message.get("rgb")) is not None:
            measured["rgb"] = _rgb_of(rgb)
        if (depth := message.get("depth")) is not None:
            measured["depth_m"] = _depth_of(depth)
        if (pose := message.get("pose")) is not None:
            x_m, y_m, heading_rad = pose
            measured["pose"] = Pose(float(x_m), float(y_m), float(heading_rad))
        stamp_s = float(message["stamp_s"])
        if not math.isfinite(stamp_s):
            raise ValueError(f"stamp_s is {stamp_s}")
    except ValidationError as error:
        raise ObservationError(f"the observation's camera is none: {error.error_count()} faults") from error
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ObservationError(f"the observation is malformed ({type(error).__name__}: {error})"[:300]) from error
    return observation_of(stamp_s, camera, **measured)


def _shown(diagnostics: Diagnostics) -> dict[str, Any]:
    """Return what a viewer shows of diagnostics; parts that are empty are left out."""
    grid = diagnostics.map
    shown: dict[str, Any] = {
        "boxes": [[b.left, b.top, b.right, b.bottom, b.label, b.score] for b in diagnostics.boxes],
        "map": None if grid is None else _map_to_json(grid),
        "sub_goal": None if diagnostics.sub_goal is None else list(diagnostics.sub_goal),
        "path": [list(point) for point in diagnostics.path],
        "nodes": [list(point) for point in diagnostics.nodes],
        "scalars": {name: value if math.isfinite(value) else None for name, value in diagnostics.scalars.items()},
        "note": diagnostics.note,
    }
    return {name: value for name, value in shown.items() if value}


def _diagnostics(probabilities: Any, shown: Mapping[str, Any], details: Any) -> Diagnostics:
    """Return diagnostics from their parts, unchecked but for what cannot be made at all."""
    boxes = shown.get("boxes") or ()
    if not isinstance(boxes, list | tuple) or not all(isinstance(box, list | tuple) and len(box) == 6 for box in boxes):
        raise DecisionError("boxes are no list of [left, top, right, bottom, label, score]")
    scalars = shown.get("scalars") or {}
    if isinstance(scalars, Mapping):
        scalars = {name: math.nan if value is None else value for name, value in scalars.items()}
    return Diagnostics(
        probabilities=probabilities,
        boxes=tuple(Box(*box) for box in boxes),
        map=_map_from_json(shown["map"]) if shown.get("map") else None,
        sub_goal=shown.get("sub_goal"),
        path=shown.get("path") or (),
        nodes=shown.get("nodes") or (),
        scalars=scalars,
        note=shown.get("note") or "",
        details=details,
    )


def _map_to_json(grid: GridMap) -> dict[str, Any]:
    return {
        "png": base64.b64encode(encode_png(grid.cells)).decode(),
        "origin_m": [grid.origin_x_m, grid.origin_y_m],
        "resolution_m": grid.resolution_m,
    }


def _map_from_json(kept: object) -> GridMap:
    import cv2

    if not isinstance(kept, Mapping) or not isinstance(kept.get("png"), str):
        raise DecisionError("map is no mapping with a PNG")
    origin = kept.get("origin_m")
    if not isinstance(origin, list | tuple) or len(origin) != 2:
        raise DecisionError("map.origin_m is no point (x, y)")
    if len(kept["png"]) > _MOST_PNG_BYTES:
        raise DecisionError(f"map has a PNG of {len(kept['png'])} characters")
    try:
        png = base64.b64decode(kept["png"], validate=True)
    except (binascii.Error, ValueError) as error:
        raise DecisionError("map.png is no base64") from error
    size = picture_size(png)
    if size is None or max(size) > MOST_MAP_CELLS:
        raise DecisionError("map.png is no PNG" if size is None else f"map has {size[0]} x {size[1]} cells")
    cells = decode_picture(png, cv2.IMREAD_UNCHANGED)
    if cells is None:
        raise DecisionError("map.png is damaged")
    return GridMap(cells, origin[0], origin[1], kept.get("resolution_m"))  # type: ignore[arg-type]


def _image(encoding: str, pixels: npt.NDArray[Any], data: bytes | memoryview) -> dict[str, Any]:
    height, width = pixels.shape[:2]
    return {"encoding": encoding, "height": height, "width": width, "data": data}


def _bytes_of(array: npt.NDArray[Any], kind: str) -> memoryview:
    """Return an array's bytes as numbers of a kind, not copied where they lie so already."""
    return np.ascontiguousarray(array, kind).data.cast("B")


def _rgb_of(image: Mapping[str, Any]) -> npt.NDArray[np.uint8]:
    import cv2

    shape, data = (image["height"], image["width"], 3), bytes(memoryview(image["data"]))
    if image["encoding"] == "raw":
        return np.frombuffer(data, np.uint8).reshape(_checked_shape(shape, len(data)))
    if image["encoding"] != "jpeg" or picture_size(data) != (shape[1], shape[0]):
        raise ValueError("rgb is neither raw nor a JPEG of its size")
    bgr = decode_picture(data, cv2.IMREAD_COLOR)
    if bgr is None:
        raise ValueError("rgb is a damaged JPEG")
    return np.ascontiguousarray(bgr[..., ::-1])


def _depth_of(image: Mapping[str, Any]) -> npt.NDArray[np.float32]:
    kind: np.dtype[Any] = np.dtype({"f32": "<f4", "mm16": "<u2"}[image["encoding"]])
    shape = _checked_shape((image["height"], image["width"]), len(image["data"]) // kind.itemsize)
    numbers = np.frombuffer(image["data"], kind).reshape(shape)
    return numbers.astype(np.float32) if image["encoding"] == "f32" else depth_metres(numbers.astype(np.uint16))


def _checked_shape(shape: tuple[Any, ...], numbers: int) -> tuple[int, ...]:
    if not all(type(side) is int and side > 0 for side in shape) or math.prod(shape) != numbers:
        raise ValueError(f"{numbers} numbers are no image of shape {shape}")
    return shape
