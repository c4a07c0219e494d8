"""Whether the oracle solves points, routes and sequences of five goals, in the apartment and in generated flats.

    python benchmarks/sequences.py --sites apartment flat:1 flat:2 flat:3 --starts 1-3 --directory build/sequences

Each site gets two points, a route of three photographs that an episode of the oracle has taken, and two sequences of
five goals: categories, words, the points and the route. The campaigns are those of `vsnbench run`. Prints a line for
each site and kind of goal, and exits with 1 unless every trial succeeds.
"""

import argparse
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import yaml

from vsnbench import open_results
from vsnbench.runner.setup.selection import named_site
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.sites.site import Site, load_site
from vsnbench.sites.targets import kind_of

POINTS = ("first-point", "second-point")


def run(site: Path, goals: str, starts: str, results: Path) -> None:
    """Run the oracle's trials of some goals."""
    command = [
        sys.executable,
        "-m",
        "vsnbench",
        "run",
        "--model",
        "oracle",
        "--robot",
        "simulated",
        "--site",
        str(site),
    ]
    subprocess.run([*command, "--goal", goals, "--starts", starts, "--results", str(results)], check=True)


def with_goals(site: Site, directory: Path, goals: list[dict[str, Any]]) -> Path:
    """Write a site with goals to a file."""
    path = directory / "site.yaml"
    path.write_text(yaml.safe_dump({**site.content(), "goals": goals}, sort_keys=False), encoding="utf-8")
    return path


def goals_of(site: Site, photographs: list[str]) -> list[dict[str, Any]]:
    """Return two points, a route, a goal in words and two sequences for a site."""
    present = [name for name in GOAL_CATEGORIES if site.instances(name)]
    first, second, third = present[:3]
    points = [
        {"id": name, "kind": "point", "targets": [{"point": list(start.position)}]}
        for name, start in zip(POINTS, site.starts[-2:], strict=True)
    ]
    words = {"id": "in-words", "kind": "text", "text": f"any {third}", "targets": [{"category": third}]}
    route = {"id": "route", "kind": "route", "images": photographs, "targets": [{"category": first}]}
    orders = {
        "first-sequence": [first, POINTS[0], "in-words", "route", second],
        "second-sequence": ["route", second, POINTS[1], first, "in-words"],
    }
    sequences = [{"id": name, "kind": "sequence", "goals": order} for name, order in orders.items()]
    return [*points, words, route, *sequences]


def photographs_of(site: Site, directory: Path) -> list[str]:
    """Copy the first, middle and last image of an episode to the route's goal next to the site; return their names."""
    first = next(goal for goal in GOAL_CATEGORIES if site.instances(goal))
    run(with_goals(site, directory, []), first, "1", directory / "photographs")
    images = sorted((directory / "photographs").glob("episodes/*/rgb/*.jpg"))
    chosen = (images[0], images[len(images) // 2], images[-1])
    return [shutil.copy(image, directory / f"{number}.jpg").name for number, image in enumerate(chosen, start=1)]


def main() -> int:
    """Run the trials of all sites, and print the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sites", nargs="+", default=["apartment", "flat:1", "flat:2", "flat:3"])
    parser.add_argument("--starts", default="1-3")
    parser.add_argument("--directory", type=Path, default=Path("build/sequences"))
    chosen = parser.parse_args()
    solved = True
    for name in chosen.sites:
        directory = chosen.directory / name.replace(":", "-")
        directory.mkdir(parents=True)
        site = named_site(name)
        path = with_goals(site, directory, goals_of(site, photographs_of(site, directory)))
        surveyed = load_site(path)
        run(path, ",".join(goal.id for goal in surveyed.goals), chosen.starts, directory / "results")
        episodes = open_results(directory / "results").episodes()
        kinds = episodes["goal"].map(lambda goal, at=surveyed: kind_of(at, goal).value)
        for kind, mine in episodes.groupby(kinds, observed=True):
            print(f"{name:10} {kind:9} {int(mine['success'].sum())}/{len(mine)}", flush=True)
            solved &= bool(mine["success"].all())
    return 0 if solved else 1


if __name__ == "__main__":
    sys.exit(main())
