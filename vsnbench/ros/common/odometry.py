"""Odometry of a base from nav_msgs/Odometry or from TF."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from vsnbench.ros.common.interface import RosInterface
from vsnbench.ros.common.messages import planar
from vsnbench.sensing.odometry.transform_chain import Link, TransformChain, frame_of

Sender = TypeVar("Sender")
TakeOdometry = Callable[[tuple[float, float, float], float, Sender], None]
"""Takes x and y in metres and heading in radians, the stamp in seconds, and the sender."""


class OdometryReader(ABC, Generic[Sender]):
    """Reads poses from the messages of a base; subclasses subscribe to the topics of its interface."""

    def __init__(self, names: RosInterface, take: TakeOdometry[Sender]) -> None:
        self._take = take
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
        self._take(planar(message), self._seconds(message.header.stamp), sender)

    def take_moving_links(self, message: Any, sender: Sender) -> None:
        """Take a tf2_msgs/TFMessage of moving links."""
        pose = self._chain.add(self._links(message), fixed=False) if self._chain is not None else None
        if pose is not None:
            self._take((pose.x_m, pose.y_m, pose.heading_rad), pose.stamp_s, sender)

    def take_fixed_links(self, message: Any) -> None:
        """Take a tf2_msgs/TFMessage of fixed links."""
        if self._chain is not None:
            self._chain.add(self._links(message), fixed=True)

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
