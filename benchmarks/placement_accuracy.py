"""Measures the error of a placement measured from depth images.

The trials are random offsets at the marks of the apartment and of five generated flats. Each trial puts the robot up to
40 cm and 25° off a mark. The objects of the room are 2 cm (standard deviation, along x and along y) off the survey, and
two of them 0.3 to 1 m. The depth camera has noise, holes and a scale error of 1 %. `--walls` also displaces the corners
of the building, and `--surveyed` sets the wall error that the site declares. If one look does not determine the pose,
the script also measures with a turn on the spot. Errors are in cm and degrees, time is processor time of one thread in
seconds. A trial depends only on the seed and its number, so trials in the rows file are skipped. With `--camera` the
real camera differs from the profile; `--calibrate` corrects the profile first, as `vsnbench robots calibrate` does.

    python benchmarks/placement_accuracy.py [--cases N] [--seed S] [--near | --well] [--walls CM] [--surveyed CM]
                                            [--camera FIELD=OFF]... [--calibrate]
                                            [--no-turn] [--rows FILE] [--json FILE] [--map FILE]
"""

import argparse
import json
import math
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.support.placement_trials import DEPTH_SCALE, NoisyEye, Trial, draw_trial, first_starts
from vsnbench.localization.looks import DepthLook
from vsnbench.localization.matching import PlacementMatcher
from vsnbench.localization.twin import twin_of
from vsnbench.report.plan.floor_plan import PlanStyle, draw_floor_plan
from vsnbench.robots.profiles import load_profile
from vsnbench.runtime.threads import compute_with_one_thread
from vsnbench.sensing.images.floor_plane import fit_floor
from vsnbench.sensing.images.rectifier import Rectifier
from vsnbench.simulator.generated_sites.generate import generate_site
from vsnbench.simulator.rendering.renderer import Pinhole, eye_of
from vsnbench.sites.site import Site, StartingPosition, load_site
from vsnbench.values.camera import Camera
from vsnbench.values.placement import MeasuredPlacement
from vsnbench.values.pose import Pose

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TURN_ERROR = 0.01
"""Standard deviation of the turn's error, as a share of the turn in the odometry."""


@dataclass(frozen=True, slots=True)
class Row:
    """One measurement and its errors against the true pose."""

    trial: int
    mark: str
    method: str
    determined: bool
    green: bool
    stands_right: bool
    stands_well: bool
    """Within half the tolerance, where an operator would not move the robot again."""
    covered: bool
    error_m: float
    error_deg: float
    region_m: float
    region_deg: float
    moved: tuple[str, ...]
    moved_in_view: tuple[str, ...]
    """Moved objects that fill at least 0.5 % of the image at their surveyed positions."""
    said_moved: tuple[str, ...]
    said: str
    cpu_s: float

    @classmethod
    def of(
        cls, number: int, trial: Trial, truth: Pose, in_view: frozenset[str], got: MeasuredPlacement, cpu_s: float
    ) -> "Row":
        """Compare a measurement with the robot's true pose."""
        off = truth.relative_to(got.mark)
        off_m, turned_deg = math.hypot(*off.position), abs(math.degrees(math.remainder(off.heading_rad, math.tau)))
        within_m, within_deg = got.tolerance.distance_m, got.tolerance.heading_deg
        error_rad = math.remainder(got.pose.heading_rad - truth.heading_rad, math.tau)
        return cls(
            trial=number,
            mark=f"{trial.site.name} {trial.start.number}",
            method=got.method.value,
            determined=got.determined,
            green=got.within_tolerance,
            stands_right=off_m <= within_m and turned_deg <= within_deg,
            stands_well=off_m <= within_m / 2 and turned_deg <= within_deg / 2,
            covered=got.region_holds(truth),
            error_m=truth.distance_to(got.pose),
            error_deg=abs(math.degrees(error_rad)),
            region_m=got.region_m,
            region_deg=got.region_deg,
            moved=trial.moved,
            moved_in_view=tuple(name for name in trial.moved if name in in_view),
            said_moved=got.moved,
            said=got.headline,
            cpu_s=cpu_s,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--no-turn", action="store_true", help="do not measure with a turn when a look is not enough")
    near = parser.add_mutually_exclusive_group()
    near.add_argument("--near", action="store_true", help="offsets up to 15 cm and 5° only, around the tolerance")
    near.add_argument("--well", action="store_true", help="offsets up to 5 cm and 1.5° only, within the tolerance")
    parser.add_argument(
        "--walls", type=float, default=0.0, metavar="CM", help="standard deviation of wall corners, along x and y"
    )
    parser.add_argument("--surveyed", type=float, default=1.0, metavar="CM", help="wall error that the site declares")
    parser.add_argument("--rows", type=Path, help="JSON lines of all measurements; trials in it are skipped")
    parser.add_argument("--json", type=Path, help="output file of the summary")
    parser.add_argument("--map", type=Path, help="output PNG: share of determined looks at each mark of the apartment")
    parser.add_argument(
        "--camera", action="append", default=[], metavar="FIELD=OFF", help="real value minus profile value of a field"
    )
    parser.add_argument("--calibrate", action="store_true", help="correct the profile's camera before placing")
    asked = parser.parse_args()
    compute_with_one_thread()
    camera = load_profile("turtlebot2").camera
    off = {name: float(value) for name, _, value in (pair.partition("=") for pair in asked.camera)}
    real = camera.model_copy(update={name: getattr(camera, name) + value for name, value in off.items()})
    if asked.calibrate:
        camera = calibrated(camera, real)
    eyes = CameraPair(camera, real)
    cells = first_starts([load_site("apartment"), *(generate_site(seed) for seed in range(5))])
    order = np.random.default_rng(asked.seed).permutation(np.arange(asked.cases) % len(cells))
    rows = _read(asked.rows)
    done = {row.trial for row in rows}
    for number in range(asked.cases):
        if number not in done:
            site, start = cells[order[number]]
            new = measured(number, site, start, eyes, asked)
            rows += new
            if asked.rows:
                with asked.rows.open("a") as file:
                    file.writelines(json.dumps(asdict(row)) + "\n" for row in new)
    print_summary(rows, asked.json)
    if asked.map:
        draw_map(load_site("apartment"), rows, asked.map)


@dataclass(frozen=True, slots=True)
class CameraPair:
    """A robot's camera: the profile's and the real one."""

    profile: Camera
    real: Camera

    def rectified(self, looks: Sequence[DepthLook]) -> list[DepthLook]:
        """Return the real camera's looks as the profile's camera without its roll."""
        rectifier, camera = Rectifier(self.profile, None), self.profile.without_roll
        if self.profile.roll_deg:
            looks = [replace(look, depth_m=rectifier.depth(np.asarray(look.depth_m, np.float32))) for look in looks]
        return [replace(look, camera=camera) for look in looks]


def calibrated(camera: Camera, real: Camera) -> Camera:
    """Return the profile's camera, corrected from the real camera's floor image and published field of view."""
    camera = camera.model_copy(update={"horizontal_fov_deg": real.horizontal_fov_deg})
    site = load_site("apartment")
    look = NoisyEye(site, real, 1 + DEPTH_SCALE, np.random.default_rng(0)).look(site.starts[4].pose)
    floor = fit_floor(look.depth_m, camera)
    return camera.model_copy(
        update={
            "mount_height_m": floor.height_m.value,
            "tilt_deg": floor.tilt_deg.value,
            "roll_deg": floor.roll_deg.value,
        }
    )


def measured(
    number: int, site: Site, start: StartingPosition, eyes: CameraPair, asked: argparse.Namespace
) -> list[Row]:
    """Measure one trial with a look and, if that is not enough, with a turn."""
    rng = np.random.default_rng([asked.seed, number])
    site = site.model_copy(update={"survey_error_m": asked.surveyed / 100})
    most_m, most_deg = (0.05, 1.5) if asked.well else (0.15, 5.0) if asked.near else (0.40, 25.0)
    trial = draw_trial(site, start, rng, most_m, most_deg, walls_m=asked.walls / 100)
    camera = eyes.profile.without_roll
    eye = NoisyEye(trial.room, eyes.real, trial.depth_scale, rng)
    matcher = PlacementMatcher(site)
    look = eye.look(trial.pose)
    began_s = time.thread_time()
    got = matcher.measure(start, eyes.rectified([look]))
    took_s = time.thread_time() - began_s
    rows = [Row.of(number, trial, trial.pose, in_view(site, camera, [trial.pose]), got, took_s)]
    if not got.determined and not asked.no_turn:
        around, end = eye.turn(trial.pose, 12, float(rng.normal(0, TURN_ERROR)))
        began_s = time.thread_time()
        got = matcher.measure(start, eyes.rectified(around))
        took_s = time.thread_time() - began_s
        stood = [trial.pose.compose(look.odometry) for look in around]
        rows.append(Row.of(number, trial, end, in_view(site, camera, stood), got, took_s))
    return rows


def in_view(site: Site, camera: Camera, poses: Sequence[Pose]) -> frozenset[str]:
    """Return the ids of surveyed objects that fill at least 0.5 % of the image from one of the poses."""
    twin, pinhole = twin_of(site), Pinhole(80, 60, camera.focal_px * 80 / camera.width, 39.5, 29.5)
    seen: set[int] = set()
    for pose in poses:
        face = twin.drawer.draw(eye_of(camera, pose), pinhole).face
        pixels = np.bincount(twin.object_of[face[face >= 0]], minlength=len(site.objects) + 1)
        seen.update(np.nonzero(pixels >= 0.005 * face.size)[0].tolist())
    return frozenset(site.objects[number - 1].id for number in seen if number)


def _read(path: Path | None) -> list[Row]:
    if path is None or not path.exists():
        return []
    return [Row(**json.loads(line)) for line in path.read_text().splitlines()]


def print_summary(rows: Sequence[Row], path: Path | None) -> None:
    """Print the summary, and the measurements whose region does not contain the true pose."""
    looks = [row for row in rows if row.method == "look"]
    turns = [row for row in rows if row.method == "turn"]
    result = {"look": summary(looks), "turn": summary(turns)}
    print(json.dumps(result, indent=2))
    for name, some in (("a look", looks), ("a turn", turns)):
        print(f"not determined by {name}:", dict(Counter(row.mark for row in some if not row.determined)))
    for row in rows:
        if not row.covered or (row.green and not row.stands_right):
            print(
                f"outside: {row.trial}, {row.mark} by a {row.method}: {100 * row.error_m:.1f} cm, "
                f"{row.error_deg:.2f}°, determined: {row.determined}, headline {row.said}; "
                f"moved {row.moved}, reported {row.said_moved}"
            )
    if path:
        path.write_text(json.dumps(result, indent=2))


def summary(rows: Sequence[Row]) -> dict[str, float | int]:
    """Return the counts and quantiles of some measurements."""
    sure = [row for row in rows if row.determined]
    if not sure:
        return {"trials": len(rows), "determined": 0}
    right = [row for row in sure if row.stands_right]
    well = [row for row in sure if row.stands_well]
    said = sum(len(row.said_moved) for row in sure)
    truly = sum(len(set(row.said_moved) & set(row.moved)) for row in sure)
    in_view = sum(len(row.moved_in_view) for row in sure)
    found = sum(len(set(row.said_moved) & set(row.moved_in_view)) for row in sure)

    def quantile(values: Sequence[float], share: float, digits: int) -> float:
        return round(float(np.quantile(values, share)), digits)

    return {
        "trials": len(rows),
        "determined": len(sure),
        "median_cm": quantile([100 * row.error_m for row in sure], 0.5, 2),
        "p95_cm": quantile([100 * row.error_m for row in sure], 0.95, 2),
        "median_deg": quantile([row.error_deg for row in sure], 0.5, 3),
        "p95_deg": quantile([row.error_deg for row in sure], 0.95, 3),
        "covered_of_determined": round(sum(row.covered for row in sure) / len(sure), 3),
        "covered_of_all": round(sum(row.covered for row in rows) / len(rows), 3),
        "median_region_cm": quantile([100 * row.region_m for row in sure], 0.5, 1),
        "median_region_deg": quantile([row.region_deg for row in sure], 0.5, 2),
        "green": sum(row.green for row in rows),
        "wrong_green": sum(row.green and not row.stands_right for row in rows),
        "stand_right": sum(row.stands_right for row in rows),
        "stand_right_and_determined": len(right),
        "of_these_green": sum(row.green for row in right),
        "stand_well_and_determined": len(well),
        "of_those_green": sum(row.green for row in well),
        "said_moved": said,
        "truly_moved": truly,
        "moved_in_view": in_view,
        "of_these_said": found,
        "median_cpu_s": quantile([row.cpu_s for row in rows], 0.5, 2),
        "most_cpu_s": quantile([row.cpu_s for row in rows], 1.0, 2),
    }


def draw_map(site: Site, rows: Sequence[Row], path: Path) -> None:
    """Draw the share of determined looks at each mark of a site, as a filled sector of a disk."""
    from matplotlib.patches import Circle, Wedge
    from matplotlib.patheffects import withStroke

    halo = [withStroke(linewidth=2.0, foreground="white")]  # readable over a wall
    axes = draw_floor_plan(site, style=PlanStyle(labels=False, legend=False))
    for start in site.starts:
        looks = [row for row in rows if row.method == "look" and row.mark == f"{site.name} {start.number}"]
        if not looks:
            continue
        sure = sum(row.determined for row in looks)
        axes.add_artist(Circle(start.position, 0.24, facecolor="white", edgecolor="black", linewidth=0.7, zorder=12))
        turned_deg = 360 * sure / len(looks)
        axes.add_artist(Wedge(start.position, 0.24, 90 - turned_deg, 90, facecolor="#2e7d32", alpha=0.55, zorder=12.1))
        axes.text(*start.position, str(start.number), ha="center", va="center_baseline", fontsize=8, zorder=13)
        x_m, y_m = start.position
        words = f"{sure}/{len(looks)}"
        axes.text(x_m, y_m - 0.4, words, ha="center", va="center", fontsize=7, zorder=13, path_effects=halo)
    figure: Figure = axes.figure  # type: ignore[assignment]  # a new figure, never a sub-figure
    figure.savefig(path, dpi=120, bbox_inches="tight", pad_inches=0.03)


if __name__ == "__main__":
    main()
