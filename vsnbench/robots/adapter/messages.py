"""Messages of a motion adapter as values. They are untrusted: each is checked here (docs/motion-adapter.md)."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from pydantic import ValidationError

from vsnbench.errors import RobotError
from vsnbench.models.remote.vsnbench_policy import WireError, observation_of
from vsnbench.sensing.hazards import Hazard
from vsnbench.settings.validation import first_error
from vsnbench.text.sanitize import sanitize
from vsnbench.values.battery import Battery
from vsnbench.values.encoding.codec import FURTHER_ARRAYS
from vsnbench.values.encoding.motion_answer import (
    MOST_NAME,
    MOST_TEXT,
    MotionCard,
    number_in,
    result_of_answer,
    text_in,
    words_in,
)
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.observation import Sensor
from vsnbench.values.robot_identity import SimulationAccount

_SENSORS = frozenset({Sensor.RGB, Sensor.DEPTH, *FURTHER_ARRAYS})
_Point = tuple[float, float]
_Planar = tuple[float, float, float]


class InvalidAnswerError(RobotError):
    """An adapter's message breaks the protocol."""

    code = "invalid-answer"


@dataclass(frozen=True, slots=True)
class AdapterCard(MotionCard):
    """What an adapter over a socket states of itself."""

    sensors: frozenset[Sensor]
    simulation: SimulationAccount | None

    @classmethod
    def of(cls, content: Any) -> Self:
        """Return the card of a message.

        Raises:
            InvalidAnswerError: it is not a card.
        """
        try:
            mover = MotionCard.of(content)
        except ValueError as error:
            raise InvalidAnswerError(str(error)) from error
        sensors = _words(content, "sensors", _SENSORS, [Sensor.RGB])
        if Sensor.RGB not in sensors:
            raise InvalidAnswerError("the card's `sensors` lack `rgb`, which every robot has")
        simulation = content.get("simulation")
        try:
            account = None if simulation is None else SimulationAccount.model_validate(simulation)
        except ValidationError as error:
            field, problem = first_error(error, SimulationAccount)
            text = f"the card's {'.'.join(filter(None, ('simulation', field)))}: {problem.statement}"
            raise InvalidAnswerError(sanitize(text)[:MOST_TEXT]) from error
        return cls(
            mover.name,
            mover.version,
            mover.movements,
            sensors=frozenset({Sensor.ODOMETRY, *map(Sensor, sensors)}),
            simulation=account,
        )


@dataclass(frozen=True, slots=True)
class AdapterState:
    """Odometry and health of a robot at one time."""

    pose: _Planar
    """Odometry: x, y in metres, heading in radians."""
    stamp_s: float
    hazards: tuple[Hazard, ...] = ()
    rival: str = ""
    """Who else drives the robot, or an empty string."""
    battery: Battery | None = None
    truth: _Planar | None = None
    """Pose in the site, of a simulated robot."""
    velocity: _Point | None = None
    """m/s forward and rad/s, where the adapter states them."""
    depth_m: npt.NDArray[np.float32] | None = None
    """(H, W) newest depth image while the robot moves, metres, NaN or infinity where invalid."""
    depth_stamp_s: float = math.nan

    @classmethod
    def of(cls, message: Mapping[str, Any]) -> Self:
        """Return the state in a `state`, `progress` or `done` message.

        Raises:
            InvalidAnswerError: it has no odometry, or a key has another type.
        """
        hazards = _words(message, "hazards", list(Hazard))
        truth, velocity = message.get("truth"), message.get("velocity")
        stamp_s = stamp_in(message)
        state = cls(
            pose=_planar(message.get("pose"), "pose"),
            stamp_s=stamp_s,
            hazards=tuple(map(Hazard, hazards)),
            rival=_text(message, "rival"),
            battery=_battery(message.get("battery")),
            truth=None if truth is None else _planar(truth, "truth"),
            velocity=None if velocity is None else _two(velocity, "velocity"),
        )
        if message.get("depth") is None:
            return state
        depth_m, _ = depth_in(message)
        return replace(state, depth_m=depth_m, depth_stamp_s=stamp_in(message, "depth_stamp_s", stamp_s))


def result_in(message: Mapping[str, Any], *, simulated: bool) -> MotionResult:
    """Return what a `done` message reports of a movement; see `result_of_answer`.

    Raises:
        InvalidAnswerError: it is not an answer.
    """
    try:
        return result_of_answer(message, simulated=simulated)
    except ValueError as error:
        raise InvalidAnswerError(str(error)) from error


def problem_in(message: Mapping[str, Any]) -> str:
    """Return why a simulator cannot put the robot down, by a `placed` message, or an empty string.

    Raises:
        InvalidAnswerError: it is not a text.
    """
    return _text(message, "problem")


def colours_in(message: Mapping[str, Any]) -> npt.NDArray[np.uint8]:
    """Return the colours (H, W, 3) of an `observation`.

    Raises:
        InvalidAnswerError: there are none, or they are not an image.
    """
    image: npt.NDArray[np.uint8] = _image_in(message, "rgb").rgb
    return image


def depth_in(message: Mapping[str, Any]) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_] | None]:
    """Return the depth (H, W) in metres, and the pixels beyond the camera's range if they are stated.

    Raises:
        InvalidAnswerError: there is none, or it is not an image.
    """
    seen = _image_in(message, "depth")
    return seen.depth_m, seen.beyond_range


def arrays_in(message: Mapping[str, Any], sensors: frozenset[Sensor]) -> dict[str, Any]:
    """Return the arrays of further sensors, by their field of an observation.

    Args:
        message: an `observation`.
        sensors: sensors of the adapter's card.

    Raises:
        InvalidAnswerError: one of them is missing, or has another form than its sensor declares.
    """
    wanted = [sensor for sensor in FURTHER_ARRAYS if sensor in sensors]
    seen = _image_in(message, "arrays").arrays if wanted else {}
    for sensor in wanted:
        values = seen.get(sensor.field)
        if values is None or sensor.array is None or not sensor.array.fits(values):
            raise InvalidAnswerError(f"`arrays.{sensor.field}` must be {sensor.array}")
    return {sensor.field: seen[sensor.field] for sensor in wanted}


def stamp_in(message: Mapping[str, Any], key: str = "stamp_s", otherwise: float | None = None) -> float:
    """Return a stamp, seconds on the robot's clock.

    Raises:
        InvalidAnswerError: it is missing without an alternative, or not a finite number.
    """
    try:
        return number_in(message, key, otherwise)
    except ValueError as error:
        raise InvalidAnswerError(str(error)) from error


def _image_in(message: Mapping[str, Any], key: str) -> Any:
    """Return the observation with one image, or with the arrays, which have the form of the wire."""
    if message.get(key) is None:
        raise InvalidAnswerError(f"`{key}` is missing")
    try:
        return observation_of({"stamp_s": 0.0, "camera": {}, key: message[key]})
    except WireError as error:
        raise InvalidAnswerError(str(error)) from error


def _planar(values: Any, key: str) -> _Planar:
    x_m, y_m, heading_rad = _numbers(values, key, 3)
    return x_m, y_m, heading_rad


def _two(values: Any, key: str) -> _Point:
    first, second = _numbers(values, key, 2)
    return first, second


def _battery(content: Any) -> Battery | None:
    if content is None:
        return None
    if not isinstance(content, Mapping):
        raise InvalidAnswerError("`battery` must be a map")
    return Battery.reported(stamp_in(content, "share", math.nan), stamp_in(content, "volts", 0.0))


def _numbers(values: Any, key: str, count: int) -> tuple[float, ...]:
    if not isinstance(values, list | tuple) or len(values) != count:
        raise InvalidAnswerError(f"`{key}` must be a list of {count} numbers, not {values!r:.40}")
    return tuple(stamp_in({key: value}, key) for value in values)


def _text(message: Mapping[str, Any], key: str) -> str:
    try:
        return text_in(message, key, MOST_NAME)
    except ValueError as error:
        raise InvalidAnswerError(str(error)) from error


def _words(
    message: Mapping[str, Any], key: str, known: Collection[str], otherwise: Sequence[str] = ()
) -> Sequence[str]:
    try:
        return words_in(message, key, known, otherwise)
    except ValueError as error:
        raise InvalidAnswerError(str(error)) from error
