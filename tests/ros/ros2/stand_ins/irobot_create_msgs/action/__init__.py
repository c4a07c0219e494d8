"""The maker's action by its name, with another type on the wire: that of `test_msgs`, which a wheel has.

The result's field is that of irobot_create_msgs 2 and 3: Undock.Result.is_docked; the goal is empty.
"""

from test_msgs.action import Fibonacci as Undock

Undock.Result.is_docked = property(lambda result: bool(result.sequence))
