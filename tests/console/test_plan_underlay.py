"""What lies under a plan: read from files, kept beside the site, and refused in a line."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from vsnbench.console.plan_underlay import Underlay
from vsnbench.console.site_editor import SiteEditor
from vsnbench.errors import UsageError
from vsnbench.robots.profiles import load_profile


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    pixels = np.full((60, 80), 255, np.uint8)
    cv2.rectangle(pixels, (10, 10), (70, 50), 0, 2)
    path = tmp_path / "plan.png"
    cv2.imwrite(str(path), pixels)
    return path


def test_it_is_kept_beside_the_site_with_its_place_and_forgotten_again(tmp_path: Path, picture: Path) -> None:
    site = tmp_path / "lab.yaml"
    assert Underlay.kept(site) is None
    said = Underlay.of_file(picture).content() | {"x_m": 1.5, "heading_rad": 0.3, "to_scale": True}
    laid = Underlay.of_file(picture).placed(said)
    laid.keep(site)
    assert Underlay.kept(site) == laid
    assert {path.name for path in tmp_path.iterdir()} == {"plan.png", "lab.underlay.json", "lab.underlay.png"}
    Underlay.forget(site)
    assert Underlay.kept(site) is None
    assert [path.name for path in tmp_path.iterdir()] == ["plan.png"]


def test_the_same_picture_named_again_lies_where_it_was_kept_and_another_replaces_it(
    tmp_path: Path, picture: Path
) -> None:
    site, profile = tmp_path / "lab.yaml", load_profile("turtlebot2")
    first = Underlay.of_file(picture)
    first.placed(first.content() | {"x_m": 1.5}).keep(site)

    def laid_under(given: Underlay | None) -> Underlay | None:
        return SiteEditor(site, profile, given)._underlay

    assert (again := laid_under(first)) is not None
    assert again.place.x_m == 1.5
    assert (kept := laid_under(None)) is not None
    assert kept.place.x_m == 1.5
    cv2.imwrite(str(picture), np.zeros((30, 30), np.uint8))
    assert (other := laid_under(Underlay.of_file(picture))) is not None
    assert other.place.x_m == 0.0


def written_map(folder: Path, unknown: int, free: int, occupied: int, mode: str) -> Path:
    cells = np.full((60, 80), unknown, np.uint8)
    cv2.rectangle(cells, (10, 10), (70, 50), free, -1)
    cv2.rectangle(cells, (10, 10), (70, 50), occupied, 2)
    cv2.imwrite(str(folder / "map.pgm"), cells)
    (folder / "map.yaml").write_text(f"image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nmode: {mode}\n")
    return folder / "map.yaml"


def test_a_map_in_raw_mode_shows_its_walls(tmp_path: Path) -> None:
    assert len(Underlay.of_file(written_map(tmp_path, 255, 0, 100, "raw")).place.lines) == 4


def test_a_map_that_is_read_in_the_wrong_mode_says_so(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"nothing in the map map\.yaml is occupied"):
        Underlay.of_file(written_map(tmp_path, 205, 254, 0, "raw"))


@pytest.mark.parametrize(
    ("field", "value"),
    [("x_m", float("nan")), ("width_m", 0), ("height_m", 1e9), ("lines", [{"start": [0, 0]}]), ("name", 3)],
)
def test_a_place_that_is_none_is_refused(picture: Path, field: str, value: object) -> None:
    laid = Underlay.of_file(picture)
    with pytest.raises(UsageError, match=f"the underlay's {field}"):
        laid.placed(laid.content() | {field: value})


@pytest.mark.parametrize("broken", ["lab.underlay.json", "lab.underlay.png"])
@pytest.mark.parametrize("content", [b"", b"[]", b"\x00\xff"])
def test_what_was_kept_and_is_broken_says_what_to_remove(
    tmp_path: Path, picture: Path, broken: str, content: bytes
) -> None:
    site = tmp_path / "lab.yaml"
    Underlay.of_file(picture).keep(site)
    (tmp_path / broken).write_bytes(content)
    with pytest.raises(UsageError, match=r"remove .*lab\.underlay\.json to begin without an underlay"):
        Underlay.kept(site)
