"""Measures the misplaced cameras that `vsnbench doctor` finds, and false alarms.

`doctor` compares the floor in the depth image with the profile. The robot is a simulated Turtlebot 2 at marks of the
apartment. Each image is the median of ten frames with noise, holes and a depth scale error of 1 % (standard deviation).
Twelve cameras differ from the profile in position or field of view; two of them have a driver that publishes no
camera_info. Twenty correct cameras are at twenty marks of the apartment and of generated flats from which the floor is
visible.

    python benchmarks/misplaced_cameras.py [--seed S]
"""

import argparse
from dataclasses import dataclass

import numpy as np

from benchmarks.support.placement_trials import DEPTH_SCALE, NoisyEye, first_starts
from vsnbench.robots.checkup.mount import mount_results
from vsnbench.robots.checkup.result import Health
from vsnbench.robots.profiles import load_profile
from vsnbench.runtime.threads import compute_with_one_thread
from vsnbench.sensing.images.camera_images import median_depth_m
from vsnbench.sensing.images.intrinsics import FOV_SHARE, Intrinsics
from vsnbench.sensing.images.rectifier import rectifier_of
from vsnbench.simulator.generated_sites.generate import generate_site
from vsnbench.sites.site import Site, load_site
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose

MARK = 5
FRAMES = 10
RIGHT = 20


@dataclass(frozen=True, slots=True)
class Misplaced:
    """One fault of a camera: a profile field and its error."""

    field: str
    off: float
    """Real value minus profile value; for a field of view, as a share of it."""
    has_info: bool = True
    """Whether the driver publishes a camera_info."""

    def camera(self, profile: Camera) -> Camera:
        """Return the real camera, with the fault."""
        value = getattr(profile, self.field)
        changed = value * (1 + self.off) if self.field == "horizontal_fov_deg" else value + self.off
        return profile.model_copy(update={self.field: changed})


FAULTS = (
    *(Misplaced("tilt_deg", off) for off in (2.0, -2.0, 5.0, -5.0)),
    *(Misplaced("mount_height_m", off) for off in (-0.05, -0.10)),
    Misplaced("roll_deg", 3.0),
    *(Misplaced("horizontal_fov_deg", off) for off in (0.03, -0.03)),
    *(Misplaced("horizontal_fov_deg", off, has_info=False) for off in (0.03, -0.03)),
    Misplaced("mount_forward_m", 0.10),
)


def checked(
    scene: tuple[Site, Pose], profile: Camera, real: Camera, info: Intrinsics | None, rng: np.random.Generator
) -> list[tuple[str, str]]:
    """Return (name, message) of each check that failed or could not run."""
    site, pose = scene
    eye = NoisyEye(site, real, 1 + rng.normal(0, DEPTH_SCALE), rng)
    frames = [np.asarray(eye.look(pose).depth_m, np.float32) for _ in range(FRAMES)]
    depth_m = median_depth_m(frames, profile.depth_min_m, profile.depth_max_m)
    results = mount_results(rectifier_of(info, profile, "", 0).depth(depth_m), profile)
    return [(result.what, result.seen) for result in results if result.health is not Health.OK]


def info_of(real: Camera) -> Intrinsics:
    """Return the camera_info that a correct driver publishes for a camera."""
    return Intrinsics(real.width, real.height, real.focal_px, real.focal_px, *real.center_px, (), "plumb_bob")


def info_message(profile: Camera, info: Intrinsics) -> str:
    """Return the doctor's message about a camera_info, or an empty string if it matches the profile."""
    fov_deg, wanted_deg = info.horizontal_fov_deg(), profile.horizontal_fov_deg
    return f"camera_info: {fov_deg:.1f}° against {wanted_deg:g}°" if abs(fov_deg / wanted_deg - 1) > FOV_SHARE else ""


def main() -> None:
    """Print one line per fault, and the number of false alarms."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    compute_with_one_thread()
    profile, site = load_profile("turtlebot2").camera, load_site("apartment")
    starts = {start.number: start for start in site.starts}
    found = 0
    print("| fault | found | message of `doctor` |\n| --- | --- | --- |")
    for number, fault in enumerate(FAULTS):
        real = fault.camera(profile)
        rng = np.random.default_rng([asked.seed, number])
        info = info_of(real) if fault.has_info else None
        lines = checked((site, starts[MARK].pose), profile, real, info, rng)
        failed = [f"{what}: {message}" for what, message in lines if what != "camera mount"]
        if info is not None and (message := info_message(profile, info)):
            failed.append(message)
        found += bool(failed)
        name = f"{fault.field} {fault.off:+g}{'' if fault.has_info else ', no camera_info'}"
        print(f"| {name} | {'yes' if failed else 'no'} | {'; '.join(failed)} |", flush=True)
    false, checks, unseen = 0, 0, 0
    for number, (place, start) in enumerate(first_starts([site, *(generate_site(seed) for seed in range(3))])):
        rng = np.random.default_rng([asked.seed, 100 + number])
        lines = checked((place, start.pose), profile, profile, info_of(profile), rng)
        if any(what == "camera mount" for what, _ in lines):
            unseen += 1
            continue
        checks += 1
        false += bool(lines)
        if lines:
            print(f"false alarm at {place.name} {start.number}: {lines}", flush=True)
        if checks == RIGHT:
            break
    print(f"found {found} of {len(FAULTS)}; false alarms: {false} of {checks} correct cameras")
    print(f"marks skipped because the floor is not visible: {unseen}")


if __name__ == "__main__":
    main()
