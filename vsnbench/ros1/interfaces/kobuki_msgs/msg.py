"""Message types that `rostopic echo` imports by name."""

from vsnbench.ros1.battery import SensorState
from vsnbench.ros1.messages import BumperEvent, CliffEvent, WheelDropEvent

__all__ = ["BumperEvent", "CliffEvent", "SensorState", "WheelDropEvent"]
