"""Ends an episode whose camera is frozen, or whose depth is missing or out of range."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsnbench.errors import SensorLostError
from vsnbench.protocol.parameters import DepthGuard
from vsnbench.runner.episode.depth_guard import GuardReading, Refusal, evidence_in
from vsnbench.runner.episode.hidden_region import MAX_HIDDEN_REFUSALS, HiddenRegion
from vsnbench.sensing.images.depth_range import WRONG_UNIT, range_fault
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.robot_identity import RobotIdentity

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
    """Colour or depth of one look, for comparison with the next."""

    pixels: npt.NDArray[np.generic]
    digest: bytes | None = None
    """Of the raw image, if `pixels` are filtered from several."""

    def equals(self, other: "_Frame") -> bool:
        """Whether both are identical, bit for bit."""
        if self.digest is not None and other.digest is not None:
            return self.digest == other.digest
        mine, others = (np.ascontiguousarray(frame.pixels).view(np.uint8) for frame in (self, other))
        return mine.shape == others.shape and bool((mine[::32] == others[::32]).all()) and bool((mine == others).all())


class CameraWatch:
    """Compares the images of one episode with each other and with the robot's movements.

    Depth is not checked for a robot without depth images, or with the guard off. `free_ahead_m` returns the distance
    straight ahead from the start to the site's first wall or object; it is used if the robot sees nothing there.
    """

    def __init__(
        self, identity: RobotIdentity, guard: DepthGuard, free_ahead_m: Callable[[], float] = lambda: math.inf
    ) -> None:
        self._free_ahead_m = free_ahead_m
        self._base = identity.profile.base
        self._camera = identity.profile.camera
        self._simulated = identity.simulated
        self._guard = guard
        self._before: dict[str, _Frame] = {}
        """Frames of the last look, by what they show."""
        self._moved = False
        self._blind_refusals = 0
        self._something_near: bool | None = None
        """In the last look that saw the path; None before the first."""
        self._turned_rad = 0.0
        self._region = HiddenRegion()

    def look(self, observation: Observation) -> None:
        """Check the observation before an action.

        Raises:
            SensorLostError: the depth image is out of the camera's range, or an image has not changed with the last
                movement.
        """
        frames: dict[str, _Frame] = {}
        if Sensor.RGB in observation.sensors:
            frames["colour"] = _Frame(observation.rgb)
        depth_m = observation.depth_m if self._guard.enabled else None
        sample, valid = _sample(depth_m, observation)
        if depth_m is not None:
            if np.count_nonzero(valid) < _FEW * valid.size and (fault := range_fault(depth_m, observation.camera)):
                raise SensorLostError(fault, advice=WRONG_UNIT)
            if valid.any():
                frames["depth"] = _Frame(depth_m, observation.depth_frame_digest)
        self._require_change(frames, observation)
        self._before, self._moved = frames, False
        if depth_m is None:
            return
        evidence = evidence_in(observation, self._base, self._guard)
        self._region.look(observation, evidence)
        if not evidence.is_blind:
            self._blind_refusals, self._turned_rad = 0, 0.0
            self._something_near = bool((sample[valid] < observation.camera.depth_min_m + _NEAR_M).any())

    def moved(self, result: MotionResult) -> None:
        """Register the movement of an action, as the odometry measured it."""
        far = abs(result.displacement_m) >= _MOVED_M or abs(result.turn_rad) >= _MOVED_RAD
        self._moved = self._moved or (result.completed and far)
        self._turned_rad += abs(result.turn_rad)

    def refused(self, reading: GuardReading) -> None:
        """Register that the guard refused a move.

        A wall nearer than the camera's minimum range hides everything, too. A robot that saw something near before it
        was blind, or that starts near a wall, is therefore only refused until it has turned away. The same holds for a
        part of the image: see `HiddenRegion`.

        Raises:
            SensorLostError: the camera stays blind, or a region of its image stays invalid.
        """
        if reading.refusal is Refusal.TOO_NEAR and (fault := self._region.refused()):
            raise SensorLostError(
                fault,
                advice="is the lens covered there, or a part of the robot in view? (vsnbench doctor --move)",
            )
        if reading.refusal is not Refusal.BLIND:
            return
        self._blind_refusals += 1
        if self._blind_refusals >= MAX_HIDDEN_REFUSALS and not self._may_be_too_near():
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

    def _require_change(self, frames: Mapping[str, _Frame], observation: Observation) -> None:
        """Raise an error if an image is the same after a movement as before it: the camera is frozen.

        The rule is the same for colour and depth. A look without a movement since the last one may be the same: a
        refused move, STOP and NOOP do not move the robot.
        """
        if not self._moved:
            return
        for what, frame in frames.items():
            before = self._before.get(what)
            if before is not None and frame.equals(before) and not self._may_look_the_same(frame, observation):
                raise SensorLostError(
                    f"the {what} image has not changed since before the last movement, bit for bit: the camera is "
                    "frozen",
                    advice="restart the camera's driver",
                )

    def _may_look_the_same(self, frame: _Frame, observation: Observation) -> bool:
        """Whether a working camera can send the same image from two poses.

        A real camera cannot, because of its noise. A simulated camera without noise can see the same empty floor, or
        a surface of one colour that fills the image.
        """
        if not self._simulated:
            return False
        if frame.pixels.ndim == 3 and bool((frame.pixels == frame.pixels[0, 0]).all()):
            return True
        if observation.depth_m is None:
            return False
        heights_m = observation.camera.points_in_base(observation.depth_m)[..., 2]
        return not (heights_m > self._guard.min_height_m).any()


def _sample(
    depth_m: npt.NDArray[np.float32] | None, observation: Observation
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
    """Return some pixels of a depth image, and which of them are valid."""
    if depth_m is None:
        return np.empty((0, 0), np.float32), np.empty((0, 0), np.bool_)
    step = max(1, depth_m.shape[1] // _SAMPLES)
    sample = depth_m[::step, ::step]
    return sample, (sample > 0) & (sample <= observation.camera.depth_max_m)
