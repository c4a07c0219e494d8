"""A robot with another vendor's DDS and an independent serializer, without rclpy.

It publishes only odometry and images, and drives with the velocities that it receives.
"""

import math
import os
import sys
import time
from typing import Any

import numpy as np
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
kinds = store.types
SENSOR_DATA = Qos(
    Policy.Reliability.BestEffort,
    Policy.History.KeepLast(10),
    Policy.DataRepresentation(use_cdrv0_representation=True),
)
PLAIN = {
    "string": str,
    "int32": types.int32,
    "uint32": types.uint32,
    "uint8": types.uint8,
    "float64": types.float64,
}
made: dict[str, type] = {}


def idl_type(field: tuple) -> object:
    """Return cyclonedds' type of a field of rosbags' type store."""
    shape, detail = field
    if shape == Nodetype.BASE:
        return PLAIN[detail[0]]
    if shape == Nodetype.NAME:
        return kind_on_the_wire(detail)
    inner, count = detail
    return types.array[idl_type(inner), count] if shape == Nodetype.ARRAY else types.sequence[idl_type(inner)]


def kind_on_the_wire(name: str) -> type:
    """Return a type of cyclonedds that has the name of a ROS message there."""
    if name not in made:
        package, _, word = name.split("/")
        fields = {field: idl_type(kind) for field, kind in store.fielddefs[name][1]}
        made[name] = make_idl_struct(word, f"{package}.msg.dds_.{word}_", fields)
    return made[name]


def by_rosbags(name: str) -> type:
    """Return the same type with rosbags' serializer: cyclonedds' own takes 40 ms of Python for an image."""
    kind = kind_on_the_wire(name)
    kind.serialize = lambda self, *_args, **_kwargs: bytes(store.serialize_cdr(self.message, name))

    def deserialize(_kind: type, data: bytes, *_args: object, **_kwargs: object) -> object:
        return wrapped(kind, store.deserialize_cdr(bytes(data), name))

    kind.deserialize = classmethod(deserialize)
    return kind


def wrapped(kind: type, message: object) -> Any:
    carrier = object.__new__(kind)
    carrier.message = message
    return carrier


class Writer:
    def __init__(self, topic: str, name: str) -> None:
        self.kind = by_rosbags(name)
        self.writer = DataWriter(participant, Topic(participant, f"rt/{topic}", self.kind), qos=SENSOR_DATA)

    def __call__(self, message: object) -> None:
        self.writer.write(wrapped(self.kind, message))


def header(stamp_s: float) -> object:
    nanoseconds = round(stamp_s * 1e9)
    stamp = kinds["builtin_interfaces/msg/Time"](sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
    return kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="odom")


def odometry(x_m: float, y_m: float, heading_rad: float, stamp_s: float) -> object:
    point = kinds["geometry_msgs/msg/Point"](x=x_m, y=y_m, z=0.0)
    turn = kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=math.sin(heading_rad / 2), w=math.cos(heading_rad / 2))
    still = kinds["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
    pose = kinds["geometry_msgs/msg/Pose"](position=point, orientation=turn)
    return kinds["nav_msgs/msg/Odometry"](
        header=header(stamp_s),
        child_frame_id="base_link",
        pose=kinds["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36)),
        twist=kinds["geometry_msgs/msg/TwistWithCovariance"](
            twist=kinds["geometry_msgs/msg/Twist"](linear=still, angular=still), covariance=np.zeros(36)
        ),
    )


def image(pixels: np.ndarray, encoding: str, stamp_s: float) -> object:
    return kinds["sensor_msgs/msg/Image"](
        header=header(stamp_s),
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=pixels[0].nbytes,
        data=np.frombuffer(pixels.tobytes(), np.uint8),
    )


participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
odom = Writer("odom", "nav_msgs/msg/Odometry")
color = Writer("camera/color/image_raw", "sensor_msgs/msg/Image")
depth = Writer("camera/depth/image_raw", "sensor_msgs/msg/Image")
twist_kind = by_rosbags("geometry_msgs/msg/Twist")
commands = DataReader(participant, Topic(participant, "rt/cmd_vel", twist_kind), qos=SENSOR_DATA)
assert "rclpy" not in sys.modules
sys.stdout.write("up\n")
sys.stdout.flush()
rng = np.random.default_rng(0)
x_m = y_m = heading_rad = linear = angular = 0.0
last = odometry_due = camera_due = time.monotonic()
while True:
    time.sleep(0.005)
    for heard in commands.take(50):
        if isinstance(heard, twist_kind):  # the others report that a writer has gone
            linear, angular = heard.message.linear.x, heard.message.angular.z
    now = time.monotonic()
    elapsed, last = now - last, now
    middle = heading_rad + angular * elapsed / 2
    x_m, y_m = x_m + linear * elapsed * math.cos(middle), y_m + linear * elapsed * math.sin(middle)
    heading_rad += angular * elapsed
    if now >= odometry_due:
        odometry_due = now + 0.02
        odom(odometry(x_m, y_m, heading_rad, time.time()))
    if now >= camera_due:
        camera_due = now + 1 / 15
        color(image(rng.integers(88, 93, (48, 64, 3), np.uint8), "rgb8", time.time()))
        depth(image(rng.integers(1999, 2002, (48, 64), np.uint16), "16UC1", time.time()))
