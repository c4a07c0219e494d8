"""Codec of decisions and diagnostics, and encoder of observations, for JSON and msgpack.

The recorder writes with it, viewer and exports read with it, and remote models exchange messages in it
(`models/remote/vsnbench_policy.py` decodes observations on their side). Input is
validated like a policy's decision (`decision_check`), since it may come from any record or peer: it becomes plain
values of bounded size, or raises DecisionError.
"""

import base64
import binascii
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, Literal, get_args

import numpy as np
import numpy.typing as npt

from vsnbench.errors import DecisionError
from vsnbench.text.sanitize import sanitize
from vsnbench.values.decision import Box, Decision, Diagnostics, GridMap
from vsnbench.values.decision_check import (
    MOST_MAP_CELLS,
    MOST_NAME_CHARACTERS,
    SENSING,
    SHOWN,
    checked_decision,
    checked_diagnostics,
)
from vsnbench.values.encoding.images import decode_picture, depth_millimetres, encode_jpeg, encode_png, picture_size
from vsnbench.values.movement import DISCRETE_ACTIONS, MAX_PARTS, Action, Chunk, Movement
from vsnbench.values.observation import Observation, Sensor

_MOST_PNG_BYTES = 2 * MOST_MAP_CELLS**2

_IN_HISTORY: Final = ("stamp_s", "rgb", "depth", "pose", "arrays", "cameras")
"""Keys of an observation in the history of another one, which has the same camera."""
FURTHER_ARRAYS: Final = tuple(
    sensor for sensor in Sensor if sensor.array and sensor.is_sent and sensor not in (Sensor.RGB, Sensor.DEPTH)
)
"""Sensors that `arrays` of a message has by the name of their field; `rgb` and `depth` have encodings of their own."""

_MOVEMENTS: Final[Mapping[str, type[Movement]]] = {made.kind.value: made for made in get_args(Movement)}

RgbEncoding = Literal["raw", "jpeg"]
DepthEncoding = Literal["f32", "mm16"]


def decision_to_message(decision: Decision) -> dict[str, Any]:
    """Return a decision as values for JSON."""
    diagnostics = decision.diagnostics
    details = {"details": dict(diagnostics.details)} if diagnostics.details else {}
    parts = [part.value if isinstance(part, Action) else part.to_json() for part in decision.parts]
    return {
        "action": decision.action.value,
        "raw_action": decision.raw_action,
        "probabilities": dict(diagnostics.probabilities),
        "diagnostics": _shown(diagnostics) | details,
        **({} if decision.movement is None else {"movement": decision.movement.to_json()}),
        **({"parts": parts} if parts else {}),
    }


def movement_from_json(content: Mapping[str, Any]) -> Movement:
    """Return the movement of `to_json`; unknown keys are ignored.

    Raises:
        ValueError: the content is not a movement, or a number of it is not finite.
    """
    try:
        return _MOVEMENTS[content["kind"]].from_json(content)
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"not a movement: {error}") from error


def _answer_of(message: Mapping[str, Any]) -> Action | Movement | Chunk:
    """Return the action, the movement or the chunk of a message."""
    try:
        if parts := message.get("parts"):
            if not isinstance(parts, list) or len(parts) > MAX_PARTS:
                raise DecisionError(f"parts must be a list of at most {MAX_PARTS} actions and movements")
            return Chunk(tuple(Action(p) if isinstance(p, str) else movement_from_json(p) for p in parts))
        if message.get("movement") is not None:
            return movement_from_json(message["movement"])
    except ValueError as error:
        raise DecisionError(f"the movement cannot be read: {error}") from error
    try:
        return Action(message["action"])
    except (KeyError, ValueError) as error:
        raise DecisionError(f"action must be one of {', '.join(DISCRETE_ACTIONS)}") from error


def decision_from_message(message: object) -> Decision:
    """Return the decision of a message; `raw_action`, `probabilities` and `diagnostics` are optional.

    Raises:
        DecisionError: the message is not a decision, or a part of it cannot be shown and recorded.
    """
    if not isinstance(message, Mapping):
        raise DecisionError(f"expected a decision, got a {type(message).__name__}")
    answer = _answer_of(message)
    parts = message.get("diagnostics") or {}
    if not isinstance(parts, Mapping):
        raise DecisionError(f"diagnostics must be a mapping, got a {type(parts).__name__}")
    diagnostics = _diagnostics(message.get("probabilities") or {}, parts, parts.get("details") or {})
    return checked_decision(Decision(answer, message.get("raw_action") or "", diagnostics))


def diagnostics_to_details(diagnostics: Diagnostics) -> dict[str, Any]:
    """Return the `details` of a recorded step: the policy's own, plus what the viewer shows.

    Probabilities have their own column.
    """
    shown = _shown(diagnostics)
    return {**diagnostics.details, SHOWN: shown} if shown else dict(diagnostics.details)


def decision_from_record(action: Action, raw_action: str, probabilities: object, details: object) -> Decision:
    """Return the decision of a recorded step from its four columns.

    Diagnostics that cannot be read are replaced by a note with the reason, so that the step can still be viewed.
    """
    try:
        diagnostics = _recorded_diagnostics(probabilities, details)
    except DecisionError as error:
        diagnostics = Diagnostics(note=f"The diagnostics of this step cannot be read: {error}")
    return Decision(action, sanitize(raw_action[:MOST_NAME_CHARACTERS]), diagnostics)


def _recorded_diagnostics(probabilities: object, details: object) -> Diagnostics:
    if not isinstance(details or {}, Mapping):
        raise DecisionError(f"details must be a mapping, got a {type(details).__name__}")
    own = dict(details or {})  # type: ignore[call-overload]
    shown = own.pop(SHOWN, None) or {}
    own.pop(SENSING, None)
    if not isinstance(shown, Mapping):
        raise DecisionError(f"details.{SHOWN} must be a mapping, got a {type(shown).__name__}")
    if isinstance(probabilities, Mapping):
        probabilities = {name: value for name, value in probabilities.items() if value is not None}
    return checked_diagnostics(_diagnostics(probabilities or {}, shown, own))


def observation_to_message(
    observation: Observation, *, rgb: RgbEncoding = "raw", depth: DepthEncoding = "f32"
) -> dict[str, Any]:
    """Return an observation as values for msgpack: those of JSON, and bytes or views for pixels.

    Args:
        observation: the observation; undeclared sensors are None or absent in the message.
        rgb: `raw`, or `jpeg`, which has a tenth of the bytes and changes the pixels.
        depth: `f32` metres, or `mm16` millimetres with half the bytes.
    """
    there = observation.sensors
    message: dict[str, Any] = {
        "stamp_s": observation.stamp_s,
        "camera": observation.camera.model_dump(mode="json"),
        "rgb": None,
        "depth": None,
        "pose": None,
    }
    if (budget := observation.budget) is not None:
        message["budget"] = {name: getattr(budget, name) for name in ("actions_left", "time_left_s", "path_left_m")}
    if Sensor.RGB in there:
        pixels = observation.rgb
        message["rgb"] = _image(rgb, pixels, _bytes_of(pixels, "u1") if rgb == "raw" else encode_jpeg(pixels))
    if Sensor.DEPTH in there and observation.depth_m is not None:
        metres = observation.depth_m
        data = _bytes_of(metres, "<f4") if depth == "f32" else _bytes_of(depth_millimetres(metres), "<u2")
        message["depth"] = _image(depth, metres, data)
        if observation.beyond_range is not None and observation.beyond_range.any():
            message["depth"]["beyond_range"] = np.packbits(observation.beyond_range).tobytes()
    if Sensor.ODOMETRY in there:
        pose = observation.pose
        message["pose"] = [pose.x_m, pose.y_m, pose.heading_rad]
    if further := [sensor.field for sensor in FURTHER_ARRAYS if sensor in there]:
        message["arrays"] = {name: _array(getattr(observation, name)) for name in further}
    if observation.cameras:
        message["cameras"] = {
            role.value: observation_to_message(view, rgb=rgb, depth=depth) for role, view in observation.cameras.items()
        }
    if observation.history:
        earlier = (observation_to_message(seen, rgb=rgb, depth=depth) for seen in observation.history)
        message["history"] = [{name: content[name] for name in _IN_HISTORY if name in content} for content in earlier]
    return message


def _shown(diagnostics: Diagnostics) -> dict[str, Any]:
    """Return the diagnostics for a viewer; empty parts are omitted."""
    shown = {name: to_json(getattr(diagnostics, name)) for name, (to_json, _) in _SHOWN_PARTS.items()}
    return {name: value for name, value in shown.items() if value}


def _diagnostics(probabilities: Any, shown: Mapping[str, Any], details: Any) -> Diagnostics:
    """Return diagnostics from their parts, which `checked_diagnostics` validates; here they only get their types.

    An empty part is absent, except a sub-goal: no point is empty.
    """
    present = {name: value for name in _SHOWN_PARTS if (value := shown.get(name)) or name == "sub_goal"}
    parts = {name: _SHOWN_PARTS[name][1](value) for name, value in present.items()}
    return Diagnostics(probabilities=probabilities, details=details, **parts)


def _unchanged(value: Any) -> Any:
    return value


def _points_to_json(points: Sequence[tuple[float, float]]) -> list[list[float]]:
    return [list(point) for point in points]


def _boxes_to_json(boxes: Sequence[Box]) -> list[list[Any]]:
    return [[box.left, box.top, box.right, box.bottom, box.label, box.score] for box in boxes]


def _boxes_from_json(boxes: Any) -> tuple[Box, ...]:
    if not isinstance(boxes, list | tuple) or not all(isinstance(box, list | tuple) and len(box) == 6 for box in boxes):
        raise DecisionError("boxes must be a list of [left, top, right, bottom, label, score]")
    return tuple(Box(*box) for box in boxes)


def _scalars_to_json(scalars: Mapping[str, float]) -> dict[str, float | None]:
    return {name: value if math.isfinite(value) else None for name, value in scalars.items()}


def _scalars_from_json(scalars: Any) -> Any:
    if not isinstance(scalars, Mapping):
        return scalars
    return {name: math.nan if value is None else value for name, value in scalars.items()}


def _map_to_json(grid: GridMap | None) -> dict[str, Any] | None:
    if grid is None:
        return None
    return {
        "png": base64.b64encode(encode_png(grid.cells)).decode(),
        "origin_m": [grid.origin_x_m, grid.origin_y_m],
        "resolution_m": grid.resolution_m,
    }


def _map_from_json(stored: object) -> GridMap:
    import cv2

    if not isinstance(stored, Mapping) or not isinstance(stored.get("png"), str):
        raise DecisionError("map must be a mapping with a PNG")
    origin = stored.get("origin_m")
    if not isinstance(origin, list | tuple) or len(origin) != 2:
        raise DecisionError("map.origin_m must be a point (x, y)")
    if len(stored["png"]) > _MOST_PNG_BYTES:
        raise DecisionError(f"map.png is too long: {len(stored['png'])} characters")
    try:
        png = base64.b64decode(stored["png"], validate=True)
    except (binascii.Error, ValueError) as error:
        raise DecisionError("map.png must be base64") from error
    size = picture_size(png)
    if size is None or max(size) > MOST_MAP_CELLS:
        raise DecisionError(
            "map.png must be a PNG" if size is None else f"map is too large: {size[0]} x {size[1]} cells"
        )
    cells = decode_picture(png, cv2.IMREAD_UNCHANGED)
    if cells is None:
        raise DecisionError("map.png is damaged")
    return GridMap(cells, origin[0], origin[1], stored.get("resolution_m"))  # type: ignore[arg-type]


_SHOWN_PARTS: Final[Mapping[str, tuple[Callable[[Any], Any], Callable[[Any], Any]]]] = {
    "boxes": (_boxes_to_json, _boxes_from_json),
    "map": (_map_to_json, _map_from_json),
    "sub_goal": (lambda point: point and list(point), _unchanged),
    "path": (_points_to_json, _unchanged),
    "nodes": (_points_to_json, _unchanged),
    "scalars": (_scalars_to_json, _scalars_from_json),
    "note": (_unchanged, _unchanged),
}
"""Field of `Diagnostics` that the viewer shows -> function to JSON, and back."""


def _image(encoding: str, pixels: npt.NDArray[Any], data: bytes | memoryview) -> dict[str, Any]:
    height, width = pixels.shape[:2]
    return {"encoding": encoding, "height": height, "width": width, "data": data}


def _array(values: npt.NDArray[Any]) -> dict[str, Any]:
    """Return an array as its type, shape, and bytes in little-endian order."""
    data = _bytes_of(values, values.dtype.newbyteorder("<").str)
    return {"dtype": values.dtype.name, "shape": list(values.shape), "data": data}


def _bytes_of(array: npt.NDArray[Any], kind: str) -> memoryview:
    """Return an array's bytes as numbers of a type, without a copy if possible."""
    return np.ascontiguousarray(array, kind).data.cast("B")
