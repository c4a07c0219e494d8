"""Underlays: read from maps and images, and saved next to the site file."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from vsnbench.errors import UsageError
from vsnbench.robots.profiles import load_profile
from vsnbench.web.site_editor.editor import SiteEditor
from vsnbench.web.site_editor.underlay import Underlay


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    pixels = np.full((60, 80), 255, np.uint8)
    cv2.rectangle(pixels, (10, 10), (70, 50), 0, 2)
    path = tmp_path / "plan.png"
    cv2.imwrite(str(path), pixels)
    return path


def test_an_underlay_is_saved_with_its_place_and_deleted(tmp_path: Path, picture: Path) -> None:
    site = tmp_path / "lab.yaml"
    assert Underlay.load(site) is None
    place = Underlay.of_file(picture).content() | {"x_m": 1.5, "heading_rad": 0.3, "to_scale": True}
    underlay = Underlay.of_file(picture).at_place(place)
    underlay.save(site)
    assert Underlay.load(site) == underlay
    assert {path.name for path in tmp_path.iterdir()} == {"plan.png", "lab.underlay.json", "lab.underlay.png"}
    Underlay.delete(site)
    assert Underlay.load(site) is None
    assert [path.name for path in tmp_path.iterdir()] == ["plan.png"]


def test_the_same_image_keeps_its_saved_place_and_another_replaces_it(tmp_path: Path, picture: Path) -> None:
    site, profile = tmp_path / "lab.yaml", load_profile("turtlebot2")
    first = Underlay.of_file(picture)
    first.at_place(first.content() | {"x_m": 1.5}).save(site)

    def initial(given: Underlay | None) -> Underlay | None:
        return SiteEditor(site, profile, given)._underlay

    assert (again := initial(first)) is not None
    assert again.place.x_m == 1.5
    assert (saved := initial(None)) is not None
    assert saved.place.x_m == 1.5
    cv2.imwrite(str(picture), np.zeros((30, 30), np.uint8))
    assert (other := initial(Underlay.of_file(picture))) is not None
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


def test_a_map_without_occupied_cells_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError) as error:
        Underlay.of_file(written_map(tmp_path, 205, 254, 0, "raw"))
    assert error.value.code == "empty-map"


@pytest.mark.parametrize(
    ("field", "value"),
    [("x_m", float("nan")), ("width_m", 0), ("height_m", 1e9), ("lines", [{"start": [0, 0]}]), ("name", 3)],
)
def test_an_invalid_place_is_refused(picture: Path, field: str, value: object) -> None:
    underlay = Underlay.of_file(picture)
    with pytest.raises(UsageError, match=field):
        underlay.at_place(underlay.content() | {field: value})


@pytest.mark.parametrize("broken", ["lab.underlay.json", "lab.underlay.png"])
@pytest.mark.parametrize("content", [b"", b"[]", b"\x00\xff"])
def test_a_broken_saved_underlay_names_the_file_to_remove(
    tmp_path: Path, picture: Path, broken: str, content: bytes
) -> None:
    site = tmp_path / "lab.yaml"
    Underlay.of_file(picture).save(site)
    (tmp_path / broken).write_bytes(content)
    with pytest.raises(UsageError) as error:
        Underlay.load(site)
    assert error.value.code == "invalid-underlay"
    assert "lab.underlay.json" in error.value.advice
