"""Counts what a robot with a pitching body touches under the depth guard, with its attitude known and without.

A walking robot approaches a wall, a table, a step of 12 cm, a threshold of 7 cm, a kerb of 5 cm and the leg of a table,
and walks along a free lane: by turns with discrete moves, before which the guard looks, and through, watched by the
path guard. Its gait pitches and rolls the camera; after each movement the body rests in another attitude. The gaits are
that of the Go2 in MuJoCo (tests/ros/ros2/go2) and one three times as rough.

    python benchmarks/pitching_body.py [--approaches N] [--seed S]
"""

import argparse
import statistics
import sys
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.robots.pitching_body import GAIT, ROUGH, approaches

GAITS = {"Go2": GAIT, "rough": ROUGH}


def main() -> None:
    """Run the approaches and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--approaches", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    print("| gait | attitude | approaches | touched | refused with 1 m free | left ahead of the front, median, least |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name, gait in GAITS.items():
        for knows_attitude in (True, False):
            began_s = time.process_time()
            counts = approaches(gait, chosen.approaches, knows_attitude=knows_attitude, seed=chosen.seed)
            touched = ", ".join(f"{lane} {number}" for lane, number in Counter(counts.touched).items())
            left = f"{statistics.median(counts.left_m):.2f} m, {min(counts.left_m):.2f} m" if counts.left_m else ""
            print(
                f"| {name} | {'known' if knows_attitude else 'not used'} | {counts.walked} | "
                f"{len(counts.touched)}{f' ({touched})' if touched else ''} | {counts.refused_free} | {left} |",
                flush=True,
            )
            sys.stderr.write(f"{time.process_time() - began_s:.0f} s of processor time\n")


if __name__ == "__main__":
    main()
