"""Message types that `rostopic echo` imports by name."""

from vsnbench.ros.ros1.messages import BumperEvent, CliffEvent, SensorState, WheelDropEvent

__all__ = ["BumperEvent", "CliffEvent", "SensorState", "WheelDropEvent"]
