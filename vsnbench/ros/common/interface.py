"""Fields that the interface of a robot profile has over ROS 1 and over ROS 2."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from vsnbench.errors import RobotError
from vsnbench.ros.common.hazard_topics import HazardTopic
from vsnbench.values.camera import CameraRole
from vsnbench.values.robot_profile import Interface, RobotProfile

_TOPIC = r"^/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*$"
FrameId = Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_./-]*$", max_length=100)]
"""Name of a TF frame, without a leading slash."""


TF_MESSAGE = "tf2_msgs/TFMessage"
"""Type of the messages of TF."""


class OdometryFrames(BaseModel):
    """TF frames whose transform is the odometry of a base."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    odom_frame: FrameId = "odom"
    base_frame: FrameId = "base_link"
    topic: str = Field(
        default="/tf",
        pattern=_TOPIC,
        description="topic of the moving links; the topic of the fixed links has _static appended",
    )

    @property
    def static_topic(self) -> str:
        """Topic of the fixed links."""
        return f"{self.topic}_static"

    @model_validator(mode="after")
    def _two_frames(self) -> Self:
        if self.odom_frame == self.base_frame:
            raise ValueError(f"odom_frame and base_frame are both {self.base_frame}: name two frames")
        return self


class AttitudeSource(BaseModel):
    """Topic that has roll and pitch of the base, which move its camera."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    topic: str = Field(
        pattern=_TOPIC,
        description="the topic of the odometry or of TF, whose orientation has them, or one of sensor_msgs/Imu",
    )
    frame: FrameId = Field(default="base_link", description="frame of the IMU; its axes must be those of the base")


class CameraTopics(BaseModel):
    """Topics of a further camera; an empty name means that it does not have the part."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    color: str = Field(pattern=_TOPIC)
    color_info: str = Field(default="", pattern=f"{_TOPIC}|^$")
    depth: str = Field(default="", pattern=f"{_TOPIC}|^$")
    depth_info: str = Field(default="", pattern=f"{_TOPIC}|^$")

    def resolved(self, resolve: Callable[[str], str]) -> Self:
        """Return the topics with full names."""
        return self.model_copy(update={part: resolve(getattr(self, part)) for part in type(self).model_fields})


class RosInterface(Interface):
    """Topics of a robot over ROS; an empty name means that the robot does not have the part.

    The odometry comes from exactly one source: a topic, or TF.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    title: ClassVar[str]
    """Description for lists of robots."""
    contact_fields: ClassVar[tuple[str, ...]]
    """Fields that name a topic with contacts."""
    hazard_fields: ClassVar[Mapping[str, str]]
    """Fields that name a topic of hazard sensors, and the type of its messages; empty if FIELD_type has the type."""
    distinct_fields: ClassVar[tuple[str, ...]]
    """Fields whose topics must differ."""

    if TYPE_CHECKING:  # subclasses define these fields, because names and defaults differ
        command: str
        odometry: str
        color: str
        color_info: str
        depth: str
        depth_info: str
        bumper: str
        battery: str
        discrete_move: str
        command_timeout_s: float
    camera_rate_hz: float = Field(default=30.0, gt=0, le=240)
    depth_frames: int = Field(
        default=10, ge=1, le=100, description="number of depth images per median (paper, vsn.yaml)"
    )
    tf: OdometryFrames | None = Field(
        default=None, description="TF frames of the odometry, for a base without an odometry topic"
    )
    attitude: AttitudeSource | None = Field(
        default=None, description="source of the base's roll and pitch; none for a base that stays level"
    )
    cameras: Mapping[CameraRole, CameraTopics] = Field(
        default_factory=dict, description="topics of the profile's further cameras, by role"
    )

    @property
    def odometry_topic(self) -> str:
        """Topic of the odometry, or of TF."""
        return self.odometry if self.tf is None else self.tf.topic

    @property
    def odometry_type(self) -> str:
        """Type of the messages on `odometry_topic`, such as `nav_msgs/Odometry`."""
        return "nav_msgs/Odometry" if self.tf is None else TF_MESSAGE

    @property
    def camera_topics(self) -> dict[CameraRole, CameraTopics]:
        """Topics of every camera by role; those of the main one are `color`, `depth` and their calibrations."""
        main = {part: getattr(self, part) for part in CameraTopics.model_fields}
        return {CameraRole.FRONT: CameraTopics.model_construct(**main), **self.cameras}

    @property
    def further_images(self) -> list[str]:
        """Topics of colour and depth of the further cameras."""
        return [topic for topics in self.cameras.values() for topic in (topics.color, topics.depth) if topic]

    @property
    def further_infos(self) -> list[str]:
        """Topics of their calibrations."""
        return [topic for topics in self.cameras.values() for topic in (topics.color_info, topics.depth_info) if topic]

    @property
    def imu(self) -> str:
        """Topic of the sensor_msgs/Imu that has the attitude; empty if the odometry has it, or nothing."""
        return "" if self.attitude is None or self.attitude.topic == self.odometry_topic else self.attitude.topic

    @property
    def paths(self) -> str:
        """Topic of the orders of `sensing.path_orders` to the node of discrete_move; `_state` appended, its state."""
        return f"{self.discrete_move}/paths"

    @property
    def hazard_topics(self) -> tuple[HazardTopic, ...]:
        """Topics of the hazard sensors that the base has."""
        return tuple(
            HazardTopic(field, topic, self.type_name(kind or getattr(self, f"{field}_type")))
            for field, kind in self.hazard_fields.items()
            if (topic := getattr(self, field))
        )

    def type_name(self, kind: str) -> str:
        """Return the name that the middleware has for a type such as `sensor_msgs/Image`."""
        return kind

    def simulation_topic(self, topic: str) -> str:
        """Return the full name of a topic of `sensing.simulation` for this robot."""
        return topic

    def resolved(self) -> Self:
        """Return the interface with full names."""
        return self

    @model_validator(mode="before")
    @classmethod
    def _one_source(cls, content: Any) -> Any:
        """Leave the odometry topic empty where TF frames replace it.

        Raises:
            ValueError: the profile has both sources or neither.
        """
        if not isinstance(content, Mapping):
            return content
        if content.get("tf") is None:
            if content.get("odometry", "default") == "":
                raise ValueError("it has no odometry: name the topic in `odometry`, or the frames in `tf`")
            return content
        if content.get("odometry"):
            raise ValueError(f"it has both `odometry` {content['odometry']} and `tf`: keep one of them")
        return {**content, "odometry": ""}

    @model_serializer(mode="wrap")
    def _without_absent_frames(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out what is not used, so that the hashes of older profiles stay the same."""
        content: dict[str, Any] = serialize(self)
        for name in ("tf", "attitude", "cameras"):
            if not content.get(name):
                content.pop(name, None)
        return content


SHARED_TOPICS = ("command", "odometry", "color", "depth", "bumper")
"""Fields whose topics must differ over ROS 1 and ROS 2."""
AnyInterface = TypeVar("AnyInterface", bound=RosInterface)


def require_interface(profile: RobotProfile, kind: str, wanted: type[AnyInterface], example: str) -> AnyInterface:
    """Return the interface of a profile with full names.

    Args:
        profile: the profile of the robot.
        kind: value of `interface.kind` for this class.
        wanted: class of the interface.
        example: name of a packaged profile that has such an interface.

    Raises:
        RobotError: the profile has another interface or none.
    """
    if isinstance(profile.interface, wanted):
        return profile.interface.resolved()
    raise RobotError(
        f"robot profile {profile.name} has {profile.interface.kind if profile.interface else 'no'} interface",
        advice=f"use a profile with an interface of `kind: {kind}` (vsnbench robots show {example})",
        code="wrong-interface",
    )
