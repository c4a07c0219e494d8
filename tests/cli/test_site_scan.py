"""`vsnbench sites scan`: a made scan becomes a site in which trials succeed."""

import hashlib
import json
import math
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import shapely
from typer.testing import CliRunner

from tests.simulator.scan.made_scans import Imperfection, MadeScan, make_scan, write_scan
from vsnbench import open_results
from vsnbench.cli.sites import app
from vsnbench.errors import SiteError, UsageError
from vsnbench.interop.site_file import site_yaml
from vsnbench.simulator.scan.alignment import align_scan
from vsnbench.simulator.scan.comparison import scan_findings
from vsnbench.simulator.scan.reading import read_scan
from vsnbench.sites.site import Room, Site, SiteObject, StartingPosition, Wall, load_site
from vsnbench.web.site_editor.underlay import Underlay

pytest.importorskip("trimesh")


def scanned(*words: str) -> dict[str, object]:
    result = CliRunner().invoke(app, ["scan", *words, "--json"])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    answer: dict[str, object] = json.loads(result.stdout)
    return answer


def furnished() -> Site:
    """Return a room of 5 x 4 m inside walls 10 cm thick, with goals and six starting positions."""
    corners = [(0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0)]
    around = [(-0.05, -0.05), (5.05, -0.05), (5.05, 4.05), (-0.05, 4.05)]
    things = [
        SiteObject(id="table", category="table", position=(3.2, 2.6), size_m=(0.8, 1.2, 0.75)),
        SiteObject(id="bed", category="bed", position=(1.1, 3.2), size_m=(2.0, 1.4, 0.5)),
        SiteObject(id="sofa", category="sofa", position=(4.4, 0.9), heading_deg=180, size_m=(0.9, 1.6, 0.8)),
    ]
    starts = [((0.6, 0.6), 0), ((2.4, 0.8), 90), ((3.2, 0.6), 180)]
    return Site(
        name="room",
        rooms=[Room(name="room", polygon=corners)],
        walls=[Wall(start=around[k], end=around[(k + 1) % 4]) for k in range(4)],
        objects=things,
        starts=[
            StartingPosition(number=number, position=at, heading_deg=heading)
            for number, (at, heading) in enumerate(starts, start=1)
        ],
    )


@dataclass(frozen=True)
class Lab:
    """A site, its scan as an app exports it, and what the import made of it."""

    original: Site
    scan: MadeScan
    scale: float
    path: Path
    """The imported site file."""

    def placement(self) -> tuple[float, npt.NDArray[Any], npt.NDArray[Any]]:
        """Return the turn and the shift that take the original's frame to that of the import, and its vertices."""
        _, to_site = align_scan(read_scan(self.path.with_name("scan.glb")), "y", self.scale)
        vertices = self.scan.mesh.vertices @ to_site[:3, :3].T + to_site[:3, 3]
        return *self.scan.placed(vertices), vertices

    def surveyed(self) -> Site:
        """Return the imported site with the original's objects and starts, as a person draws them over the scan."""
        turn, shift, _ = self.placement()
        degrees = math.degrees(turn)

        def point(at: tuple[float, float]) -> tuple[float, float]:
            x, y = at
            cos, sin = math.cos(turn), math.sin(turn)
            return (round(cos * x - sin * y + float(shift[0]), 3), round(sin * x + cos * y + float(shift[1]), 3))

        def moved(thing: Any, **values: Any) -> Any:
            heading = round(math.remainder(thing.heading_deg + degrees, 360), 2)
            return thing.model_copy(update={"position": point(thing.position), "heading_deg": heading, **values})

        objects = [
            moved(thing, footprint=thing.footprint and [point(corner) for corner in thing.footprint])
            for thing in self.original.objects
        ]
        starts = [moved(start) for start in self.original.starts]
        return load_site(self.path).model_copy(update={"objects": objects, "starts": starts})


def lab_of(original: Site, flaws: Imperfection, folder: Path) -> Lab:
    scan = make_scan(original, flaws)
    write_scan(scan.mesh, folder / "scan.glb")
    length = f"{2.5 * flaws.scale:.4f}=2.5"
    scanned(str(folder / "scan.glb"), str(folder / "lab.yaml"), "--length", length)
    return Lab(original, scan, 2.5 / float(f"{2.5 * flaws.scale:.4f}"), folder / "lab.yaml")


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    """A furnished room, whose scan has a scale of 0.97."""
    flaws = Imperfection(cell_m=0.12, holes=15, scale=0.97)
    return lab_of(furnished(), flaws, tmp_path_factory.mktemp("room"))


def check_recovery(lab: Lab) -> None:
    """The floor within 1 cm and 0.3 degrees, all walls within 5 cm, with a drift of 2 cm in the scan."""
    turn, shift, vertices = lab.placement()
    on_floor = np.abs(lab.scan.truth_m[:, 2]) < 1e-3
    floor = vertices[on_floor]
    slopes, *_ = np.linalg.lstsq(np.column_stack([floor[:, :2], np.ones(len(floor))]), floor[:, 2], rcond=None)
    assert abs(float(floor[:, 2].mean())) < 0.01
    assert math.degrees(math.hypot(*slopes[:2])) < 0.3
    assert abs(math.remainder(math.degrees(turn), 90)) < 0.3
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    rooms = shapely.union_all([room.shape for room in lab.original.rooms])
    proposed = shapely.union_all([wall.shape for wall in load_site(lab.path).walls]).boundary
    for wall in lab.original.walls:
        (x0, y0), (x1, y1) = wall.start, wall.end
        across = np.array([y0 - y1, x1 - x0]) / wall.length_m * wall.thickness_m / 2
        for side in (-1, 1):
            along = np.linspace(0.05, 0.95, 40)[:, None] * (np.array(wall.end) - wall.start) + wall.start
            points = along + side * across
            inside = shapely.contains_xy(rooms, points + side * across * 0.4)
            moved = points[inside] @ rotation.T + shift[:2]
            if len(moved) > 20:
                away = shapely.distance(proposed, shapely.points(moved))
                assert float(np.median(away)) < 0.05, (wall, side)


def test_floor_and_walls_of_an_imperfect_scan_are_recovered(room: Lab) -> None:
    check_recovery(room)
    assert scan_findings(room.surveyed()) == []


def test_the_site_names_the_scan_by_its_hash_and_the_editor_has_it_as_background(room: Lab) -> None:
    site = load_site(room.path)
    assert site.scan is not None
    assert site.scan.sha256 == hashlib.sha256(room.path.with_name("lab.scan.npz").read_bytes()).hexdigest()
    assert site.content()["scan"] == {"sha256": site.scan.sha256}
    assert Site.model_validate(site.content()).sha256 == site.sha256  # in a record and in its bundles
    background = Underlay.load(room.path)
    assert background is not None
    assert background.place.to_scale
    assert {thing.category for thing in site.objects} == {"obstacle"}


def test_the_check_names_where_scan_and_survey_differ(room: Lab) -> None:
    site = room.surveyed()
    wall = site.walls[0]
    along = np.array(wall.end) - wall.start
    shift = np.array([-along[1], along[0]]) / wall.length_m * 0.09
    moved = wall.model_copy(update={name: tuple((getattr(wall, name) + shift).tolist()) for name in ("start", "end")})
    elsewhere = site.objects[0].model_copy(update={"position": site.starts[1].position})
    wrong = site.model_copy(update={"walls": [moved, *site.walls[1:]], "objects": [elsewhere, *site.objects[1:]]})
    found = {finding.code: finding for finding in scan_findings(wrong)}
    assert found["scan-wall"].entries == (("walls", 0),)
    assert found["scan-wall"].amount == pytest.approx(0.09, abs=0.04)
    assert found["scan-object"].entries == (("objects", 0),)
    assert "scan-unsurveyed" in found


def test_nothing_is_written_when_a_scan_cannot_be_used(tmp_path: Path) -> None:
    path = tmp_path / "scan.ply"
    path.write_bytes(b"ply\nformat ascii 1.0\nend_header\n")
    with pytest.raises(SiteError):
        scanned(str(path), str(tmp_path / "lab.yaml"))
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    "words",
    [("lab.txt",), ("lab.yaml", "--unit", "parsec"), ("lab.yaml", "--up", "north"), ("lab.yaml", "--length", "3")],
)
def test_wrong_options_are_refused_before_the_scan_is_read(words: tuple[str, ...]) -> None:
    with pytest.raises(UsageError):
        scanned("none.glb", *words)


def test_trials_in_the_scan_succeed(room: Lab, tmp_path: Path) -> None:
    check_trials(room, tmp_path)


def check_trials(lab: Lab, results: Path) -> None:
    path = lab.path.with_name("surveyed.yaml")
    path.write_text(site_yaml(lab.surveyed()), encoding="utf-8")
    run = (sys.executable, "-m", "vsnbench", "run", "--model", "oracle", "--goal", "all")
    done = subprocess.run(
        [*run, "--site", path, "--results", results / "results", "--quiet", "--json"],
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    episodes = open_results(results / "results").episodes()
    assert len(episodes) > 0
    assert episodes["success"].all()


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_the_apartment_is_recovered_from_its_scan_and_all_trials_succeed(tmp_path: Path) -> None:
    lab = lab_of(load_site("apartment"), Imperfection(scale=0.97), tmp_path)
    check_recovery(lab)
    check_trials(lab, tmp_path)
