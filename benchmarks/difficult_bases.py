"""Movements on bases that are late, sluggish, noisy, deaf to slow commands or drift, judged by the base's true poses.

    python benchmarks/difficult_bases.py --count 100 --workers 2 > rows.md

The real mover and control law drive the real simulated base in virtual time, so that load plays no part. Each row is
one base; each kind of movement is tried `--count` times with the same movements on every base. "time" is the mean ratio
to the time of an ideal base, and "95 %" its percentile.

"true" counts movements that were answered True and that are true: a turn within 0.1 degrees, a move within 5 mm, the
actions of a session likewise, with their turns measured from the heading of the first, the other kinds within 15 mm and
10 degrees of the direction of their end. "refused" counts those that did not begin because the noise of the odometry is
too large for the tolerance, which `doctor --move` also reports. "failed" counts those that
moved and were answered False.
"""

import argparse
import random
import sys
from collections import Counter
from collections.abc import Iterator
from itertools import product
from multiprocessing import Pool
from pathlib import Path
from statistics import mean

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.sensing.stand import KINDS, Trial, movements, stand_for, trial
from vsnbench.values.robot_profile import BaseDynamics

LATE = {"dead_time_s": 0.05, "motor_time_constant_s": 0.08}
NOISES = [(0.0, 0.0), (0.001, 0.03), (0.002, 0.05), (0.002, 0.1)]
DEADBANDS = [(0.0, 0.0), (0.02, 0.04), (0.05, 0.1)]
DEAD_TIMES_S, LAGS_S, RATES_HZ, CRABS = [0.0, 0.05, 0.1, 0.15], [0.02, 0.08, 0.2], [10.0, 20.0, 50.0], [0.0, 0.01, 0.02]
Row = tuple[str, dict[str, float]]


def rows(drawn: int) -> Iterator[Row]:
    """One property at a time around a late base, then bases drawn from the whole grid."""
    yield "ideal", {}
    yield "dead time 50 ms, motor 80 ms (late)", LATE
    for dead_time_s, lag_s in product(DEAD_TIMES_S, LAGS_S):
        if (dead_time_s, lag_s) != (0.05, 0.08):
            name = f"dead time {dead_time_s * 1000:.0f} ms, motor {lag_s * 1000:.0f} ms"
            yield name, {"dead_time_s": dead_time_s, "motor_time_constant_s": lag_s}
    for rate_hz in RATES_HZ[:-1]:
        yield f"late, odometry {rate_hz:.0f} Hz", LATE | {"odometry_rate_hz": rate_hz}
    for position_m, heading_deg in NOISES[1:]:
        noise = {"position_noise_m": position_m, "heading_noise_deg": heading_deg}
        yield f"late, noise {position_m * 1000:.0f} mm, {heading_deg:g}°", LATE | noise
    yield "heading noise 0.04° beside exact wheels", {"heading_noise_deg": 0.04}
    for crab in CRABS[1:]:
        yield f"late, crab {crab:.0%}", LATE | {"crab": crab}
    for linear_m_s, angular_rad_s in DEADBANDS[1:]:
        deadband = {"deadband_m_s": linear_m_s, "deadband_rad_s": angular_rad_s}
        yield f"late, deadband {linear_m_s * 100:.0f} cm/s, {angular_rad_s:g} rad/s", LATE | deadband
    yield "late, gait: sway 8 mm at 2.5 Hz, crab 1 %", LATE | {"sway_m": 0.008, "sway_hz": 2.5, "crab": 0.01}
    choice = random.Random(1)
    for number in range(drawn):
        position_m, heading_deg = choice.choice(NOISES)
        linear_m_s, angular_rad_s = choice.choice(DEADBANDS)
        base = {
            "dead_time_s": choice.choice(DEAD_TIMES_S),
            "motor_time_constant_s": choice.choice(LAGS_S),
            "odometry_rate_hz": choice.choice(RATES_HZ),
            "crab": choice.choice(CRABS),
            "position_noise_m": position_m,
            "heading_noise_deg": heading_deg,
            "deadband_m_s": linear_m_s,
            "deadband_rad_s": angular_rad_s,
        }
        what = ", ".join(f"{name} {value:g}" for name, value in base.items() if value)
        yield f"drawn {number + 1}: {what}", base


def measured(work: tuple[str, dict[str, float], str, int]) -> tuple[str, str, list[Trial]]:
    """Try one kind of movement on one base."""
    name, base, kind, count = work
    stand = stand_for(kind, BaseDynamics(**base))
    return name, kind, [trial(stand, kind, movement) for movement in movements(kind, count, seed=1)]


def line(name: str, kind: str, tried: list[Trial], ideal: list[Trial]) -> str:
    """Return the row of a table."""
    answered = [(one, other) for one, other in zip(tried, ideal, strict=True) if one.result.completed]
    reasons = Counter(one.result.failure for one in tried if not one.result.completed)
    refused = sum(count for reason, count in reasons.items() if reason.startswith("odometry noise"))
    true = sum(one.is_true(kind) for one, _ in answered)
    ratios = sorted(one.took_s / other.took_s for one, other in answered)
    worst_mm = max((one.off_m * 1000 for one, _ in answered), default=0.0)
    times = f"{mean(ratios):.2f} | {ratios[int(0.95 * (len(ratios) - 1))]:.2f}" if ratios else "– | –"
    said = sorted({reason.partition(":")[0] for reason in reasons if not reason.startswith("odometry noise")})
    failed = len(tried) - len(answered) - refused
    false = len(answered) - true
    backwards = sum(not one.faces for one, _ in answered if kind not in ("turn", "move", "session"))
    counts = f"{true} | {false} | {backwards} | {refused} | {failed}"
    return f"| {name} | {kind} | {counts} | {times} | {worst_mm:.1f} | {'; '.join(said)} |"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--count", type=int, default=100, help="movements of each kind on each base")
    options.add_argument("--drawn", type=int, default=12, help="bases drawn from the whole grid")
    options.add_argument("--workers", type=int, default=2)
    chosen = options.parse_args()
    columns = "true", "True, not true", "facing away", "refused", "failed", "time", "95 %", "worst mm", "reasons"
    print(f"| base | movement | {' | '.join(columns)} |")
    print("| --- " * (2 + len(columns)) + "|")
    ideal: dict[str, list[Trial]] = {}
    with Pool(chosen.workers) as pool:
        works = [(*row, kind, chosen.count) for row in rows(chosen.drawn) for kind in KINDS]
        for name, kind, tried in pool.imap(measured, works):
            ideal.setdefault(kind, tried)
            print(line(name, kind, tried, ideal[kind]), flush=True)


if __name__ == "__main__":
    main()
