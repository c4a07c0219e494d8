"""A site's floor plan for pages: it is drawn whatever a survey calls its rooms."""

import re
from pathlib import Path
from xml.etree import ElementTree as ET

import shapely

from tests.results.records_of_a_lab import cell
from tests.simulator.scenery import a_site
from tests.sites.goal_sites import write_site
from vsnbench.sites.site import Door, load_site
from vsnbench.web.site_editor.drawing import plan_svg


def test_names_with_control_characters_leave_the_plan_readable() -> None:
    site = cell()
    room = site.rooms[0].model_copy(update={"name": "hall\x01<&"})
    drawn = ET.fromstring(plan_svg(site.model_copy(update={"rooms": [room], "title": "lab\x0b"})))
    named = [each.text for each in drawn.iter() if each.get("class") == "room-name"]
    assert named == ["hall\\x01<&"]


def test_points_and_regions_of_goals_are_drawn_with_their_goal(tmp_path: Path) -> None:
    drawn = ET.fromstring(plan_svg(load_site(write_site(tmp_path))))
    places = [each.get("data-id") for each in drawn.iter() if each.get("class") == "goal-place"]
    assert places == ["window-corner point:1", "to-the-kitchen region:kitchen"]


def test_a_doorway_is_open_on_the_plan_however_thick_its_wall() -> None:
    site = a_site(doors=(Door(name="front", start=(2, 0), end=(3, 0)),))
    thick = site.walls[0].model_copy(update={"thickness_m": 0.5})
    drawn = ET.fromstring(plan_svg(site.model_copy(update={"walls": [thick, *site.walls[1:]]})))
    (path,) = [str(each.get("d")) for each in drawn.iter() if each.get("class") == "wall"]
    rings = [[tuple(map(float, at.split())) for at in re.split("[ML]", ring) if at] for ring in path.split("Z") if ring]
    walls = shapely.union_all([shapely.Polygon(ring).boundary for ring in rings])
    assert not walls.crosses(shapely.LineString([(2.5, -1), (2.5, 1)]))
