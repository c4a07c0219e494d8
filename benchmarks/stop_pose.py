"""Measures how often the verdict of a STOP is wrong: by an odometry that drifts, and by the pose from depth images.

Each trial drives the oracle's way through the apartment or a generated flat, and stops where its distance to the goal
falls below a random one near the protocol's. The odometry has a scale error of up to 5 % in its distances, 2 % in its
turns and, in addition, an error of up to 0.1 rad in heading at the end of the way, part of it a curve and part a random
walk. The start is known as from a measured placement, within 2 cm and 0.5 degrees. The objects of the room are 2 cm
(standard deviation, along x and along y) off the survey, and one of them 0.3 to 1 m. The depth camera has noise, holes
and a scale error of 1 %. The true verdict is that of the true pose. A trial depends only on the seed and its number.

`--wall` stops instead in front of bare walls, after a turn towards them, with only such views.

    python benchmarks/stop_pose.py [--trials N] [--seed S] [--flat N] [--wall] [--part K/N] [--rows FILE]
"""

import argparse
import json
import math
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.support.stops import DrivenWay, drive, way_to_goal, way_to_wall
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.stop_pose import StopPose
from vsnbench.robots.profiles import load_profile
from vsnbench.runtime.threads import compute_with_one_thread
from vsnbench.simulator.generated_sites.generate import generate_site
from vsnbench.sites.site import load_site

PARAMETERS = ProtocolParameters()


@dataclass(frozen=True, slots=True)
class Row:
    """One trial."""

    trial: int
    where: str
    way_m: float
    true_m: float
    odometry_m: float
    odometry_range_m: tuple[float, float]
    odometry_error_m: float
    measured_m: float | None
    measured_range_m: tuple[float, float] | None
    measured_error_m: float
    region_m: float
    covered: bool
    """The true pose is in the 95 % region."""
    distance_covered: bool
    """The true distance is in the range of the measured one."""
    true_success: bool
    odometry_success: bool
    judged_success: bool
    straddles: bool
    """The range of the measured distance contains the success distance."""
    unknown: str
    looks: int
    took_s: float

    @classmethod
    def of(cls, number: int, way: DrivenWay, stop: StopPose, took_s: float) -> "Row":
        """Compare a measurement with the true pose."""
        success_m, placement, measured = PARAMETERS.success_distance_m, stop.placement, stop.measured
        range_m = None if measured is None else measured.range_m
        return cls(
            trial=number,
            where=f"{way.site.name} {way.goal} from {way.start}",
            way_m=way.way_m,
            true_m=way.true_distance.distance_m,
            odometry_m=stop.odometry.distance_m,
            odometry_range_m=stop.odometry.range_m or (0.0, math.inf),
            odometry_error_m=way.true_pose.distance_to(placement.mark),
            measured_m=measured.distance_m if measured else None,
            measured_range_m=range_m,
            measured_error_m=way.true_pose.distance_to(placement.pose),
            region_m=placement.region_m,
            covered=placement.region_holds(way.true_pose),
            distance_covered=range_m is not None and range_m[0] <= way.true_distance.distance_m <= range_m[1],
            true_success=way.true_distance.is_under(success_m),
            odometry_success=stop.odometry.is_under(success_m),
            judged_success=stop.judged.is_under(success_m),
            straddles=range_m is not None and range_m[0] < success_m <= range_m[1],
            unknown=stop.unknown,
            looks=placement.looks,
            took_s=took_s,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--flat", type=int, default=7, help="number of the generated flat")
    parser.add_argument("--wall", action="store_true", help="stop in front of bare walls")
    parser.add_argument("--part", default="1/1", metavar="K/N", help="every Nth trial, from the Kth, for N processes")
    parser.add_argument("--rows", type=Path, help="JSON lines of all trials; trials in it are skipped")
    asked = parser.parse_args()
    compute_with_one_thread()
    profile = load_profile("turtlebot2")
    sites = [load_site("apartment"), generate_site(asked.flat)]
    rows = _read(asked.rows)
    done = {row.trial for row in rows}
    print("trial  way     true    odometry                measured")
    part, parts = map(int, asked.part.split("/"))
    for number in range(part - 1, asked.trials, parts):
        if number in done:
            continue
        path = way_to_wall(sites[0], number) if asked.wall else way_to_goal(sites, profile, asked.seed, number)
        way, meter = drive(path, profile, PARAMETERS, np.random.default_rng([asked.seed, number]))
        began_s = time.perf_counter()
        stop = meter.measure()
        assert stop is not None
        rows.append(Row.of(number, way, stop, time.perf_counter() - began_s))
        print(line(rows[-1]), flush=True)
        if asked.rows:
            with asked.rows.open("a") as file:
                file.write(json.dumps(asdict(rows[-1])) + "\n")
    print(json.dumps(summary(rows), indent=2))


def _read(path: Path | None) -> list[Row]:
    if path is None or not path.exists():
        return []
    return [Row(**json.loads(line)) for line in path.read_text().splitlines()]


def line(row: Row) -> str:
    """Return a trial as a line."""
    low_m, high_m = row.odometry_range_m
    odometry = (
        f"{row.odometry_m:.3f} ({low_m:.2f} to {high_m:.2f}){'' if row.odometry_success == row.true_success else '*'}"
    )
    measured = row.unknown
    if row.measured_m is not None and row.measured_range_m is not None:
        low_m, high_m = row.measured_range_m
        wrong = "" if row.judged_success == row.true_success else "*"
        measured = f"{row.measured_m:.3f} ({low_m:.2f} to {high_m:.2f}){wrong}"
    return (
        f"{row.trial:4}  {row.way_m:5.2f}  {row.true_m:6.3f}   {odometry:26} {measured:26} "
        f"off {row.measured_error_m:.3f} ± {row.region_m:.2f} {'' if row.covered else 'OUTSIDE '}"
        f"{row.looks} looks {row.took_s:.1f} s {row.where}"
    )


def summary(rows: list[Row]) -> dict[str, float | int]:
    """Return counts and quantiles."""
    known = [row for row in rows if row.measured_m is not None]
    return {
        "trials": len(rows),
        "odometry_wrong": sum(row.odometry_success != row.true_success for row in rows),
        "odometry_error_median_m": round(float(np.median([row.odometry_error_m for row in rows])), 3),
        "odometry_error_most_m": round(max(row.odometry_error_m for row in rows), 3),
        "measured": len(known),
        "measured_wrong": sum(row.judged_success != row.true_success for row in known),
        "of_these_straddling": sum(row.judged_success != row.true_success and row.straddles for row in known),
        "straddling": sum(row.straddles for row in known),
        "unknown": len(rows) - len(known),
        "unknown_and_odometry_wrong": sum(
            row.odometry_success != row.true_success for row in rows if row.measured_m is None
        ),
        "judged_wrong": sum(row.judged_success != row.true_success for row in rows),
        "measured_error_median_m": round(float(np.median([row.measured_error_m for row in known] or [math.nan])), 3),
        "measured_error_most_m": round(max((row.measured_error_m for row in known), default=math.nan), 3),
        "region_median_m": round(float(np.median([row.region_m for row in known] or [math.nan])), 3),
        "covered": sum(row.covered for row in known),
        "distance_covered": sum(row.distance_covered for row in known),
        "odometry_range_covers": sum(row.odometry_range_m[0] <= row.true_m <= row.odometry_range_m[1] for row in rows),
        "took_median_s": round(float(np.median([row.took_s for row in rows])), 2),
        "took_most_s": round(max(row.took_s for row in rows), 2),
    }


if __name__ == "__main__":
    main()
