"""Messages and services without a distribution package, wire-compatible with the generated classes.

`_full_text` is the definition that ROS tools print. `_md5sum` must be its md5, or other nodes refuse the connection; a
test computes it with the tools of ROS.
"""

import struct
from collections.abc import Sequence
from io import BytesIO
from typing import Any, ClassVar

import genpy
from geometry_msgs.msg import TransformStamped, Twist
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, CameraInfo, CompressedImage, Image, Imu
from std_msgs.msg import Bool, Header, String

from vsnbench.control.command import Command
from vsnbench.ros.common.interface import OdometryFrames
from vsnbench.ros.common.messages import fill_transform, fill_twist
from vsnbench.values.battery import Battery

_FORMATS = {"bool": "?", "int8": "b", "uint8": "B", "uint16": "H", "int64": "q", "float64": "d"}
_HEADER = "std_msgs/Header"
_STAMPED = {_HEADER: (Header, 1, 0), "geometry_msgs/TransformStamped": (TransformStamped, 2, 7 * 8)}
"""Messages that begin with a counter and a stamp: class, number of strings after them, number of bytes at the end."""
_OTHER_TYPES = "=" * 80
"""Line before the definitions of the types of the fields."""


class DefinedMessage(genpy.Message):  # type: ignore[misc]  # ROS ships no types
    """A message with the fields and constants of its definition in `_full_text`; little-endian.

    Its fields are numbers, strings, messages of _STAMPED, and lists of these.
    """

    __slots__: Sequence[str] = ()
    _type = ""
    _md5sum = ""
    _has_header = False
    _full_text = ""
    _slot_types: ClassVar[list[str]] = []

    def __init_subclass__(cls) -> None:
        fields = {}
        for line in cls._full_text.partition(_OTHER_TYPES)[0].splitlines():
            kind, _, rest = line.partition(" ")
            name, is_constant, value = rest.partition("=")
            # The tools of ROS read fields of the class.
            setattr(cls, name, int(value) if is_constant else None)
            if not is_constant:
                fields[name] = _HEADER if kind == "Header" else kind
        cls.__slots__, cls._slot_types = tuple(fields), list(fields.values())
        cls._has_header = _HEADER in cls._slot_types

    def __init__(self, *args: Any, **fields: Any) -> None:
        super().__init__(*args, **fields)
        for name, kind in zip(self.__slots__, self._slot_types, strict=True):
            if getattr(self, name) is None:
                setattr(self, name, _default(kind))

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
                _write(kind, value, buff)
            except (struct.error, AttributeError, TypeError) as error:
                raise genpy.SerializationError(f"{self._type}.{name}: {value!r} is not a {kind}") from error

    def deserialize(self, data: bytes) -> "DefinedMessage":
        """Read the message from `data` and return it.

        Raises:
            genpy.DeserializationError: the data is too short.
        """
        offset = 0
        for name, kind in zip(self.__slots__, self._slot_types, strict=True):
            try:
                value, offset = _read(kind, data, offset)
            except (struct.error, genpy.DeserializationError) as error:
                raise genpy.DeserializationError(f"{self._type}.{name}: {error}") from error
            setattr(self, name, value)
        return self


def _default(kind: str) -> Any:
    if kind in _STAMPED:
        return _STAMPED[kind][0]()
    return {"string": "", "bool": False, "float64": 0.0}.get(kind, [] if kind.endswith("[]") else 0)


def _write(kind: str, value: Any, buff: BytesIO) -> None:
    element = kind.removesuffix("[]")
    if kind == "string":
        data = value if isinstance(value, bytes) else value.encode()
        buff.write(struct.pack("<I", len(data)) + data)
    elif kind != element:
        buff.write(struct.pack("<I", len(value)))
        for part in value:
            _write(element, part, buff)
    elif kind in _FORMATS:
        buff.write(struct.pack(f"<{_FORMATS[kind]}", value))
    else:
        value.serialize(buff)


def _read(kind: str, data: bytes, offset: int) -> tuple[Any, int]:
    """Return the value at an offset, and the offset after it.

    Raises:
        struct.error: the data is too short.
        genpy.DeserializationError: the data is not of that type.
    """
    element = kind.removesuffix("[]")
    if kind == "string":
        end = _end_of_string(data, offset)
        return data[offset + 4 : end].decode("utf-8", "replace"), end
    if kind != element:
        (count,), end = struct.unpack_from("<I", data, offset), offset + 4
        values = []
        for _ in range(count):
            value, end = _read(element, data, end)
            values.append(value)
        return values, end
    if kind in _FORMATS:
        form = f"<{_FORMATS[kind]}"
        return struct.unpack_from(form, data, offset)[0], offset + struct.calcsize(form)
    message_class, strings, last_bytes = _STAMPED[kind]
    end = offset + 12
    for _ in range(strings):
        end = _end_of_string(data, end)
    end += last_bytes
    if end > len(data):
        raise struct.error(f"it ends at byte {end} of {len(data)}")
    return message_class().deserialize(data[offset:end]), end


def _end_of_string(data: bytes, offset: int) -> int:
    (length,) = struct.unpack_from("<I", data, offset)
    if offset + 4 + length > len(data):
        raise struct.error(f"{length} bytes announced, fewer received")
    return int(offset + 4 + length)


class DiscreteServerRequest(DefinedMessage):
    """Request of discrete_move: `Forward`, `Backward`, `Left`, `Right` or `Stop`, and the degrees of a turn."""

    _type = "discrete_move/DiscreteServerRequest"
    _md5sum = "8af93c4cd82a5abcfd21b06085ad7ac3"
    _full_text = "string movement\nint64 angle\n"


class DiscreteServerResponse(DefinedMessage):
    """Whether the movement succeeded."""

    _type = "discrete_move/DiscreteServerResponse"
    _md5sum = "003b81baa95ab323fc1ddf3c7d0bee81"
    _full_text = "bool response\n"


class DiscreteServer:
    """The service of discrete_move (paper, Section 3.1.3): one synchronous movement per call."""

    _type = "discrete_move/DiscreteServer"
    _md5sum = "5b48aba823d191d65097ac88447ce907"
    _request_class = DiscreteServerRequest
    _response_class = DiscreteServerResponse


class PlaceRobotRequest(DefinedMessage):
    """Pose of a simulated robot in its site, metres and radians, and the seed of its noise."""

    _type = "vsnbench/PlaceRobotRequest"
    _md5sum = "6a35d4ed577d314d3842ed2f66a81a3f"
    _full_text = "float64 x\nfloat64 y\nfloat64 heading\nint64 seed\n"


class PlaceRobotResponse(DefinedMessage):
    """Whether the robot was placed, and why not."""

    _type = "vsnbench/PlaceRobotResponse"
    _md5sum = "937c9679a518e3a18d831e57125ea522"
    _full_text = "bool success\nstring message\n"


class PlaceRobot:
    """The service that puts a simulated robot at a pose."""

    _type = "vsnbench/PlaceRobot"
    _md5sum = "1d487b9fcf4483bd914d7dfdaf64a34e"
    _request_class = PlaceRobotRequest
    _response_class = PlaceRobotResponse


class BumperEvent(DefinedMessage):
    """Press or release of a bumper of a Kobuki."""

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


class CliffEvent(DefinedMessage):
    """Loss or return of the floor under a cliff sensor of a Kobuki."""

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


class WheelDropEvent(DefinedMessage):
    """Drop or raise of a wheel of a Kobuki; wheels drop when the robot is lifted."""

    _type = "kobuki_msgs/WheelDropEvent"
    _md5sum = "e102837d89384d67669a0df86b63f33b"
    _full_text = """uint8 LEFT=0
uint8 RIGHT=1
uint8 RAISED=0
uint8 DROPPED=1
uint8 wheel
uint8 state
"""


class SensorState(DefinedMessage):
    """State of all sensors of a Kobuki, 50 Hz on mobile_base/sensors/core; `battery` is in 0.1 V."""

    _type = "kobuki_msgs/SensorState"
    _md5sum = "92e992cd3c66c18711c1ce707090fcc1"
    _full_text = f"""uint8 Button0=1
uint8 Button1=2
uint8 Button2=4
uint8 ADAPTER=16
uint8 DISCHARGING=0
uint8 CHARGED=2
uint8 CHARGING=6
Header header
uint16 time_stamp
uint8 bumper
uint8 wheel_drop
uint8 cliff
uint16 left_encoder
uint16 right_encoder
int8 left_pwm
int8 right_pwm
uint8 buttons
uint8 charger
uint8 battery
uint16[] bottom
uint8[] current
uint8 over_current
uint16 digital_input
uint16[] analog_input
{_OTHER_TYPES}
MSG: {_HEADER}
{Header._full_text}"""  # noqa: SLF001


class TFMessage(DefinedMessage):
    """Transforms between frames; Debian has the generated class in the separate package python3-tf2-msgs."""

    _type = "tf2_msgs/TFMessage"
    _md5sum = "94810edda583a504dfda3829e70d7eec"
    _full_text = "geometry_msgs/TransformStamped[] transforms\n"


_STANDARD = (BatteryState, Bool, CameraInfo, Clock, CompressedImage, Image, Imu, Odometry, String)
MESSAGE_CLASSES: dict[str, Any] = {
    message_class._type: message_class  # noqa: SLF001
    for message_class in (*_STANDARD, BumperEvent, CliffEvent, SensorState, TFMessage, WheelDropEvent)
}
"""Classes of the messages of topics by type."""


def tf_message(odometry: Any, frames: OdometryFrames) -> TFMessage:
    """Return a nav_msgs/Odometry as the transform between two frames."""
    transform = TransformStamped()
    fill_transform(transform, odometry, frames.odom_frame, frames.base_frame)
    return TFMessage([transform])


def twist_message(command: Command) -> Twist:
    """Return a velocity as geometry_msgs/Twist."""
    twist = Twist()
    fill_twist(twist, command)
    return twist


_FULL_V, _DANGEROUS_V, _DANGEROUS_SHARE = 16.5, 13.2, 0.05
"""Voltages at which the driver of a Kobuki takes it as full and nearly empty; linear in between
(yujinrobot/kobuki_core, kobuki_driver/src/driver/battery.cpp)."""


def battery_of_kobuki(message: Any) -> Battery | None:
    """Return the battery of a SensorState, its share computed from the voltage as in the driver of a Kobuki."""
    volts = message.battery / 10
    if not volts:
        return None  # not measured yet
    share = _DANGEROUS_SHARE + (1 - _DANGEROUS_SHARE) * (volts - _DANGEROUS_V) / (_FULL_V - _DANGEROUS_V)
    return Battery(min(max(share, 0.0), 1.0), volts)


def kobuki_tenths(share: float) -> int:
    """Return the value of `battery`, in 0.1 V, for a share."""
    volts = _DANGEROUS_V + (share - _DANGEROUS_SHARE) / (1 - _DANGEROUS_SHARE) * (_FULL_V - _DANGEROUS_V)
    return round(volts * 10)


def battery_message(kind: str, share: float, stamp: Any) -> Any:
    """Return the message of type `kind` for a discharging battery."""
    header = Header(stamp=stamp)
    if kind.startswith("kobuki"):
        return SensorState(header=header, battery=kobuki_tenths(share), charger=SensorState.DISCHARGING)
    status = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    return BatteryState(header=header, percentage=share, present=True, power_supply_status=status)


def battery_in(message: Any) -> Battery | None:
    """Return the battery in a SensorState or BatteryState; None where it was not measured."""
    if isinstance(message, SensorState):
        return battery_of_kobuki(message)
    return Battery.reported(message.percentage, message.voltage)
