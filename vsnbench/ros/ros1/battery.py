"""Battery reports of a base: kobuki_msgs/SensorState or sensor_msgs/BatteryState."""

from collections.abc import Callable
from typing import Any

import rospy
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Header

from vsnbench.ros.ros1.interface import Ros1Interface
from vsnbench.ros.ros1.messages import MESSAGE_CLASSES, SensorState
from vsnbench.values.battery import Battery

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


def subscribe_battery(names: Ros1Interface, take: Callable[[Battery | None], None]) -> None:
    """Pass every battery report of a base to `take`."""
    if names.battery:
        kind = MESSAGE_CLASSES[names.battery_type]
        rospy.Subscriber(names.battery, kind, lambda message: take(battery_in(message)), queue_size=1)
