"""Measures agreement (Cohen's kappa) of the failure taxonomy with a human rater.

    python benchmarks/failure_taxonomy.py pictures RECORD DIR     draws 60 failures, chosen at random, 6 to a picture
    python benchmarks/failure_taxonomy.py score RECORD LABELS     kappa of LABELS (episode,kind per line) and program

RECORD is a results directory. Each picture shows the floor plan with the goal in colour and the region where STOP
succeeds, the path from light to dark with a short line for the heading after each action, a cross at each action that
the guard blocked, and the end reason. It does not show the program's classification.
"""

import argparse
import csv
import itertools
import sys
from collections import Counter
from pathlib import Path

import numpy as np

from vsnbench.protocol.judge import success_region
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.courses import site_of
from vsnbench.report.analysis.failures import FailureKind, failure_kinds
from vsnbench.report.analysis.reading import read_courses
from vsnbench.report.build import read
from vsnbench.report.plan.floor_plan import PlanStyle, draw_floor_plan
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.schema.migrate import open_record

COUNT, PER_PICTURE, RESAMPLES = 60, 6, 10_000


def pictures(record_path: Path, directory: Path) -> None:
    """Draw the failures that the rater classifies."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    directory.mkdir(parents=True, exist_ok=True)
    url = sqlite_url(record_path / "vsnbench.db")
    record = read(url, Selection())
    rows = record.counted()
    rows = rows[~rows["success"]]
    chosen = rows.iloc[np.sort(np.random.default_rng(0).permutation(len(rows))[:COUNT])]
    conditions = {condition.number: condition for condition in record.conditions}
    with open_record(url) as engine:
        courses = read_courses(engine, [int(number) for number in chosen["episode"]])
    for page in range(0, len(chosen), PER_PICTURE):
        figure = Figure(figsize=(16, 11), dpi=80, layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.subplots(2, 3).flat
        for axes, (_, row) in zip(grid, chosen.iloc[page : page + PER_PICTURE].iterrows(), strict=False):
            condition, course = conditions[row["condition"]], courses[int(row["episode"])]
            site, goal = site_of(record, condition), str(row["goal"])
            rules = ProtocolParameters.from_record(condition.protocol)
            style = PlanStyle(
                labels=False,
                room_names=False,
                scale_bar=False,
                legend=False,
                starts=False,
                highlight=goal,
                success=success_region(site, goal, rules),
            )
            draw_floor_plan(site, axes, style)
            xs, ys = ([pose.position[axis] for pose in course.poses] for axis in (0, 1))
            shade = np.linspace(0, 1, len(xs))
            axes.scatter(xs, ys, c=shade, cmap="viridis_r", s=14, zorder=12)
            axes.plot(xs, ys, color="#555555", linewidth=0.7, zorder=11)
            for pose in course.poses:
                end = (pose.x_m + 0.18 * np.cos(pose.heading_rad), pose.y_m + 0.18 * np.sin(pose.heading_rad))
                axes.plot([pose.x_m, end[0]], [pose.y_m, end[1]], color="#b00020", linewidth=0.5, zorder=12)
            for blocked, pose in zip(course.blocked, course.poses[1:], strict=False):
                if blocked:
                    axes.plot(*pose.position, "x", color="#ff0000", markersize=7, zorder=14)
            axes.plot(xs[0], ys[0], "o", color="white", markeredgecolor="black", markersize=8, zorder=13)
            axes.plot(xs[-1], ys[-1], "*", color="black", markersize=11, zorder=15)
            last = course.poses[-30:]
            turns = sum(abs(b.heading_rad - a.heading_rad) > 0.1 for a, b in itertools.pairwise(last))
            axes.set_title(
                f"#{row['episode']}  {goal}  {row['end_reason']}  {row['actions']} actions, "
                f"{sum(course.blocked)} blocked ({sum(course.blocked[-30:])} of last 30; {turns} turns in last 30)",
                fontsize=9,
            )
        figure.savefig(directory / f"page-{page // PER_PICTURE + 1:02d}.png")


def kappa(first: list[str], second: list[str]) -> float:
    """Return Cohen's kappa of two raters."""
    n = len(first)
    same = sum(a == b for a, b in zip(first, second, strict=True)) / n
    ours, theirs = Counter(first), Counter(second)
    chance = sum(ours[kind] * theirs[kind] for kind in ours) / n**2
    return (same - chance) / (1 - chance) if chance < 1 else 1.0


def score(record_path: Path, labels: Path) -> None:
    """Print the agreement of the rater and the program."""
    with labels.open(encoding="utf-8") as file:
        by_hand = {int(row["episode"]): FailureKind(row["kind"]).value for row in csv.DictReader(file)}
    url = sqlite_url(record_path / "vsnbench.db")
    record = read(url, Selection())
    with open_record(url) as engine:
        program = {number: kind.value for number, kind in failure_kinds(engine, record) if number in by_hand}
    hand, ours = ([kinds[number] for number in by_hand] for kinds in (by_hand, program))
    random = np.random.default_rng(0)
    draws = random.integers(0, len(hand), (RESAMPLES, len(hand)))
    low, high = np.quantile([kappa([hand[i] for i in draw], [ours[i] for i in draw]) for draw in draws], [0.025, 0.975])
    same = sum(a == b for a, b in zip(hand, ours, strict=True))
    print(f"{same} of {len(hand)} the same; kappa {kappa(hand, ours):.2f} [{low:.2f}, {high:.2f}]")
    print("\n| by hand | by the program | episodes |\n| --- | --- | --- |")
    pairs = Counter(zip(hand, ours, strict=True))
    for (mine, theirs), _ in pairs.most_common():
        numbers = [str(n) for n in by_hand if (by_hand[n], program[n]) == (mine, theirs)]
        print(f"| {mine} | {theirs} | {len(numbers)}: {', '.join(numbers)} |")


def main() -> None:
    """Draw the pictures or compute the score."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("pictures", "score"))
    parser.add_argument("record", type=Path)
    parser.add_argument("target", type=Path, help="output directory of the pictures, or file with the labels")
    options = parser.parse_args()
    {"pictures": pictures, "score": score}[options.what](options.record, options.target)


if __name__ == "__main__":
    sys.exit(main())
