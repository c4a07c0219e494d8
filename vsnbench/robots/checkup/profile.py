"""Plausibility of a robot profile: valid values that do not fit together."""

from vsnbench.protocol.depth_evidence import evidence_pixels
from vsnbench.protocol.parameters import DepthGuard
from vsnbench.robots.adapter.interface import AdapterInterface
from vsnbench.robots.ros.interface_kinds import interface_of
from vsnbench.values.robot_profile import RobotProfile

_UNALIGNED_DEPTH = "depth/image_rect_raw"
_ARM_M = 0.3
"""Cameras farther outside the base's radius are implausible."""


def implausible_values(profile: RobotProfile) -> list[str]:
    """Return the implausible values."""
    base, speeds, camera = profile.base, profile.speeds, profile.camera
    found = []
    if speeds.linear_m_s > base.max_linear_m_s:
        found.append(f"speeds.linear_m_s {speeds.linear_m_s:g} exceeds base.max_linear_m_s {base.max_linear_m_s:g}")
    if speeds.angular_rad_s > base.max_angular_rad_s:
        found.append(
            f"speeds.angular_rad_s {speeds.angular_rad_s:g} exceeds base.max_angular_rad_s {base.max_angular_rad_s:g}"
        )
    if base.track_m is not None and base.track_m / 2 > base.radius_m:
        found.append(f"base.track_m {base.track_m:g} puts the wheels outside the radius of {base.radius_m:g} m")
    if base.odometry_rate_hz < 10:
        found.append(f"base.odometry_rate_hz {base.odometry_rate_hz:g} is slow: every action takes longer")
    if camera.mount_height_m > base.height_m + 0.05:
        found.append(
            f"camera.mount_height_m {camera.mount_height_m:g} exceeds the robot's height of {base.height_m:g} m"
        )
    if abs(camera.mount_forward_m) > base.radius_m + _ARM_M:
        found.append(
            f"camera.mount_forward_m {camera.mount_forward_m:g} is more than {_ARM_M:g} m outside the base's radius "
            f"of {base.radius_m:g} m"
        )
    of_adapter = isinstance(profile.interface, AdapterInterface)
    has_depth = profile.interface is None or of_adapter or interface_of(profile).depth
    seen = evidence_pixels(camera.without_roll, camera.width, camera.height, base.radius_m, DepthGuard()).pixels
    if has_depth and not seen.any():
        found.append(
            f"camera.tilt_deg {camera.tilt_deg:g}: the camera does not see the way ahead of the robot, and the depth "
            "guard refuses every forward move"
        )
    if camera.depth_min_m >= camera.depth_max_m:
        found.append(f"camera.depth_min_m {camera.depth_min_m:g} is not below depth_max_m {camera.depth_max_m:g}")
    if profile.interface is not None and not of_adapter:
        found += _implausible_interface(profile)
    return found


def _implausible_interface(profile: RobotProfile) -> list[str]:
    names = interface_of(profile)
    found = []
    if profile.base.has_bumper != any(getattr(names, field) for field in names.contact_fields):
        found.append(
            f"base.has_bumper and interface.{' or '.join(names.contact_fields)} do not agree: without the topic, the "
            "operator has to report collisions"
        )
    if not names.depth:
        found.append("no interface.depth: forward moves have no depth guard, and models that need depth cannot run")
    if names.depth.endswith(_UNALIGNED_DEPTH):
        found.append(
            f"interface.depth {names.depth} is not aligned to the colour image: enable align_depth of the "
            "RealSense and use aligned_depth_to_color/image_raw"
        )
    topics = [getattr(names, field) for field in names.distinct_fields]
    found += [f"two parts share the topic {t}" for t in sorted({t for t in topics if t and topics.count(t) > 1})]
    return found
