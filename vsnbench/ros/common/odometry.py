"""Odometry and attitude of a base from nav_msgs/Odometry or from TF; the attitude also from an IMU."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from vsnbench.ros.common.interface import RosInterface
from vsnbench.ros.common.messages import planar
from vsnbench.sensing.odometry.attitude import AttitudeReader
from vsnbench.sensing.odometry.transform_chain import Link, Quaternion, TransformChain, frame_of
from vsnbench.values.pose import Attitude

Sender = TypeVar("Sender")
TakeOdometry = Callable[[tuple[float, float, float], float, Sender], None]
"""Takes x and y in metres and heading in radians, the stamp in seconds, and the sender."""
TakeAttitude = Callable[[Attitude | str, float], None]
"""Takes an attitude, or why a message has none, and the stamp in seconds."""


class OdometryReader(ABC, Generic[Sender]):
    """Reads poses from the messages of a base; subclasses subscribe to the topics of its interface.

    Args:
        names: the interface.
        take: takes the poses.
        take_attitude: takes the attitudes or why a message has none, if the interface has their source.
    """

    def __init__(
        self, names: RosInterface, take: TakeOdometry[Sender], take_attitude: TakeAttitude | None = None
    ) -> None:
        self._take = take
        self._take_attitude = take_attitude
        source = names.attitude if take_attitude is not None else None
        self._attitudes = None if source is None else AttitudeReader(source.topic, source.frame)
        self.imu = "" if source is None else names.imu
        self._chain = None if names.tf is None else TransformChain(names.tf.odom_frame, names.tf.base_frame)

    @property
    def fault(self) -> str:
        """Why TF gives no odometry, or an empty string."""
        return "" if self._chain is None else self._chain.fault()

    @abstractmethod
    def _seconds(self, stamp: Any) -> float:
        """Return the stamp of a message in seconds."""

    def take_odometry(self, message: Any, sender: Sender) -> None:
        """Take a nav_msgs/Odometry."""
        stamp_s = self._seconds(message.header.stamp)
        turn = message.pose.pose.orientation
        self._pass_attitude((turn.x, turn.y, turn.z, turn.w), stamp_s)
        self._take(planar(message), stamp_s, sender)

    def take_moving_links(self, message: Any, sender: Sender) -> None:
        """Take a tf2_msgs/TFMessage of moving links."""
        pose = self._chain.add(self._links(message), fixed=False) if self._chain is not None else None
        if pose is not None:
            self._pass_attitude(pose.rotation, pose.stamp_s)
            self._take((pose.x_m, pose.y_m, pose.heading_rad), pose.stamp_s, sender)

    def take_fixed_links(self, message: Any) -> None:
        """Take a tf2_msgs/TFMessage of fixed links."""
        if self._chain is not None:
            self._chain.add(self._links(message), fixed=True)

    def take_imu(self, message: Any) -> None:
        """Take a sensor_msgs/Imu."""
        if self._attitudes is None or self._take_attitude is None:
            return
        stamp_s = self._seconds(message.header.stamp)
        self._take_attitude(attitude_of_imu(self._attitudes, message, stamp_s), stamp_s)

    def _pass_attitude(self, rotation: Quaternion, stamp_s: float) -> None:
        """Pass on the attitude of the odometry, unless it is that of an IMU."""
        if self._attitudes is not None and self._take_attitude is not None and not self.imu:
            self._take_attitude(self._attitudes.read(rotation), stamp_s)

    def _links(self, message: Any) -> list[Link]:
        return [self._link(transform) for transform in message.transforms]

    def _link(self, transform: Any) -> Link:
        header, shift, turn = transform.header, transform.transform.translation, transform.transform.rotation
        return Link(
            frame_of(header.frame_id),
            frame_of(transform.child_frame_id),
            self._seconds(header.stamp),
            (shift.x, shift.y, shift.z),
            (turn.x, turn.y, turn.z, turn.w),
        )


def attitude_of_imu(reader: AttitudeReader, message: Any, stamp_s: float) -> Attitude | str:
    """Return the attitude in a sensor_msgs/Imu, or why it has none."""
    turn, force = message.orientation, message.linear_acceleration
    return reader.read_imu(
        (turn.x, turn.y, turn.z, turn.w),
        (force.x, force.y, force.z),
        stamp_s,
        frame_of(message.header.frame_id),
        has_orientation=message.orientation_covariance[0] != -1,
    )
