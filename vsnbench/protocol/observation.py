"""What a robot senses before each action, and what of it a policy is shown: the sensors on its card, nothing else."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, TypeVar

import numpy as np
import numpy.typing as npt

from vsnbench.errors import SensorLostError, SensorNotDeclaredError
from vsnbench.protocol.camera import Camera
from vsnbench.protocol.pose import Pose

_Scalar = TypeVar("_Scalar", bound=np.generic)


class Sensor(StrEnum):
    """A kind of measurement that a policy can need and a robot can offer."""

    RGB = "rgb"
    DEPTH = "depth"
    ODOMETRY = "odometry"
    INSTANCES = "instances"
    """Per-pixel object instances: only a simulator has them; for the simulated detector."""


@dataclass(frozen=True, slots=True, eq=False)
class InstanceImage:
    """The simulator's own labels: which object each pixel shows."""

    ids: npt.NDArray[np.int32]
    """(H, W); 0 is nothing of interest, k > 0 the k-th object of the site."""
    categories: Mapping[int, str]
    """The category of each id that can occur."""


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """One look at the world.

    A robot's own has everything that the robot has. A policy is handed what `shown_to_policy` makes of it: private
    copies, in which reading a sensor that is not on the policy's card raises SensorNotDeclaredError.

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
    """When the image was taken; seconds on the robot's clock."""
    camera: Camera
    instances: InstanceImage | None = None
    depth_stamp_s: float | None = None
    """When the depth image was taken, where the two are not synchronised."""
    sensing: Mapping[str, float] = field(default_factory=dict)
    """How the look came about (frames filtered, seconds waited and computed, skew), for the record."""

    def __post_init__(self) -> None:
        rgb, depth_m = getattr(self, "rgb", None), getattr(self, "depth_m", None)
        if rgb is not None and (rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8):
            raise ValueError(f"rgb must be (H, W, 3) uint8, not {rgb.shape} {rgb.dtype}")
        if depth_m is not None and (depth_m.ndim != 2 or depth_m.dtype != np.float32):
            raise ValueError(f"depth must be (H, W) float32, not {depth_m.shape} {depth_m.dtype}")

    @property
    def sensors(self) -> frozenset[Sensor]:
        """The sensors of which there is a measurement here."""
        return frozenset(sensor for sensor, name in FIELD_OF.items() if getattr(self, name, None) is not None)

    def __repr__(self) -> str:
        """Return a line, not the pixels."""
        return f"Observation({', '.join(sorted(self.sensors)) or 'nothing'} at {self.stamp_s:.3f} s)"

    # What is not shown has no value in its slot: pickling carries what there is, and reading the rest says why.

    def __getstate__(self) -> dict[str, Any]:
        state: dict[str, Any] = {}
        for each in fields(self):
            try:
                state[each.name] = getattr(self, each.name)
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
                f"observation.{name} is not shown to this model, because its card does not name {sensor.value}: add "
                f"Sensor.{sensor.name} to the card's sensors"
            )


FIELD_OF: Final = MappingProxyType(
    {Sensor.RGB: "rgb", Sensor.DEPTH: "depth_m", Sensor.ODOMETRY: "pose", Sensor.INSTANCES: "instances"}
)
"""Where in an observation each sensor's measurement lies."""


def shown_to_policy(observation: Observation, sensors: frozenset[Sensor]) -> Observation:
    """Return what a policy with these sensors on its card may see: copies that share nothing with the robot's own.

    Whatever the policy, or a thread of its, does with them changes neither what the depth guard looks at nor what is
    recorded. The arrays are read-only, so that a slip is noticed.

    Raises:
        SensorLostError: there is no measurement of one of the sensors.
    """
    if missing := sensors - observation.sensors:
        raise SensorLostError(f"no {' and no '.join(sorted(missing))} in this observation, and the model needs it")
    measured: dict[str, Any] = {"depth_stamp_s": observation.depth_stamp_s if Sensor.DEPTH in sensors else None}
    if Sensor.RGB in sensors:
        measured["rgb"] = _private(observation.rgb)
    if Sensor.DEPTH in sensors and observation.depth_m is not None:
        measured["depth_m"] = _private(observation.depth_m)
    if Sensor.ODOMETRY in sensors:
        pose = observation.pose
        measured["pose"] = Pose(pose.x_m, pose.y_m, pose.heading_rad)
    if Sensor.INSTANCES in sensors and observation.instances is not None:
        labels = observation.instances
        ids = labels.ids.view()  # no copy: neither guard nor record looks at the simulator's labels
        ids.flags.writeable = False
        measured["instances"] = InstanceImage(ids, dict(labels.categories))
    return observation_of(observation.stamp_s, observation.camera.model_copy(), **measured)


def observation_of(stamp_s: float, camera: Camera, **measured: Any) -> Observation:
    """Return an observation with some of a robot's measurements; reading another says that it is not shown.

    Args:
        stamp_s: when the image was taken; seconds on the robot's clock.
        camera: the robot's.
        measured: what there is of an observation's other fields.

    Raises:
        ValueError: an array has the wrong shape or type.
    """
    made = object.__new__(Observation)
    for name, value in {"depth_stamp_s": None, "sensing": {}, "stamp_s": stamp_s, "camera": camera, **measured}.items():
        object.__setattr__(made, name, value)
    made.__post_init__()
    return made


def _private(array: npt.NDArray[_Scalar]) -> npt.NDArray[_Scalar]:
    copy = np.array(array, order="C", copy=True)
    copy.flags.writeable = False
    return copy
