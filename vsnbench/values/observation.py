"""Observation of a robot, and the part of it that a policy gets: the sensors on its card."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np
import numpy.typing as npt

from vsnbench.errors import SensorLostError, SensorNotDeclaredError
from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.pose import Pose

MAX_HISTORY: Final = 50
"""Most observations in the history of another one: as many as a chunk has parts."""
MAX_PIXEL_BYTES: Final = 56 * 2**20
"""Most bytes of arrays that an observation has together with those of its history, which fit into one message of the
wire."""


@dataclass(frozen=True, slots=True)
class ArraySpec:
    """Form of the array that a sensor measures."""

    dtype: type[np.generic]
    shape: tuple[int | str, ...]
    """Each dimension's length, or its name where any length is allowed. An array whose first two are `height` and
    `width` is an image, which each camera of a robot has; any other array belongs to the robot."""
    span: tuple[float, float]
    """Lowest and highest value of the synthetic arrays with which `models check` tries a policy."""
    unit: str = ""
    nan: str = ""
    """What NaN means in an array of floats; empty if every value is finite."""

    @property
    def is_image(self) -> bool:
        """Whether it has the pixels of a camera's image."""
        return self.shape[:2] == ("height", "width")

    def fits(self, values: npt.NDArray[Any]) -> bool:
        """Return whether an array has this form."""
        if values.dtype != self.dtype or values.ndim != len(self.shape):
            return False
        for wanted, length in zip(self.shape, values.shape, strict=True):
            if wanted != length and isinstance(wanted, int):
                return False
        return bool(self.nan) or values.dtype.kind != "f" or bool(np.isfinite(values).all())

    def __str__(self) -> str:
        name = np.dtype(self.dtype).name
        return f"({', '.join(map(str, self.shape))}) {name}{'' if self.nan or name[0] != 'f' else ', finite'}"


class Sensor(StrEnum):
    """Kind of measurement that a policy can require and a robot can provide.

    Each member is declared once, by its name on cards and the attributes below. Validation, private copies, messages,
    the cards of served models, `models check` and the table in docs/wire.md follow from that.
    """

    field: str
    """Field of `Observation` with the measurement."""
    meaning: str
    array: ArraySpec | None
    """Type and shape of the array; None if the sensor measures something other than an array."""
    is_sent: bool
    """Whether a served policy can get it."""

    RGB = ("rgb", "rgb", "red, green and blue", ArraySpec(np.uint8, ("height", "width", 3), span=(0, 255)))
    DEPTH = (
        "depth",
        "depth_m",
        "distance along the optical axis",
        ArraySpec(np.float32, ("height", "width"), span=(0.4, 8.0), unit="m", nan="invalid"),
    )
    ODOMETRY = ("odometry", "pose", "pose since the start of the episode, by odometry")
    INSTANCES = ("instances", "instances", "object at each pixel, by the simulator", None, False)
    """Only in simulation; for the simulated detector."""

    def __new__(  # noqa: D102 - a member's declaration
        cls, name: str, field: str = "", meaning: str = "", array: ArraySpec | None = None, is_sent: bool = True
    ) -> Self:
        sensor = str.__new__(cls, name)
        sensor._value_ = name
        sensor.field, sensor.meaning, sensor.array, sensor.is_sent = field, meaning, array, is_sent
        return sensor

    @property
    def is_of_camera(self) -> bool:
        """Whether each of a robot's cameras has it; otherwise only the observation of the robot has it."""
        return self.array is None or self.array.is_image


ARRAYS: Final = tuple((sensor.field, sensor.array) for sensor in Sensor if sensor.array is not None)
"""Fields of an observation that are arrays of a sensor, and their form."""
_SENSORS: Final = tuple(Sensor)


@dataclass(frozen=True, slots=True, eq=False)
class InstanceImage:
    """Labels of the simulator: the object at each pixel."""

    ids: npt.NDArray[np.int32]
    """(H, W); 0 is the background, k > 0 the k-th object of the site."""
    categories: Mapping[int, str]
    """Category of each possible id."""


@dataclass(frozen=True, slots=True)
class Budget:
    """What the protocol leaves an episode before an action; None for what it does not limit."""

    actions_left: int | None
    """Number of actions, the next one included."""
    time_left_s: float | None = None
    """Seconds on the robot's clock."""
    path_left_m: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """Measurements before one action.

    A robot's observation has all its sensors. A policy gets the result of `shown_to_policy`: private copies, in which
    access to a sensor that is not on the policy's card raises SensorNotDeclaredError.

    Raises:
        ValueError: an array has another form than its sensor declares.
    """

    rgb: npt.NDArray[np.uint8]
    """(H, W, 3) uint8."""
    depth_m: npt.NDArray[np.float32] | None
    """(H, W) float32, metres along the optical axis, NaN where invalid; None without a depth camera."""
    pose: Pose
    """Odometry relative to the start of the episode."""
    stamp_s: float
    """Time of the image; seconds on the robot's clock."""
    camera: Camera
    instances: InstanceImage | None = None
    depth_stamp_s: float | None = None
    """Time of the depth image, if the two are not synchronized."""
    beyond_range: npt.NDArray[np.bool_] | None = None
    """(H, W) whether depth is NaN because the surface is beyond the camera's range; None if unknown."""
    sensing: Mapping[str, float] = field(default_factory=dict)
    """How the observation was made (frames filtered, seconds waited and computed, skew), for the record."""
    depth_frame_digest: bytes | None = None
    """Digest of the newest raw depth image if `depth_m` is filtered from several; None if `depth_m` is raw."""
    budget: Budget | None = None
    """What the protocol leaves the episode; only in what a policy receives."""
    cameras: "Mapping[CameraRole, Observation]" = field(default_factory=dict)
    """What the robot's further cameras see, by role; each has its own images, time and calibration. A policy gets those
    of the roles on its card; the main camera's images are `rgb` and `depth_m`."""
    history: "tuple[Observation, ...]" = ()
    """Observations since the last call of `act`, oldest first, without this one: after each part of a chunk but its
    last, and of the film of a robot that drives on. Only for a policy whose card asks for it."""

    def __post_init__(self) -> None:
        for name, spec in ARRAYS:
            values = getattr(self, name, None)
            if values is not None and not spec.fits(values):
                raise ValueError(f"{name} must be {spec}, not {values.shape} {values.dtype}")

    @property
    def sensors(self) -> frozenset[Sensor]:
        """Sensors with a measurement."""
        return frozenset([sensor for sensor in _SENSORS if getattr(self, sensor.field, None) is not None])

    def __repr__(self) -> str:
        """Return a summary in one line."""
        return f"Observation({', '.join(sorted(self.sensors)) or 'nothing'} at {self.stamp_s:.3f} s)"

    # Undeclared sensors have no value in their slots: pickling skips them, and access raises an error.

    def __getstate__(self) -> dict[str, Any]:
        state: dict[str, Any] = {}
        for slot in fields(self):
            try:
                state[slot.name] = getattr(self, slot.name)
            except SensorNotDeclaredError:
                continue
        return state

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, value)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            sensor = next((sensor for sensor in _SENSORS if sensor.field == name), None)
            if sensor is None:
                raise AttributeError(f"an observation has no {name!r}")
            raise SensorNotDeclaredError(
                f"observation.{name} is not available: {sensor.value} is not on the model's card",
                advice=f"add Sensor.{sensor.name} to the card's sensors",
            )


def shown_to_policy(
    observation: Observation,
    sensors: frozenset[Sensor],
    budget: Budget | None = None,
    roles: frozenset[CameraRole] = frozenset(),
) -> Observation:
    """Return the observation for a policy with these sensors and camera roles on its card, as private copies.

    Changes by the policy or its threads affect neither the depth guard nor the record. The arrays are read-only, so
    that accidental changes raise an error.

    Raises:
        SensorLostError: a sensor has no measurement.
    """
    if missing := sensors - observation.sensors:
        raise SensorLostError(f"the model needs {' and '.join(sorted(missing))}, which this observation lacks")
    measured: dict[str, Any] = {sensor.field: _private(getattr(observation, sensor.field)) for sensor in sensors}
    measured["budget"] = budget
    if Sensor.DEPTH in sensors:
        measured["depth_stamp_s"] = observation.depth_stamp_s
        measured["beyond_range"] = _private(observation.beyond_range)
    if observation.history:
        measured["history"] = tuple(shown_to_policy(earlier, sensors, roles=roles) for earlier in observation.history)
    if further := sorted(roles - {CameraRole.FRONT}):
        if lost := [role for role in further if role not in observation.cameras]:
            raise SensorLostError(f"the model needs the {' and '.join(lost)} camera, which this observation lacks")
        of_camera = frozenset(sensor for sensor in sensors if sensor.is_of_camera)
        measured["cameras"] = {role: shown_to_policy(observation.cameras[role], of_camera) for role in further}
    return observation_of(observation.stamp_s, observation.camera.model_copy(), **measured)


def observation_of(stamp_s: float, camera: Camera, **measured: Any) -> Observation:
    """Return an observation with some measurements; access to others raises SensorNotDeclaredError.

    Args:
        stamp_s: time of the image; seconds on the robot's clock.
        camera: camera of the robot.
        measured: values of other fields.

    Raises:
        ValueError: an array has another form than its sensor declares.
    """
    made = object.__new__(Observation)
    absent = dict.fromkeys(("depth_stamp_s", "beyond_range", "depth_frame_digest", "budget"))
    for name, value in {
        **absent,
        "sensing": {},
        "cameras": {},
        "history": (),
        "stamp_s": stamp_s,
        "camera": camera,
        **measured,
    }.items():
        object.__setattr__(made, name, value)
    made.__post_init__()
    return made


def with_changes(observation: Observation, **changes: Any) -> Observation:
    """Return an observation with other values in some fields; sensors without a measurement stay so.

    Raises:
        ValueError: an array has another form than its sensor declares.
    """
    return observation_of(**{**observation.__getstate__(), **changes})


def newest_of(history: Sequence[Observation], observation: Observation, most: int) -> tuple[Observation, ...]:
    """Return the newest observations of a history that an observation may have; the oldest are dropped.

    Args:
        history: earlier observations, oldest first.
        observation: the observation that gets them.
        most: number that its model asks for.
    """
    kept: list[Observation] = []
    left = MAX_PIXEL_BYTES - _array_bytes(observation)
    for earlier in reversed(history[-most:] if most else ()):
        left -= _array_bytes(earlier)
        if left < 0:
            break
        kept.append(earlier)
    return tuple(reversed(kept))


def _array_bytes(observation: Observation) -> int:
    arrays = [getattr(observation, name, None) for name, _ in ARRAYS]
    own = sum(int(array.nbytes) for array in arrays if array is not None)
    return own + sum(map(_array_bytes, observation.cameras.values()))


def _private(value: Any) -> Any:
    """Return a copy of a measurement that a policy may keep: a read-only array, or an immutable value."""
    if value is None:
        return None
    if isinstance(value, Pose):
        return value.wrapped
    if isinstance(value, InstanceImage):
        ids = value.ids.view()  # no copy: neither depth guard nor record uses the simulator's labels
        ids.flags.writeable = False
        return InstanceImage(ids, dict(value.categories))
    copy = np.array(value, order="C", copy=True)
    copy.flags.writeable = False
    return copy
