"""Messages and services without a distribution package, wire-compatible with the generated classes.

Imported only where ROS 1 is installed. `_full_text` is the definition that ROS tools print. `_md5sum` must be its md5,
or other nodes refuse the connection; a test computes it with the tools of ROS.
"""

import struct
from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import Any, ClassVar

import genpy
from geometry_msgs.msg import TransformStamped

from vsnbench.ros_common.interface import OdometryFrames
from vsnbench.ros_common.messages import fill_transform

_FORMATS: Mapping[str, str] = {
    "bool": "?",
    "uint8": "B",
    "uint16": "H",
    "int64": "q",
    "float64": "d",
}
_DEFAULTS: Mapping[str, Any] = {"string": "", "bool": False, "uint8": 0, "uint16": 0, "int64": 0, "float64": 0.0}


class FlatMessage(genpy.Message):  # type: ignore[misc]  # ROS ships no types
    """A message of numbers and length-prefixed strings; fields in order, little-endian."""

    __slots__: Sequence[str] = ()
    _type = ""
    _md5sum = ""
    _has_header = False
    _full_text = ""
    _slot_types: ClassVar[list[str]] = []

    def __init__(self, *args: Any, **fields: Any) -> None:
        if args or fields:
            super().__init__(*args, **fields)
        for name, kind in zip(self.__slots__, self._slot_types, strict=True):
            if getattr(self, name, None) is None:
                setattr(self, name, _DEFAULTS[kind])

    def _get_types(self) -> list[str]:
        return self._slot_types

    def serialize(self, buff: BytesIO) -> None:
        """Write the message to `buff`.

        Raises:
            genpy.SerializationError: a field has the wrong type or is out of range.
        """
        for name, kind in zip(self.__slots__, self._slot_types, strict=True):
            value = getattr(self, name)
            try:
                if kind == "string":
                    data = value if isinstance(value, bytes) else value.encode()
                    buff.write(struct.pack("<I", len(data)) + data)
                else:
                    buff.write(struct.pack(f"<{_FORMATS[kind]}", value))
            except (struct.error, AttributeError) as error:
                raise genpy.SerializationError(f"{self._type}.{name}: {value!r} is not a {kind}") from error

    def deserialize(self, data: bytes) -> "FlatMessage":
        """Read the message from `data` and return it.

        Raises:
            genpy.DeserializationError: the data is too short.
        """
        offset = 0
        try:
            for name, kind in zip(self.__slots__, self._slot_types, strict=True):
                if kind == "string":
                    (length,) = struct.unpack_from("<I", data, offset)
                    offset += 4
                    if offset + length > len(data):
                        raise genpy.DeserializationError(
                            f"{self._type}.{name}: {length} bytes announced, fewer received"
                        )
                    setattr(self, name, data[offset : offset + length].decode("utf-8", "replace"))
                    offset += length
                else:
                    setattr(self, name, struct.unpack_from(f"<{_FORMATS[kind]}", data, offset)[0])
                    offset += _size(kind)
        except struct.error as error:
            raise genpy.DeserializationError(f"{self._type}: {error}") from error
        return self


def _size(kind: str) -> int:
    return struct.calcsize(f"<{_FORMATS[kind]}")


class DiscreteServerRequest(FlatMessage):
    """Request of discrete_move: `Forward`, `Backward`, `Left`, `Right` or `Stop`, and the degrees of a turn."""

    __slots__ = ("movement", "angle")
    _type = "discrete_move/DiscreteServerRequest"
    _md5sum = "8af93c4cd82a5abcfd21b06085ad7ac3"
    _full_text = "string movement\nint64 angle\n"
    _slot_types: ClassVar[list[str]] = ["string", "int64"]


class DiscreteServerResponse(FlatMessage):
    """Whether the movement succeeded."""

    __slots__ = ("response",)
    _type = "discrete_move/DiscreteServerResponse"
    _md5sum = "003b81baa95ab323fc1ddf3c7d0bee81"
    _full_text = "bool response\n"
    _slot_types: ClassVar[list[str]] = ["bool"]


class DiscreteServer:
    """The service of discrete_move (paper, Section 3.1.3): one synchronous movement per call."""

    _type = "discrete_move/DiscreteServer"
    _md5sum = "5b48aba823d191d65097ac88447ce907"
    _request_class = DiscreteServerRequest
    _response_class = DiscreteServerResponse


class PlaceRobotRequest(FlatMessage):
    """Pose of a simulated robot in its site, metres and radians, and the seed of its noise."""

    __slots__ = ("x", "y", "heading", "seed")
    _type = "vsnbench/PlaceRobotRequest"
    _md5sum = "6a35d4ed577d314d3842ed2f66a81a3f"
    _full_text = "float64 x\nfloat64 y\nfloat64 heading\nint64 seed\n"
    _slot_types: ClassVar[list[str]] = ["float64", "float64", "float64", "int64"]


class PlaceRobotResponse(FlatMessage):
    """Whether the robot was placed, and why not."""

    __slots__ = ("success", "message")
    _type = "vsnbench/PlaceRobotResponse"
    _md5sum = "937c9679a518e3a18d831e57125ea522"
    _full_text = "bool success\nstring message\n"
    _slot_types: ClassVar[list[str]] = ["bool", "string"]


class PlaceRobot:
    """The service that puts a simulated robot at a pose."""

    _type = "vsnbench/PlaceRobot"
    _md5sum = "1d487b9fcf4483bd914d7dfdaf64a34e"
    _request_class = PlaceRobotRequest
    _response_class = PlaceRobotResponse


class BumperEvent(FlatMessage):
    """Press or release of a bumper of a Kobuki."""

    __slots__ = ("bumper", "state")
    _type = "kobuki_msgs/BumperEvent"
    _md5sum = "ffe360cd50f14f9251d9844083e72ac5"
    _full_text = """uint8 LEFT=0
uint8 CENTER=1
uint8 RIGHT=2
uint8 RELEASED=0
uint8 PRESSED=1
uint8 bumper
uint8 state
"""
    _slot_types: ClassVar[list[str]] = ["uint8", "uint8"]
    LEFT, CENTER, RIGHT = 0, 1, 2
    RELEASED, PRESSED = 0, 1


class CliffEvent(FlatMessage):
    """Loss or return of the floor under a cliff sensor of a Kobuki."""

    __slots__ = ("sensor", "state", "bottom")
    _type = "kobuki_msgs/CliffEvent"
    _md5sum = "c5b106efbb1427a94f517c5e05f06295"
    _full_text = """uint8 LEFT=0
uint8 CENTER=1
uint8 RIGHT=2
uint8 FLOOR=0
uint8 CLIFF=1
uint8 sensor
uint8 state
uint16 bottom
"""
    _slot_types: ClassVar[list[str]] = ["uint8", "uint8", "uint16"]
    LEFT, CENTER, RIGHT = 0, 1, 2
    FLOOR, CLIFF = 0, 1


class WheelDropEvent(FlatMessage):
    """Drop or raise of a wheel of a Kobuki; wheels drop when the robot is lifted."""

    __slots__ = ("wheel", "state")
    _type = "kobuki_msgs/WheelDropEvent"
    _md5sum = "e102837d89384d67669a0df86b63f33b"
    _full_text = """uint8 LEFT=0
uint8 RIGHT=1
uint8 RAISED=0
uint8 DROPPED=1
uint8 wheel
uint8 state
"""
    _slot_types: ClassVar[list[str]] = ["uint8", "uint8"]
    LEFT, RIGHT = 0, 1
    RAISED, DROPPED = 0, 1


class TFMessage(genpy.Message):  # type: ignore[misc]  # ROS ships no types
    """Transforms between frames; Debian has the generated class in the separate package python3-tf2-msgs."""

    __slots__ = ("transforms",)
    _type = "tf2_msgs/TFMessage"
    _md5sum = "94810edda583a504dfda3829e70d7eec"
    _has_header = False
    _full_text = "geometry_msgs/TransformStamped[] transforms\n"
    _slot_types: ClassVar[list[str]] = ["geometry_msgs/TransformStamped[]"]

    def __init__(self, transforms: list[Any] | None = None) -> None:
        self.transforms = [] if transforms is None else transforms

    def _get_types(self) -> list[str]:
        return self._slot_types

    def serialize(self, buff: BytesIO) -> None:
        """Write the message to `buff`."""
        buff.write(struct.pack("<I", len(self.transforms)))
        for transform in self.transforms:
            transform.serialize(buff)

    def deserialize(self, data: bytes) -> "TFMessage":
        """Read the message from `data` and return it.

        Raises:
            genpy.DeserializationError: the data is too short.
        """
        try:
            (count,) = struct.unpack_from("<I", data)
            end, transforms = 4, []
            for _ in range(count):
                begin, end = end, _end_of_transform(data, end)
                transforms.append(TransformStamped().deserialize(data[begin:end]))
        except (struct.error, genpy.DeserializationError) as error:
            raise genpy.DeserializationError(f"{self._type}: {error}") from error
        self.transforms = transforms
        return self


def _end_of_transform(data: bytes, begin: int) -> int:
    """Return the end of a transform: counter and stamp, two length-prefixed names, seven float64."""
    end = begin + 12
    for _ in range(2):
        (length,) = struct.unpack_from("<I", data, end)
        end += 4 + length
    end += 7 * 8
    if end > len(data):
        raise struct.error(f"a transform ends at byte {end} of {len(data)}")
    return end


def tf_message(odometry: Any, frames: OdometryFrames) -> TFMessage:
    """Return a nav_msgs/Odometry as the transform between two frames."""
    transform = TransformStamped()
    fill_transform(transform, odometry, frames.odom_frame, frames.base_frame)
    return TFMessage([transform])
