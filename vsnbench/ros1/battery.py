"""Battery reports of a base: kobuki_msgs/SensorState or sensor_msgs/BatteryState.

Imported only where ROS 1 is installed.
"""

import struct
from collections.abc import Callable
from io import BytesIO
from typing import Any, ClassVar

import genpy
import rospy
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Header

from vsnbench.ros1.interface import Ros1Interface
from vsnbench.sensing.hazards import Hazard
from vsnbench.values.battery import Battery

_FULL_V, _DANGEROUS_V, _DANGEROUS_SHARE = 16.5, 13.2, 0.05
"""Voltages at which the driver of a Kobuki takes it as full and nearly empty; linear in between
(yujinrobot/kobuki_core, kobuki_driver/src/driver/battery.cpp)."""
_CORE = struct.Struct("<HBBBHHbbBBB")
_CORE_FIELDS = {
    "time_stamp": "uint16",
    "bumper": "uint8",
    "wheel_drop": "uint8",
    "cliff": "uint8",
    "left_encoder": "uint16",
    "right_encoder": "uint16",
    "left_pwm": "int8",
    "right_pwm": "int8",
    "buttons": "uint8",
    "charger": "uint8",
    "battery": "uint8",
}
_OTHER_FIELDS = {
    "bottom": "uint16[]",
    "current": "uint8[]",
    "over_current": "uint8",
    "digital_input": "uint16",
    "analog_input": "uint16[]",
}
_FORMATS = {"uint8": "B", "uint16": "H"}
_FIELDS = {"header": "std_msgs/Header"} | _CORE_FIELDS | _OTHER_FIELDS
_CONSTANTS = {"Button0": 1, "Button1": 2, "Button2": 4, "ADAPTER": 16, "DISCHARGING": 0, "CHARGED": 2, "CHARGING": 6}
DEFINITION = "".join(
    [
        *(f"uint8 {name}={value}\n" for name, value in _CONSTANTS.items()),
        *(f"{kind.removeprefix('std_msgs/')} {name}\n" for name, kind in _FIELDS.items()),
    ]
)


class SensorState(genpy.Message):  # type: ignore[misc]  # ROS ships no types
    """State of all sensors of a Kobuki, 50 Hz on mobile_base/sensors/core; `battery` is in 0.1 V."""

    __slots__ = tuple(_FIELDS)
    _type = "kobuki_msgs/SensorState"
    _md5sum = "92e992cd3c66c18711c1ce707090fcc1"
    _has_header = True
    _full_text = f"{DEFINITION}{'=' * 80}\nMSG: std_msgs/Header\n{Header._full_text}"  # noqa: SLF001
    _slot_types: ClassVar[list[str]] = list(_FIELDS.values())

    def __init__(self, **fields: Any) -> None:
        super().__init__(**fields)
        for name, kind in _FIELDS.items():
            if getattr(self, name, None) is None:
                setattr(self, name, Header() if name == "header" else () if kind.endswith("[]") else 0)

    def serialize(self, buff: BytesIO) -> None:
        """Write the message to `buff`.

        Raises:
            genpy.SerializationError: a field is out of range.
        """
        self.header.serialize(buff)
        try:
            buff.write(_CORE.pack(*(getattr(self, name) for name in _CORE_FIELDS)))
            for name, kind in _OTHER_FIELDS.items():
                value, form = getattr(self, name), _FORMATS[kind.removesuffix("[]")]
                listed = kind.endswith("[]")
                buff.write(struct.pack(f"<I{len(value)}{form}", len(value), *value) if listed else _packed(form, value))
        except (struct.error, TypeError) as error:
            raise genpy.SerializationError(f"{self._type}: {error}") from error

    def deserialize(self, data: bytes) -> "SensorState":
        """Read the message from `data` and return it.

        Raises:
            genpy.DeserializationError: the data is too short.
        """
        self.header.deserialize(data)
        try:
            (letters,) = struct.unpack_from("<I", data, 12)
            offset = 16 + letters
            for name, value in zip(_CORE_FIELDS, _CORE.unpack_from(data, offset), strict=True):
                setattr(self, name, value)
            offset += _CORE.size
            for name, kind in _OTHER_FIELDS.items():
                form, count = _FORMATS[kind.removesuffix("[]")], 1
                if kind.endswith("[]"):
                    (count,) = struct.unpack_from("<I", data, offset)
                    offset += 4
                    if offset + count > len(data):
                        raise genpy.DeserializationError(f"{self._type}.{name}: {count} announced, fewer received")
                values = struct.unpack_from(f"<{count}{form}", data, offset)
                offset += struct.calcsize(f"<{count}{form}")
                setattr(self, name, values if kind.endswith("[]") else values[0])
        except struct.error as error:
            raise genpy.DeserializationError(f"{self._type}: {error}") from error
        return self


def _packed(form: str, value: int) -> bytes:
    return struct.pack(f"<{form}", value)


def battery_of_kobuki(message: Any) -> Battery | None:
    """Return the battery of a SensorState, its share computed from the voltage as in the driver of a Kobuki."""
    volts = message.battery / 10
    if not volts:
        return None  # not measured yet
    share = _DANGEROUS_SHARE + (1 - _DANGEROUS_SHARE) * (volts - _DANGEROUS_V) / (_FULL_V - _DANGEROUS_V)
    return Battery(min(max(share, 0.0), 1.0), volts)


def active_hazards_of_kobuki(message: Any) -> list[Hazard]:
    """Return the hazards that a SensorState reports as active."""
    states = ((Hazard.BUMPER, message.bumper), (Hazard.CLIFF, message.cliff), (Hazard.WHEEL_DROP, message.wheel_drop))
    return [hazard for hazard, bits in states if bits]


def kobuki_tenths(share: float) -> int:
    """Return the value of `battery`, in 0.1 V, for a share."""
    volts = _DANGEROUS_V + (share - _DANGEROUS_SHARE) / (1 - _DANGEROUS_SHARE) * (_FULL_V - _DANGEROUS_V)
    return round(volts * 10)


def battery_message(kind: str, share: float, stamp: Any) -> Any:
    """Return the message of type `kind` for a discharging battery."""
    header = Header(stamp=stamp)
    if kind.startswith("kobuki"):
        return SensorState(header=header, battery=kobuki_tenths(share), charger=_CONSTANTS["DISCHARGING"])
    status = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    return BatteryState(header=header, percentage=share, present=True, power_supply_status=status)


BATTERY_CLASSES: dict[str, Any] = {"kobuki_msgs/SensorState": SensorState, "sensor_msgs/BatteryState": BatteryState}
"""Message classes by `battery_type`."""


def battery_in(message: Any) -> Battery | None:
    """Return the battery in a message of BATTERY_CLASSES; None where it was not measured."""
    if isinstance(message, SensorState):
        return battery_of_kobuki(message)
    return Battery.reported(message.percentage, message.voltage)


def subscribe_battery(names: Ros1Interface, take: Callable[[Battery | None], None]) -> None:
    """Pass every battery report of a base to `take`."""
    if names.battery:
        kind = BATTERY_CLASSES[names.battery_type]
        rospy.Subscriber(names.battery, kind, lambda message: take(battery_in(message)), queue_size=1)
