"""Ends an episode whose depth camera stays blind, is frozen or measures out of range."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.errors import SensorLostError
from vsnbench.protocol.parameters import DepthGuard
from vsnbench.runner.episode.depth_guard import GuardReading, Refusal, evidence_in
from vsnbench.sensing.images.depth_range import WRONG_UNIT, range_fault
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.observation import Observation
from vsnbench.values.robot_identity import RobotIdentity

MAX_BLIND_REFUSALS = 3
"""Forward moves refused as blind, without a look in between that saw the path, after which the camera is lost."""
_MOVED_M, _MOVED_RAD = 0.05, math.radians(5)
"""A camera that moved by this much must see another image."""
_NEAR_M = 0.5
"""An object within this distance of the camera's minimum range may be nearer than it after the next movement."""
_BLIND_TURN_RAD = math.pi
"""A near obstacle does not surround the robot: after this turn it no longer explains blindness."""
_FEW = 0.1
"""With a smaller share of valid pixels, the image is checked for a wrong unit."""
_SAMPLES = 64
"""Sampled pixels per row."""


@dataclass(frozen=True, slots=True, eq=False)
class _Frame:
    """Raw depth of one look, for comparison with the next."""

    depth_m: npt.NDArray[np.float32]
    digest: bytes | None

    def equals(self, other: "_Frame") -> bool:
        """Whether both are identical, bit for bit."""
        if self.digest is not None and other.digest is not None:
            return self.digest == other.digest
        mine, others = (np.ascontiguousarray(observation.depth_m).view(np.uint32) for observation in (self, other))
        return mine.shape == others.shape and bool((mine[::32] == others[::32]).all()) and bool((mine == others).all())


class DepthWatch:
    """Compares the depth images of one episode with each other and with the robot's movements.

    Does nothing for a robot without depth images, or with the guard off. `free_ahead_m` returns the distance straight
    ahead from the start to the site's first wall or object; it is used if the robot sees nothing there.
    """

    def __init__(
        self, identity: RobotIdentity, guard: DepthGuard, free_ahead_m: Callable[[], float] = lambda: math.inf
    ) -> None:
        self._free_ahead_m = free_ahead_m
        self._base = identity.profile.base
        self._camera = identity.profile.camera
        self._simulated = identity.simulated
        self._guard = guard
        self._before: _Frame | None = None
        self._moved = False
        self._blind_refusals = 0
        self._something_near: bool | None = None
        """In the last look that saw the path; None before the first."""
        self._turned_rad = 0.0

    def look(self, observation: Observation) -> None:
        """Check the observation before an action.

        Raises:
            SensorLostError: the depth image is out of the camera's range, or unchanged since the last movement.
        """
        depth_m = observation.depth_m
        if depth_m is None or not self._guard.enabled:
            return
        camera, step = observation.camera, max(1, depth_m.shape[1] // _SAMPLES)
        sample = depth_m[::step, ::step]
        valid = (sample > 0) & (sample <= camera.depth_max_m)
        if np.count_nonzero(valid) < _FEW * valid.size and (fault := range_fault(depth_m, camera)):
            raise SensorLostError(fault, advice=WRONG_UNIT)
        frame = _Frame(depth_m, observation.depth_frame_digest)
        if self._moved and self._before is not None and valid.any() and frame.equals(self._before):
            self._require_change(observation)
        self._before, self._moved = frame, False
        if not evidence_in(observation, self._base, self._guard).is_blind:
            self._blind_refusals, self._turned_rad = 0, 0.0
            self._something_near = bool((sample[valid] < camera.depth_min_m + _NEAR_M).any())

    def moved(self, result: MotionResult) -> None:
        """Register the movement of an action, as the odometry measured it."""
        far = abs(result.displacement_m) >= _MOVED_M or abs(result.turn_rad) >= _MOVED_RAD
        self._moved = self._moved or (result.completed and far)
        self._turned_rad += abs(result.turn_rad)

    def refused(self, reading: GuardReading) -> None:
        """Register that the guard refused a move.

        A wall nearer than the camera's minimum range hides everything, too. A robot that saw something near before it
        was blind, or that starts near a wall, is therefore only refused until it has turned away.

        Raises:
            SensorLostError: the camera stays blind.
        """
        if reading.refusal is not Refusal.BLIND:
            return
        self._blind_refusals += 1
        if self._blind_refusals >= MAX_BLIND_REFUSALS and not self._may_be_too_near():
            raise SensorLostError(
                f"the depth camera stays blind: {self._blind_refusals} forward moves were refused, the last one with "
                f"depth in {reading.valid_share:.0%} of the pixels that must show the path",
                advice="is its lens covered, its emitter on, and the robot not close in front of a wall?",
            )

    def _may_be_too_near(self) -> bool:
        """Whether an obstacle nearer than the camera's minimum range explains the blindness."""
        if self._turned_rad >= _BLIND_TURN_RAD:
            return False
        if self._something_near is None:
            return self._free_ahead_m() <= self._camera.depth_min_m + self._camera.mount_forward_m
        return self._something_near

    def _require_change(self, observation: Observation) -> None:
        """Raise an error if an unchanged image after a movement means that the camera is frozen.

        A simulated camera without noise can see the same empty floor from several poses.
        """
        assert observation.depth_m is not None  # noqa: S101  # checked by the caller
        if self._simulated:
            heights_m = observation.camera.points_in_base(observation.depth_m)[..., 2]
            if not (heights_m > self._guard.min_height_m).any():
                return
        raise SensorLostError(
            "the depth image has not changed since before the last movement, bit for bit: the camera is frozen",
            advice="restart the camera's driver",
        )
