"""Observation of a robot, and the part of it that a policy gets: the sensors on its card."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, TypeVar

import numpy as np
import numpy.typing as npt

from vsnbench.errors import SensorLostError, SensorNotDeclaredError
from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.pose import Pose

_Scalar = TypeVar("_Scalar", bound=np.generic)


MAX_HISTORY: Final = 50
"""Most observations in the history of another one: as many as a chunk has parts."""
MAX_PIXEL_BYTES: Final = 56 * 2**20
"""Most bytes of images that an observation has together with those of its history, which fit into one message of the
wire."""


class Sensor(StrEnum):
    """Kind of measurement that a policy can require and a robot can provide."""

    RGB = "rgb"
    DEPTH = "depth"
    ODOMETRY = "odometry"
    INSTANCES = "instances"
    """Per-pixel object instances, only in simulation; for the simulated detector."""


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
        ValueError: an array has the wrong shape or type.
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
        rgb, depth_m = getattr(self, "rgb", None), getattr(self, "depth_m", None)
        if rgb is not None and (rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8):
            raise ValueError(f"rgb must be (H, W, 3) uint8, not {rgb.shape} {rgb.dtype}")
        if depth_m is not None and (depth_m.ndim != 2 or depth_m.dtype != np.float32):
            raise ValueError(f"depth must be (H, W) float32, not {depth_m.shape} {depth_m.dtype}")

    @property
    def sensors(self) -> frozenset[Sensor]:
        """Sensors with a measurement."""
        return frozenset(sensor for sensor, name in FIELD_OF.items() if getattr(self, name, None) is not None)

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
            sensor = next((sensor for sensor, field_name in FIELD_OF.items() if field_name == name), None)
            if sensor is None:
                raise AttributeError(f"an observation has no {name!r}")
            raise SensorNotDeclaredError(
                f"observation.{name} is not available: {sensor.value} is not on the model's card",
                advice=f"add Sensor.{sensor.name} to the card's sensors",
            )


FIELD_OF: Final = MappingProxyType(
    {Sensor.RGB: "rgb", Sensor.DEPTH: "depth_m", Sensor.ODOMETRY: "pose", Sensor.INSTANCES: "instances"}
)
"""Field of an observation for each sensor."""


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
    measured: dict[str, Any] = {
        "depth_stamp_s": observation.depth_stamp_s if Sensor.DEPTH in sensors else None,
        "budget": budget,
    }
    if observation.history:
        measured["history"] = tuple(shown_to_policy(earlier, sensors, roles=roles) for earlier in observation.history)
    if further := sorted(roles - {CameraRole.FRONT}):
        if lost := [role for role in further if role not in observation.cameras]:
            raise SensorLostError(f"the model needs the {' and '.join(lost)} camera, which this observation lacks")
        measured["cameras"] = {role: shown_to_policy(observation.cameras[role], sensors) for role in further}
    if Sensor.RGB in sensors:
        measured["rgb"] = _private(observation.rgb)
    if Sensor.DEPTH in sensors and observation.depth_m is not None:
        measured["depth_m"] = _private(observation.depth_m)
        if observation.beyond_range is not None:
            measured["beyond_range"] = _private(observation.beyond_range)
    if Sensor.ODOMETRY in sensors:
        pose = observation.pose
        measured["pose"] = pose.wrapped
    if Sensor.INSTANCES in sensors and observation.instances is not None:
        labels = observation.instances
        ids = labels.ids.view()  # no copy: neither depth guard nor record uses the simulator's labels
        ids.flags.writeable = False
        measured["instances"] = InstanceImage(ids, dict(labels.categories))
    return observation_of(observation.stamp_s, observation.camera.model_copy(), **measured)


def observation_of(stamp_s: float, camera: Camera, **measured: Any) -> Observation:
    """Return an observation with some measurements; access to others raises SensorNotDeclaredError.

    Args:
        stamp_s: time of the image; seconds on the robot's clock.
        camera: camera of the robot.
        measured: values of other fields.

    Raises:
        ValueError: an array has the wrong shape or type.
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
        ValueError: an array has the wrong shape or type.
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
    left = MAX_PIXEL_BYTES - _pixel_bytes(observation)
    for earlier in reversed(history[-most:] if most else ()):
        left -= _pixel_bytes(earlier)
        if left < 0:
            break
        kept.append(earlier)
    return tuple(reversed(kept))


def _pixel_bytes(observation: Observation) -> int:
    arrays = (getattr(observation, FIELD_OF[sensor], None) for sensor in (Sensor.RGB, Sensor.DEPTH))
    own = sum(int(array.nbytes) for array in arrays if array is not None)
    return own + sum(map(_pixel_bytes, observation.cameras.values()))


def _private(array: npt.NDArray[_Scalar]) -> npt.NDArray[_Scalar]:
    copy = np.array(array, order="C", copy=True)
    copy.flags.writeable = False
    return copy
