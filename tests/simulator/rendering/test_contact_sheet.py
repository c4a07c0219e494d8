from pathlib import Path

import numpy as np
import pytest

from tests.simulator.scenery import a_site
from vsnbench.simulator.rendering.contact_sheet import contact_sheet, save_image
from vsnbench.sites.site import Site, SiteObject


@pytest.fixture(scope="module")
def site() -> Site:
    return a_site(
        SiteObject(id="a", category="chair", position=(2, 1), size_m=(0.5, 0.5, 0.9), color="#ff0000"),
        SiteObject(id="b", category="chair", position=(4, 1), size_m=(0.5, 0.5, 0.9)),
        SiteObject(id="c", category="bed", position=(4.5, 3), size_m=(2, 1.4, 0.6)),
    )


def test_a_sheet_has_a_view_for_rooms_and_for_one_thing_of_each_kind(site: Site) -> None:
    sheet = contact_sheet(site, columns=2, width=96, height=72)
    views = sheet.reshape(-1, 72 + 22, 2, 96, 3).swapaxes(1, 2).reshape(-1, 72 + 22, 96, 3)
    filled = [view for view in views if view[:70, :90].std() > 5]
    assert len(filled) == 2 + 2  # 24 square metres: two views of the room; a bed, a chair


def test_the_close_up_of_the_red_chair_shows_red(site: Site) -> None:
    sheet = contact_sheet(site, columns=1, width=96, height=72).astype(int)
    chair = sheet[3 * 94 : 3 * 94 + 72]
    red = (chair[..., 0] > 2 * chair[..., 1]) & (chair[..., 0] > 60)
    assert red.mean() > 0.02


def test_a_sheet_is_the_same_every_time(site: Site) -> None:
    first, second = (contact_sheet(site, columns=2, width=48, height=36) for _ in range(2))
    assert np.array_equal(first, second)


def test_a_saved_sheet_reads_back(tmp_path: Path) -> None:
    import cv2

    image = np.zeros((4, 5, 3), np.uint8)
    image[..., 0] = 200
    save_image(image, tmp_path / "sheet.png")
    assert np.array_equal(cv2.imread(str(tmp_path / "sheet.png"))[..., ::-1], image)
