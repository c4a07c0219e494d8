"""Measures where a robot is from the depth images of its last steps, near where the odometry expects it.

The robot does not move for it: a person may measure the distance with a tape at the same time.
"""

import itertools
import logging
import math
from collections import deque
from copy import deepcopy
from dataclasses import replace

import numpy as np

from vsnbench.localization.fit import ErrorModel
from vsnbench.localization.looks import DepthLook
from vsnbench.localization.matching import PlacementMatcher
from vsnbench.localization.odometry_errors import covariance_after
from vsnbench.protocol.judge import EndReason, judge
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.stop_pose import StopPose, stop_pose
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.sites.site import Site
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.observation import Observation
from vsnbench.values.placement import PoseCovariance
from vsnbench.values.pose import Pose

logger = logging.getLogger(__name__)

_LOOKS, _WAY_M = 12, 2.0
"""Maximum number of images, and maximum length of the way on which they were taken: beyond, odometry adds more doubt
than a view removes."""
_BY_EYE = PoseCovariance(0.10**2, 0.0, 0.0, 0.10**2, 0.0, math.radians(5.0) ** 2)
"""Covariance of a start that was not measured: a person has put the robot there by eye."""


class StopMeasurement:
    """The looks of an episode, and the robot's pose that they determine."""

    def __init__(
        self, site: Site, goal: str, parameters: ProtocolParameters, start: Fix, known: PoseCovariance | None = None
    ) -> None:
        """Begin at the start of an episode.

        Args:
            site: the site.
            goal: goal of the episode.
            parameters: the protocol's parameters.
            start: start pose in the site's frame.
            known: its covariance; None if it was not measured.
        """
        self._site, self._goal, self._parameters = site, goal, parameters
        self._start, self._known = start, known or _BY_EYE
        self._poses = [Pose(0.0, 0.0)]
        self._looks: deque[DepthLook] = deque(maxlen=_LOOKS)
        self._observation: Observation | None = None

    def search(self, goal: str) -> None:
        """Measure to another goal from now on."""
        self._goal = goal

    def look(self, observation: Observation) -> None:
        """Add an observation of the robot at rest."""
        self._poses.append(observation.pose)
        self._observation = observation
        if observation.depth_m is not None:
            self._looks.append(DepthLook(observation.depth_m, observation.pose, observation.camera))

    def whereabouts(self, observation: Observation) -> str:
        """Return where the robot is in one line, from an observation at rest between two actions.

        The observation is not kept: the next one shows the same view, and would count as a second witness.
        """
        meter = deepcopy(self, {id(self._site): self._site})
        meter.look(observation)
        stop = meter.measure()
        if stop is None:
            return "not measured: the camera has no depth image"
        off = "" if stop.measured is None else f"; {_off(stop.placement.offset)}"
        return f"to the {self._goal}: {stop.text}{off}"

    def judged(self, outcome: EpisodeEnd) -> EpisodeEnd:
        """Return the outcome as judged by the measured pose; unchanged if the model did not stop or none is known."""
        final = outcome.final
        if outcome.end_reason is not EndReason.STOP or final is None or final.source is not PoseSource.ESTIMATED:
            return outcome
        stop = self.measure(final.pose)
        if stop is None:
            return outcome
        verdict = judge(outcome.end_reason, outcome.actions, stop.judged, self._parameters)
        return replace(outcome, verdict=verdict, final=stop.fix, stop=stop)

    def measure(self, by_odometry: Pose | None = None) -> StopPose | None:
        """Measure the pose at the last observation; None if it has no depth image. Takes a few seconds.

        Args:
            by_odometry: pose by the odometry, in the site's frame; default: that of the observation.

        Raises:
            ValueError: the site has no target of the goal.
        """
        observation = self._observation
        if observation is None or observation.depth_m is None:
            return None
        pose = by_odometry or self._start.pose.compose(observation.pose)
        errors = ErrorModel.of(self._site)
        steps = [_step(earlier, later) for earlier, later in itertools.pairwise(self._poses)]
        expected = covariance_after(self._start.pose, self._known, steps, errors.odometry)
        matcher = PlacementMatcher(self._site, errors)
        try:
            placement = matcher.measure_stop(pose, expected, self._last_looks())
        except np.linalg.LinAlgError as error:
            logger.warning("the pose after STOP could not be measured: %s", error)
            return None
        return stop_pose(self._site, self._goal, self._parameters, placement, expected)

    def _last_looks(self) -> list[DepthLook]:
        looks, way_m = [self._looks[-1]], 0.0
        for look in list(self._looks)[-2::-1]:
            way_m += look.odometry.distance_to(looks[-1].odometry)
            if way_m > _WAY_M:
                break
            looks.append(look)
        return looks[::-1]


def _off(offset: Pose) -> str:
    """Return how far the robot is from where its odometry says."""
    turned = f"{abs(math.degrees(offset.heading_rad)):.1f}° to the {'left' if offset.heading_rad > 0 else 'right'}"
    return f"it is {math.hypot(offset.x_m, offset.y_m):.2f} m away from where its odometry says, and turned {turned}"


def _step(earlier: Pose, later: Pose) -> Pose:
    step = later.relative_to(earlier)
    return Pose(step.x_m, step.y_m, math.remainder(step.heading_rad, math.tau))
