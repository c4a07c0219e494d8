"""Chairs and sofas."""

import math

from vsnbench.simulator.furniture.canvas import Canvas, pick, recolored, rgb, turn
from vsnbench.simulator.primitives import Material, Shape

_DARK = Material(rgb("#2a2b2e"), "plain", 0.2)
_STEEL = Material(rgb("#b4b8bd"), "metal", 0.6)
_WOODS = ("#8a5a35", "#6b4426", "#c49a6c", "#3b2a20")


def dining_chair(c: Canvas) -> None:
    """Four legs, an upholstered seat, a slanted back of slats, of spindles or with a pad."""
    frame = Material(rgb(_WOODS[c.seed % len(_WOODS)]), "wood", 0.15)
    seat = c.paint("#a63a32", "fabric")
    leg = min(0.04, c.width / 6, c.depth / 6)
    top = 0.5 * c.height
    lean = min(0.09, 0.2 * c.depth)
    """How far the top of the back is behind the seat."""
    rear = c.back + lean
    for y in (c.right + leg / 2, c.left - leg / 2):
        c.beam((c.front - leg / 2, y, 0.0), (c.front - leg / 2, y, top - 0.05), leg, frame, round_=False)
        c.beam((c.back + leg / 2, y, 0.0), (rear, y, top), leg, frame, round_=False)
        c.beam((rear, y, top - 0.02), (c.back + leg / 2, y, c.height), 0.9 * leg, frame, round_=False)
        c.box((rear, c.front - leg), (y - leg / 4, y + leg / 4), (0.22 * c.height, 0.22 * c.height + 0.022), frame)
    c.box((rear - 0.02, c.front), (c.right, c.left), (top - 0.07, top - 0.035), frame)
    c.box((rear, c.front), (c.right + 0.005, c.left - 0.005), (top - 0.04, top + 0.01), seat, 0.018)
    angle = math.atan2(lean - leg / 2, c.height - top)

    def across(low: float, high: float, thick: float, material: Material) -> None:
        """Add a board between the posts, in the plane of the back."""
        middle = (low + high) / 2
        x = rear - (lean - leg / 2) * (middle - 0.5) / 0.5
        half = ((high - low) / 2) * c.height
        size = (thick / 2, c.width / 2 - leg, half)
        c.place(Shape.BOX, (x, 0, middle * c.height), size, material, turn((0, 1, 0), -angle), bevel_m=0.2 * thick)

    style = c.seed // 7 % 3
    across(0.9, 1.0, 0.8 * leg, frame)
    if style == 0:
        for low in (0.62, 0.76):
            across(low, low + 0.06, 0.6 * leg, frame)
    elif style == 1:
        across(0.58, 0.63, 0.7 * leg, frame)
        for k in range(5):
            y = (k - 2) * (c.width - 2.4 * leg) / 5
            x = rear - (lean - leg / 2) * 0.2
            c.beam((x, y, 0.6 * c.height), (c.back + leg / 2, y, 0.95 * c.height), 0.018, frame)
    else:
        across(0.6, 0.86, 0.9 * leg, seat)


def office_chair(c: Canvas) -> None:
    """A five-armed base on castors, a gas spring, a padded seat and back, arm rests."""
    cloth = c.paint("#3c4048", "fabric")
    reach = min(c.depth, c.width) / 2
    seat = 0.47 * c.height
    wheel = min(0.03, reach / 6)
    for k in range(5):
        angle = math.tau * k / 5 + math.pi / 10
        arm = (reach - wheel) / 2
        c.place(
            Shape.BOX,
            (arm * math.cos(angle), arm * math.sin(angle), 0.085 * c.height),
            (arm, 0.02, 0.015),
            _DARK,
            turn((0, 0, 1), angle),
        )
        c.ellipsoid(
            ((reach - wheel) * math.cos(angle), (reach - wheel) * math.sin(angle), wheel), (wheel, wheel, wheel), _DARK
        )
    c.cylinder(0, 0, (0.06 * c.height, 0.12 * c.height), 0.045, _DARK)
    c.cylinder(0, 0, (0.1 * c.height, seat - 0.08), 0.025, _STEEL)
    c.box((-0.1, 0.1), (-0.1, 0.1), (seat - 0.09, seat - 0.06), _DARK)
    wide, deep = 0.42 * c.width, 0.42 * c.depth
    c.box((c.back + 0.12 * c.depth, deep), (-wide, wide), (seat - 0.07, seat + 0.01), cloth, 0.03)
    post = c.back + 0.1 * c.depth
    c.beam((post + 0.03, 0, seat - 0.05), (post - 0.02, 0, 0.72 * c.height), 0.05, _DARK, round_=False)
    back = (0.035 * c.depth + 0.012, wide * 0.95, 0.235 * c.height)
    c.place(Shape.BOX, (post, 0, 0.77 * c.height), back, cloth, turn((0, 1, 0), -0.1), 0.92, 0.03)
    c.place(Shape.BOX, (post + 0.035, 0, 0.66 * c.height), (0.03, wide * 0.8, 0.09 * c.height), cloth, bevel_m=0.02)
    for side in (-1, 1):
        y = side * (c.width / 2 - 0.03)
        c.box((-0.06, 0.0), (y - 0.015, y + 0.015), (seat - 0.05, 0.66 * c.height), _DARK)
        c.box((-0.22 * c.depth, 0.22 * c.depth), (y - 0.03, y + 0.03), (0.65 * c.height, 0.69 * c.height), _DARK, 0.012)


def armchair(c: Canvas) -> None:
    """A wooden frame with open arms, a seat cushion and a leaning back cushion."""
    cloth = c.paint("#b5794a", "fabric")
    wood = Material(rgb(_WOODS[c.seed % len(_WOODS)]), "wood", 0.2)
    leg, seat = min(0.05, c.width / 8), 0.46 * c.height
    arm, lean = 0.66 * c.height, min(0.2, 0.26 * c.depth)
    for y in (c.right + leg / 2, c.left - leg / 2):
        c.beam((c.front - leg, y, 0), (c.front - 1.6 * leg, y, arm), leg, wood, round_=False)
        c.beam((c.back + leg, y, 0), (c.back + 1.4 * leg, y, arm), leg, wood, round_=False)
        c.box((c.back + leg / 2, c.front), (y - 0.7 * leg, y + 0.7 * leg), (arm - 0.01, arm + 0.025), wood, 0.01)
        c.box((c.back + leg, c.front - leg), (y - leg / 3, y + leg / 3), (seat - 0.17, seat - 0.11), wood)
    inner = (c.right + 1.3 * leg, c.left - 1.3 * leg)
    c.box((c.back + lean, c.front - leg), inner, (seat - 0.16, seat - 0.12), wood)
    c.box((c.back + lean, c.front - 0.02), inner, (seat - 0.13, seat), cloth, 0.045)
    half = (0.06, inner[1], (c.height - seat) / 2 + 0.02)
    c.place(
        Shape.BOX,
        (c.back + lean * 0.75, 0, (seat + c.height) / 2),
        half,
        recolored(cloth, 1.05),
        turn((0, 1, 0), -0.28),
        bevel_m=0.04,
    )


def sofa(c: Canvas) -> None:
    """A couch with as many seat cushions as fit, arms, a cushioned back and pillows."""
    _couch(c, c.paint("#35558a", "fabric"), seats=max(2, round((c.width - 0.4) / 0.7)))


def _couch(c: Canvas, cloth: Material, seats: int) -> None:
    random = c.random
    foot = min(0.08, 0.12 * c.height)
    arm = min(random.uniform(0.15, 0.22), 0.18 * c.width)
    back, seat, cushion = 0.22 * c.depth, 0.53 * c.height, 0.19 * c.height
    arm_top = random.uniform(0.68, 0.78) * c.height
    seam = 0.006
    c.legs(0.04, 0.05, foot, Material(rgb("#3d2a1c"), "wood"), round_=True)
    c.box(
        (c.back, c.front - 0.02), (c.right + 0.01, c.left - 0.01), (foot, seat - cushion), recolored(cloth, 0.92), 0.01
    )
    c.box((c.back, c.back + back), (c.right + 0.02, c.left - 0.02), (foot, 0.93 * c.height), cloth, 0.05)
    rolled = random.random() < 0.4
    for edge, inner in ((c.right, c.right + arm), (c.left, c.left - arm)):
        if rolled:
            c.box((c.back, c.front), (edge, inner), (foot, arm_top - arm / 3), cloth, 0.015)
            c.rod("x", (0, (edge + inner) / 2, arm_top - arm / 2), arm / 2, c.depth, cloth)
        else:
            c.box((c.back, c.front), (edge, inner), (foot, arm_top), cloth, 0.035)
    wide = (c.width - 2 * arm) / seats
    lean = turn((0, 1, 0), -0.16)
    for k in range(seats):
        middle = c.right + arm + (k + 0.5) * wide
        across = (middle - wide / 2 + seam, middle + wide / 2 - seam)
        c.box((c.back + back, c.front), across, (seat - cushion + seam, seat), recolored(cloth, 1.04), 0.045)
        high = (c.height - seat) / 2
        back_half = (0.085 * c.depth, wide / 2 - seam, 1.02 * high)
        at = (c.back + back + 0.07 * c.depth, middle, seat + high)
        c.place(Shape.BOX, at, back_half, recolored(cloth, 1.07), lean, bevel_m=0.05)
    pillow = min(0.21, 0.26 * c.height)
    colors = ("#d9b65c", "#d8d3c5", "#b5603a", "#4f6f7a", "#ece7da")
    for side in (-1, 1) if seats > 1 else (pick(random, (-1, 1)),):
        cover = Material(rgb(pick(random, colors)), "fabric")
        y = side * (c.width / 2 - arm - 1.05 * pillow)
        angle = turn((0, 1, 0), -0.45)
        half = (0.065, pillow, pillow)
        c.place(Shape.BOX, (c.back + back + 0.25 * c.depth, y, seat + 0.9 * pillow), half, cover, angle, bevel_m=0.05)
