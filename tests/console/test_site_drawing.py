"""A site's floor plan for pages: it is drawn whatever a survey calls its rooms."""

from xml.etree import ElementTree as ET

from tests.database.records_of_a_lab import cell
from vsnbench.console.site_drawing import plan_svg


def test_names_with_control_characters_leave_the_plan_readable() -> None:
    site = cell()
    room = site.rooms[0].model_copy(update={"name": "hall\x01<&"})
    drawn = ET.fromstring(plan_svg(site.model_copy(update={"rooms": [room], "title": "lab\x0b"})))
    named = [each.text for each in drawn.iter() if each.get("class") == "room-name"]
    assert named == ["hall\\x01<&"]
