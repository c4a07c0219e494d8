"""How well detectors that never saw the simulator recognise its goal objects.

Views of generated flats from free poses of the Turtlebot 2: for each of the seven goal categories, 1 to 4.5 m away,
half of them with the whole goal in the image and half with it cut by the edge or partly hidden; and views without a
goal. A goal is recognised if a box of its COCO class with a score of at least 0.25 overlaps the box of its visible
pixels by at least 0.3 (intersection over union); boxes end at the image's edge. A box of a goal's class that overlaps
no visible object of that class by 0.3 is a false goal detection, in any view; every such box counts. The views follow
from the seeds. A fifth of the seeds is for the final figure only.

    python benchmarks/realism.py [--views 700] [--held-out | --apartment] [--detector FILE ...] [--jobs 4]
                                 [--json FILE] [--before FILE] [--picture FILE]

The default detectors are in the directory of weights: `vsnbench models fetch coco-detector` stores the first, and
benchmarks/support/ssd_conversion.py writes the second.
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.support.coco_network import Found, Network
from benchmarks.support.goal_views import CLASS_OF_CATEGORY, Extent, Flat, View, goal_views, views_without_goal
from benchmarks.support.recognition import (
    LEAST_SCORE,
    Recognition,
    confusions,
    false_kinds,
    false_per_image,
    is_false,
    recall,
    recognise,
)
from vsnbench.models.checkpoints.weights import weights_directory
from vsnbench.models.vlv.detectors.choosing import ONNX_FILE
from vsnbench.runtime.threads import compute_with_one_thread
from vsnbench.simulator.generated_sites.generate import generate_site
from vsnbench.sites.site import load_site

DETECTORS = (weights_directory() / ONNX_FILE, weights_directory() / "ssd.onnx")
SEEDS = range(9400, 10_000)
"""In no split of training, validation and test."""
HELD_OUT = 5
"""Every fifth seed is for the final figure only."""
CATEGORIES = tuple(CLASS_OF_CATEGORY)
GOAL_VIEWS = 2 * len(CATEGORIES)
"""Views with a goal in one flat: one whole and one cut for each category."""
MOST_VIEWS = len(SEEDS) // HELD_OUT * GOAL_VIEWS
OTHER_VIEWS = 6
"""Views without a goal in one flat."""
PICTURED_FLATS = 3

Figures = dict[str, Any]
Image = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Task:
    """Views of one site, for a worker process."""

    site: str
    """Name of a site; empty for the generated flat of the seed."""
    seed: int
    """Decides the poses, too."""
    detectors: tuple[Path, ...]
    pictured: bool


@dataclass(frozen=True, slots=True)
class Measured:
    """What all detectors found in the views of a site."""

    rows: tuple[tuple[Recognition, ...], ...]
    """Views, then detectors."""
    pictures: tuple[Image, ...]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=700, help="views with a goal; 3 more without for every 7")
    parser.add_argument("--held-out", action="store_true", help="the seeds for the final figure only")
    parser.add_argument("--apartment", action="store_true", help="the embedded apartment instead of generated flats")
    parser.add_argument("--detector", type=Path, nargs="+", default=DETECTORS)
    parser.add_argument("--jobs", type=int, default=4, help="worker processes")
    parser.add_argument("--json", type=Path, help="file of figures; this run's are added to it")
    parser.add_argument("--before", type=Path, help="file of earlier figures, for the columns `before`")
    parser.add_argument("--picture", type=Path, help="contact sheet with the first detector's boxes")
    options = parser.parse_args()
    for path in [*options.detector, *filter(None, [options.before])]:
        if not path.is_file():
            parser.error(f"no file {path}; the first lines of {Path(__file__).name} say where detectors come from")
    if not 0 < options.views <= MOST_VIEWS:
        parser.error(f"--views is 1 to {MOST_VIEWS}")
    flats = -(-options.views // GOAL_VIEWS)
    detectors = tuple(options.detector)
    site = "apartment" if options.apartment else ""
    pictured = PICTURED_FLATS if options.picture else 0
    tasks = [
        Task(site, seed, detectors, pictured=k < pictured) for k, seed in enumerate(seeds(held_out=options.held_out))
    ]
    rows, pictures = collect(tasks, flats, options.jobs)
    titles = [Network(path).title for path in detectors]
    measured = {title: figures_of([row[k] for row in rows]) for k, title in enumerate(titles)}
    kind = "apartment" if options.apartment else "held out" if options.held_out else "default"
    before = json.loads(options.before.read_text(encoding="utf-8")).get(kind, {}) if options.before else {}
    print(as_markdown(measured, before))
    if options.json:
        known = json.loads(options.json.read_text(encoding="utf-8")) if options.json.exists() else {}
        options.json.write_text(json.dumps(known | {kind: measured}, indent=1) + "\n", encoding="utf-8")
    if options.picture:
        cv2.imwrite(str(options.picture), contact_sheet(pictures))


def seeds(*, held_out: bool) -> list[int]:
    """Return the seeds of flats in the order in which they are used."""
    return [seed for seed in SEEDS if (seed % HELD_OUT == HELD_OUT - 1) == held_out]


def collect(tasks: Sequence[Task], flats: int, jobs: int) -> tuple[list[tuple[Recognition, ...]], list[Image]]:
    """Measure sites until each kind of view is complete: `flats` views, or `OTHER_VIEWS` times as many without goal."""
    rows: list[tuple[Recognition, ...]] = []
    pictures: list[Image] = []
    had: Counter[tuple[str | None, Extent | None]] = Counter()
    kinds = {(category, extent): flats for category in CATEGORIES for extent in Extent} | {
        (None, None): OTHER_VIEWS * flats
    }
    with ProcessPoolExecutor(jobs) as pool:
        started = [pool.submit(measure, task) for task in tasks[:flats]]
        following = iter(tasks[flats:])
        while started:
            measured = started.pop(0).result()
            pictures += measured.pictures
            for row in measured.rows:
                kind = (row[0].goal, row[0].extent)
                if had[kind] < kinds[kind]:
                    had[kind] += 1
                    rows.append(row)
            if not started and any(had[kind] < count for kind, count in kinds.items()):
                started += [pool.submit(measure, task) for _, task in zip(range(jobs), following, strict=False)]
            print(f"\r{len(rows)}/{sum(kinds.values())} views", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return rows, pictures


@cache
def network(path: Path) -> Network:
    return Network(path)


def measure(task: Task) -> Measured:
    """Render the views of a site and run the detectors on them."""
    compute_with_one_thread()
    flat = Flat(load_site(task.site) if task.site else generate_site(task.seed))
    rows, pictures = [], []
    for view in views_of(flat, task.seed):
        height, width = view.rgb.shape[:2]
        found = [
            [item.within(width, height) for item in network(path).find(view.rgb, LEAST_SCORE)]
            for path in task.detectors
        ]
        rows.append(tuple(recognise(view.objects, view.goal, view.extent, boxes) for boxes in found))
        if task.pictured and view.goal:
            pictures.append(drawn(view, found[0], rows[-1][0]))
    return Measured(tuple(rows), tuple(pictures))


def views_of(flat: Flat, seed: int) -> Iterator[View]:
    """Yield the views of a site; those of a category do not depend on the other categories."""
    for k, category in enumerate(CATEGORIES):
        yield from goal_views(flat, category, 1, np.random.default_rng([8, seed, k]))
    yield from views_without_goal(flat, OTHER_VIEWS, np.random.default_rng([9, seed]))


def drawn(view: View, found: Sequence[Found], row: Recognition) -> Image:
    """Draw the goal white, boxes of goals' classes green if correct and red if false, and other boxes grey."""
    image = view.rgb[..., ::-1].copy()
    for item in found:
        if item.label not in CLASS_OF_CATEGORY.values():
            colour = (150, 150, 150)
        else:
            colour = (50, 50, 230) if is_false(item, view.objects) else (60, 180, 60)
        outline(image, item.box, f"{item.label} {item.score:.2f}", colour)
    if view.goal:
        outline(image, view.goal.box, "" if row.recognised else f"MISSED {view.goal.category}", (255, 255, 255))
    return cv2.resize(image, (320, 240), interpolation=cv2.INTER_AREA)


def outline(image: Image, box: tuple[float, ...], text: str, colour: tuple[int, int, int]) -> None:
    left, top, right, bottom = map(round, box)
    cv2.rectangle(image, (left, top), (right, bottom), colour, 3)
    cv2.putText(image, text, (left + 6, max(top, 0) + 26), cv2.FONT_HERSHEY_SIMPLEX, 0.8, colour, 2)


def contact_sheet(pictures: Sequence[Image]) -> Image:
    """Return the pictures in rows of seven."""
    blank = np.zeros((240, 320, 3), np.uint8)
    cells = [*pictures, *[blank] * (-len(pictures) % len(CATEGORIES))]
    return np.vstack([np.hstack(cells[k : k + len(CATEGORIES)]) for k in range(0, len(cells), len(CATEGORIES))])


def figures_of(rows: Sequence[Recognition]) -> Figures:
    """Return the figures of a detector."""
    without = [row for row in rows if row.goal is None]
    cells = {category: {extent: recall(rows, category, extent) for extent in Extent} for category in CATEGORIES}
    return {
        "recall": {
            category: {extent.value: [cell.recognised, cell.views] for extent, cell in row.items()}
            for category, row in cells.items()
        },
        "confusions": {category: dict(confusions(rows, category).most_common(4)) for category in CATEGORIES},
        "views": len(rows),
        "views_without_goal": len(without),
        "false_per_image": round(false_per_image(rows), 3),
        "false_per_image_without_goal": round(false_per_image(without), 3),
        "false_kinds": [f"{label} on {thing} {count}" for (label, thing), count in false_kinds(rows).most_common(8)],
    }


def as_markdown(measured: Mapping[str, Figures], before: Mapping[str, Figures]) -> str:
    """Return a table for each detector, with columns of earlier figures if there are any."""
    lines = []
    for title, figures in measured.items():
        sources = [source for source in (before.get(title), figures) if source]
        when = ["before", "after"] if len(sources) == 2 else [""]
        heads = [f"{extent.value} {word}".strip() for extent in Extent for word in when]
        lines += [f"### {title}", "", f"| category | {' | '.join(heads)} | the missed are called |"]
        lines.append("| --- " * (len(heads) + 2) + "|")
        for category in CATEGORIES:
            shares = [_share(source["recall"][category][extent.value]) for extent in Extent for source in sources]
            called = ", ".join(f"{label} {count}" for label, count in figures["confusions"][category].items())
            lines.append(f"| {category} | {' | '.join(shares)} | {called or '–'} |")
        lines.append("")
        for word, source in zip(when, sources, strict=True):
            lines.append(
                f"False goal detections {word}".strip() + f": {source['false_per_image']:.2f} per image in "
                f"{source['views']} views, {source['false_per_image_without_goal']:.2f} in the "
                f"{source['views_without_goal']} without a goal. Most frequent (class on what): "
                + f"{', '.join(source['false_kinds'])}.\n"
            )
    return "\n".join(lines)


def _share(cell: Sequence[int]) -> str:
    recognised, views = cell
    return f"{recognised / views:.0%} ({recognised}/{views})" if views else "–"


if __name__ == "__main__":
    main()
