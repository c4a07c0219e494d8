"""What is allowed in a robot profile and still looks wrong: parts that do not fit together."""

from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.robots.interface_kinds import interface_of, kind_of


def doubts_about(profile: RobotProfile) -> list[str]:
    """Return in words what somebody should look at again; empty when nothing strikes."""
    base, speeds, camera = profile.base, profile.speeds, profile.camera
    doubts = []
    if speeds.linear_m_s > base.max_linear_m_s:
        doubts.append(
            f"speeds.linear_m_s {speeds.linear_m_s:g} is over the base's {base.max_linear_m_s:g}, which holds"
        )
    if speeds.angular_rad_s > base.max_angular_rad_s:
        doubts.append(
            f"speeds.angular_rad_s {speeds.angular_rad_s:g} is over the base's {base.max_angular_rad_s:g}, which holds"
        )
    if base.track_m / 2 > base.radius_m:
        doubts.append(f"base.track_m {base.track_m:g} puts the wheels outside of the shell of {base.radius_m:g} m")
    if base.odometry_rate_hz < 10:
        doubts.append(f"base.odometry_rate_hz {base.odometry_rate_hz:g} is slow: every action waits for it to settle")
    if camera.mount_height_m > base.height_m + 0.05:
        doubts.append(
            f"the camera sits at {camera.mount_height_m:g} m, above the robot's height of {base.height_m:g} m"
        )
    if profile.interface is not None:
        doubts += _doubts_about_interface(profile)
    return doubts


def _doubts_about_interface(profile: RobotProfile) -> list[str]:
    kind, names = kind_of(profile), interface_of(profile)
    doubts = []
    if profile.base.has_bumper != any(getattr(names, field) for field in kind.bumpers):
        doubts.append(
            f"base.has_bumper and interface.{' or '.join(kind.bumpers)} do not agree: without the topic, collisions "
            "are a person's word"
        )
    if not names.depth:
        doubts.append(
            "no interface.depth: no depth guard before forward moves, and models that need depth refuse the robot"
        )
    topics = [getattr(names, field) for field in kind.topics]
    doubts += [f"two parts share the topic {t}" for t in sorted({t for t in topics if t and topics.count(t) > 1})]
    return doubts
