"""What a robot asks of its network, whichever ROS that is."""

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from vsnbench.errors import RobotError
from vsnbench.protocol.pose import Pose
from vsnbench.sensing.robot_reports import RobotSnapshot

Found = TypeVar("Found")


class RobotTopics(Protocol):
    """What a robot reads of its interface."""

    @property
    def odometry(self) -> str:
        """Topic of the odometry; likewise the others, empty for what the robot does not have."""
        ...

    @property
    def color(self) -> str: ...  # noqa: D102

    @property
    def depth(self) -> str: ...  # noqa: D102

    @property
    def discrete_move(self) -> str:
        """The name of what carries out movements."""
        ...

    @property
    def camera_rate_hz(self) -> float: ...  # noqa: D102

    @property
    def depth_frames(self) -> int:
        """Depth images of one median."""
        ...


class RobotLink(Protocol):
    """Everything that a robot hears from its network and can ask of it; one a process, fed by threads of its own."""

    kind: str
    """`ros1` or `ros2`: the kind of the robot's identity."""
    image_turns: int
    """Quarter turns clockwise that set an image upright."""
    tells_of_lifting: bool
    """Whether the base has a topic on which it says that its wheels hang in the air."""
    names: Any
    """The interface of the profile, with names as the network has them; see RobotTopics."""

    def snapshot(self) -> RobotSnapshot:
        """Return what has been reported until now."""
        ...

    def wait_for(self, condition: Callable[[RobotSnapshot], Found], timeout_s: float) -> Found:
        """Ask `condition` of every snapshot until it answers with something true; returns its last answer."""
        ...

    def image(self, payload: Any) -> Any:
        """Return an image of a snapshot as a message that `sensing.camera_images` reads."""
        ...

    def missing_part(self, warned: set[str]) -> RobotError | None:
        """Return the first part that does not answer and what to do about it; None when all do.

        What is only worth a warning is said, once for each text in `warned`.

        Raises:
            RobotError: no patience heals what is wrong.
        """
        ...

    @property
    def server(self) -> str:
        """Whose discrete_move carries out the movements: `vsnbench`, `another`, or `workstation` for this process."""
        ...

    @property
    def can_be_placed(self) -> bool:
        """Whether the robot is a simulated one that can be put where it should start."""
        ...

    @property
    def has_labels(self) -> bool:
        """Whether the robot is a simulated one that labels what its camera sees."""
        ...

    @property
    def now_s(self) -> float:
        """The time that motions are measured in: monotonic, or simulated where the network's time is."""
        ...

    @property
    def reports_outcomes(self) -> bool:
        """Whether a movement's outcome comes with more than its answer."""
        ...

    @property
    def holding(self) -> bool:
        """Whether the base is held still against others."""
        ...

    def join_simulation(self) -> None:
        """Listen to what only a simulated robot reports."""
        ...

    def stand_still(self) -> None:
        """Command zero velocity."""
        ...

    def hold_still(self) -> None:
        """Command zero velocity, and answer every velocity that somebody else commands with zero at once."""
        ...

    def release(self) -> None:
        """Let others steer again."""
        ...

    def move(self, movement: str, angle_deg: int, timeout_s: float, watch: Callable[[], None] | None = None) -> bool:
        """Have one movement carried out and return its answer; `watch` may raise to end it.

        Raises:
            NoAnswerError: none came in time.
        """
        ...

    def place(self, pose: Pose, seed: int, timeout_s: float) -> str:
        """Put a simulated robot down; returns why it cannot stand there, empty when it does."""
        ...

    def begin_episode(self, timeout_s: float) -> None:
        """Tell whoever carries out movements that an episode starts here."""
        ...

    def clear_events(self) -> None:
        """Forget what has happened; what is pressed stays known."""
        ...

    def close(self) -> None:
        """Leave the network."""
        ...
