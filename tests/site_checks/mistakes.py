"""Common mistakes in surveys, as edits of a valid flat, with a part of the expected message."""

from dataclasses import dataclass
from pathlib import Path

FLAT = Path(__file__).with_name("flat.yaml")
RADIUS_M = 0.177


@dataclass(frozen=True)
class Mistake:
    """A mistake as an edit of the flat's file."""

    what: str
    old: str
    new: str
    code: str
    message_part: str
    """Part of the message that names the mistake or its fix."""
    everywhere: bool = False

    def file(self, folder: Path) -> Path:
        """Write the flat with the mistake in it."""
        text = FLAT.read_text(encoding="utf-8")
        assert self.old in text, self.what
        path = folder / "flat.yaml"
        path.write_text(text.replace(self.old, self.new, -1 if self.everywhere else 1), encoding="utf-8")
        return path


WALL_5 = "  - { start: [4, 0], end: [4, 5] }\n"
BATH_DOOR = "{ name: bath, start: [4, 3.2], end: [4, 4.0] }"
SOFA = "{ id: sofa-1, category: sofa, position: [0.6, 3.2], size_m: [0.9, 1.8, 0.8] }"
STARTS = FLAT.read_text(encoding="utf-8").split("starts:\n")[1]
OBJECTS = FLAT.read_text(encoding="utf-8").split("objects:\n")[1].split("\nstarts:")[0]


def _starts(turn: str) -> str:
    """Return the lines of the starts with headings in radians, or with y downwards."""
    import math
    import re

    if turn == "radians":
        return re.sub(
            r"heading_deg: (-?\d+)", lambda found: f"heading_deg: {math.radians(float(found[1])):.2f}", STARTS
        )
    return re.sub(r"position: \[([\d.]+), ([\d.]+)\]", lambda found: f"position: [{found[1]}, -{found[2]}]", STARTS)


MISTAKES = [
    Mistake(
        "a wall between two rooms forgotten",
        WALL_5,
        "",
        "edge-without-wall",
        "the hall's edge from (4, 0) to (4, 5) has no wall: add the wall - { start: [4, 0], end: [4, 5] }",
    ),
    Mistake(
        "a wall measured a metre short",
        "{ start: [6, 0], end: [6, 5] }",
        "{ start: [6, 0], end: [6, 4] }",
        "edge-without-wall",
        "has no wall for 0.90 m, from (6, 4.05) to (6, 4.95): extend wall 2 (from (6, 0) to (6, 4)) at (6, 4)",
    ),
    Mistake(
        "a wall next to its place",
        "{ start: [6, 5], end: [0, 5] }",
        "{ start: [6, 5.2], end: [0, 5.2] }",
        "edge-without-wall",
        "move wall 3 (from (6, 5.2) to (0, 5.2)), which is parallel at 0.15 m",
    ),
    Mistake(
        "a wall surveyed twice",
        WALL_5,
        WALL_5 + "  - { start: [4.02, 0.1], end: [4.02, 4.9] }\n",
        "walls-overlap",
        "overlap along 4.80 m: delete one of them",
    ),
    Mistake(
        "a wall higher than the ceiling",
        "{ start: [6, 0], end: [6, 5] }",
        "{ start: [6, 0], end: [6, 5], height_m: 2.7 }",
        "wall-above-ceiling",
        "0.20 m above the ceiling: omit height_m for a wall up to the ceiling",
    ),
    Mistake(
        "a room that overlaps its neighbour",
        "[[4, 0], [6, 0], [6, 5], [4, 5]]",
        "[[3.8, 0], [6, 0], [6, 5], [3.8, 5]]",
        "rooms-overlap",
        "rooms `hall` and `bath` overlap by 1.00 m² around (3.9, 2.5): rooms meet at the middle of the wall",
    ),
    Mistake(
        "an enclosure without a room",
        "  - { name: bath, polygon: [[4, 0], [6, 0], [6, 5], [4, 5]], floor: tiles }\n",
        "",
        "enclosure-without-room",
        "has 9.3 m² and is not in a room: add it to rooms with polygon: [",
    ),
    Mistake(
        "corners of a room out of order",
        "[[0, 0], [4, 0], [4, 5], [0, 5]]",
        "[[0, 0], [4, 5], [4, 0], [0, 5]]",
        "format",
        "the outline crosses itself: list its corners in order around the outline",
    ),
    Mistake(
        "a door on the wall's face, not on its centre line",
        BATH_DOOR,
        "{ name: bath, start: [4.05, 3.2], end: [4.05, 4.0] }",
        "opening-off-wall",
        "is 0.05 m away; on it the opening is start: [4, 3.2], end: [4, 4]",
    ),
    Mistake(
        "a window and a door in one place",
        "{ start: [6, 2], end: [6, 3] }",
        "{ start: [4, 3.5], end: [4, 4.5] }",
        "openings-overlap",
        "door `bath` and window 1 overlap along 0.51 m",
    ),
    Mistake(
        "a door higher than its wall",
        "end: [1.9, 0], closed: true",
        "end: [1.9, 0], closed: true, height_m: 2.6",
        "opening-above-wall",
        "reaches 0.10 m above its wall, which is 2.5 m high: measure both again; its height_m can be at most 2.5",
    ),
    Mistake(
        "a door narrower than the robot",
        BATH_DOOR,
        "{ name: bath, start: [4, 3.2], end: [4, 3.5] }",
        "door-too-narrow",
        "door `bath` is 0.30 m clear, the robot needs 0.35: starts",
    ),
    Mistake(
        "a door left closed",
        BATH_DOOR,
        "{ name: bath, start: [4, 3.2], end: [4, 4.0], closed: true }",
        "door-closed",
        "remove closed: true if it is open during trials",
    ),
    Mistake("a door forgotten", f"  - {BATH_DOOR}\n", "", "room-without-door", "room `bath` has no door"),
    Mistake(
        "furniture that blocks a path",
        "id: chair-1, category: chair, position: [3.4, 4.5]",
        "id: chair-1, category: chair, position: [3.6, 3.6]",
        "passage-too-narrow",
        "chair-1",
    ),
    Mistake(
        "all in centimetres",
        "[[0, 0], [4, 0], [4, 5], [0, 5]]",
        "[[0, 0], [400, 0], [400, 500], [0, 500]]",
        "format",
        "this looks like centimetres; in metres it is 5",
    ),
    Mistake(
        "one length in centimetres",
        "size_m: [0.9, 1.8, 0.8]",
        "size_m: [90, 180, 80]",
        "format",
        "this looks like centimetres; in metres it is 0.9",
    ),
    Mistake(
        "a sill in centimetres",
        "{ start: [6, 2], end: [6, 3] }",
        "{ start: [6, 2], end: [6, 3], sill_m: 90 }",
        "format",
        "must be below 3 m, got 90 m: this looks like centimetres; in metres it is 0.9",
    ),
    Mistake(
        "headings in radians",
        STARTS,
        _starts("radians"),
        "headings-in-radians",
        "headings are degrees, these look like radians",
    ),
    Mistake(
        "y counted downwards",
        STARTS,
        _starts("mirrored"),
        "axes-mirrored",
        "none with y counted downwards: x runs to the right and y up: negate their y",
    ),
    Mistake(
        "x and y of a start exchanged",
        "number: 4, position: [5.10, 2.20]",
        "number: 4, position: [2.20, 5.10]",
        "start-outside",
        "are x and y exchanged? (5.1, 2.2) is in a room",
    ),
    Mistake(
        "decimal commas in a list",
        "position: [1.1, 0.95]",
        "position: [1,1, 0,95]",
        "format",
        "is this a decimal comma? Write 1.5, not 1,5",
    ),
    Mistake(
        "a decimal comma in a number",
        "ceiling_height_m: 2.5",
        "ceiling_height_m: 2,5",
        "format",
        "expected a number, got '2,5': write 2.5, with a point",
    ),
    Mistake(
        "a unit after a number",
        "ceiling_height_m: 2.5",
        "ceiling_height_m: 2.5 m",
        "format",
        "got '2.5 m': write it in metres",
    ),
    Mistake(
        "a direction as text", "heading_deg: 120", "heading_deg: north", "format", "got 'north': write it in degrees"
    ),
    Mistake(
        "a television that faces the wall",
        "position: [3.75, 1.6], heading_deg: 180, size_m: [0.2",
        "position: [3.75, 1.6], heading_deg: 0, size_m: [0.2",
        "faces-wall",
        "television tv at (3.75, 1.6) faces wall 5 (from (4, 0) to (4, 5)) at 0.10 m: heading_deg is the direction "
        "of its front: 180 is opposite",
    ),
    Mistake(
        "a synonym of a category",
        "category: sofa",
        "category: couch",
        "format",
        "unknown category 'couch': write sofa",
    ),
    Mistake(
        "a misspelt category",
        "category: toilet",
        "category: toillet",
        "near-category",
        "toilet-1 has the category 'toillet', which is not a built-in one: did you mean toilet?",
    ),
    Mistake(
        "a misspelt field",
        "heading_deg: 120",
        "heading: 120",
        "format",
        "unknown field: did you mean heading_deg?",
    ),
    Mistake(
        "an object in a wall",
        "position: [0.6, 3.2]",
        "position: [0.4, 3.2]",
        "object-in-wall",
        "sofa-1 at (0.4, 3.2) reaches 0.10 m into wall 4",
    ),
    Mistake(
        "depth and width exchanged",
        "position: [3.7, 1.6], heading_deg: 180, size_m: [0.4, 1.5, 0.5]",
        "position: [3.7, 1.6], heading_deg: 180, size_m: [1.5, 0.4, 0.5]",
        "object-in-wall",
        "with depth and width exchanged it fits: size_m: [0.4, 1.5, 0.5]",
    ),
    Mistake(
        "elevation_m forgotten",
        ", elevation_m: 0.5 }",
        " }",
        "objects-overlap",
        "is tv on sideboard? Give it elevation_m: 0.5",
    ),
    Mistake(
        "an object surveyed twice",
        f"  - {SOFA}\n",
        f"  - {SOFA}\n  - {SOFA.replace('sofa-1', 'sofa-2')}\n",
        "objects-overlap",
        "sofa-1 and sofa-2 overlap by 16200 cm² at (0.6, 3.2): is this the same object twice? Delete one of them",
    ),
    Mistake("a repeated id", "id: tv,", "id: sideboard,", "format", "sideboard is repeated"),
    Mistake(
        "a footprint in the object's own frame",
        SOFA,
        SOFA.replace(" }", ", footprint: [[-0.4, -0.9], [0.4, -0.9], [0.4, 0.9], [-0.4, 0.9]] }"),
        "footprint-elsewhere",
        "a footprint is in the site's frame, so add the position",
    ),
    Mistake(
        "a start inside furniture",
        "number: 1, position: [2.5, 2.2]",
        "number: 1, position: [1.1, 0.95]",
        "start-inside",
        "start 1 at (1.1, 0.95) is inside bed-1: move it",
    ),
    Mistake(
        "a start too near to a wall",
        "number: 3, position: [4.70, 2.20]",
        "number: 3, position: [4.15, 2.20]",
        "start-too-near",
        "start 3 at (4.15, 2.2) is 0.10 m from wall 5 (from (4, 0) to (4, 5)), "
        "less than the robot's radius of 0.177 m: move it 0.08 m away",
    ),
    Mistake(
        "a start next to a goal",
        "number: 3, position: [4.70, 2.20]",
        "number: 3, position: [5.10, 1.40]",
        "goal-at-start",
        "goal toilet is reached without a move from start 3 (toilet-1): "
        "move it 1 m away or add not_for: [toilet] there",
    ),
    Mistake("a name with spaces", "name: flat", "name: My Flat", "format", "write my-flat"),
    Mistake(
        "a goal category forgotten",
        "  - { id: plant-1, category: plant, position: [3.6, 0.35], size_m: [0.4, 0.4, 1.0] }\n",
        "",
        "no-instance",
        "if it has such an object, add it to objects with category: plant",
    ),
]
