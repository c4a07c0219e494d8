"""Chairs, sofas and beds."""

import math

from vsnbench.simulator.furniture.canvas import Canvas, recolored, rgb, shade, turn
from vsnbench.simulator.primitives import Material, Shape


def dining_chair(c: Canvas) -> None:
    """Four legs, an upholstered seat, a back of three slats."""
    frame = Material(rgb("#8a5a35"), "wood", 0.15)
    seat = c.paint("#a63a32", "fabric")
    leg = min(0.04, c.width / 6, c.depth / 6)
    seat_top = 0.5 * c.height
    c.box((c.back, c.front), (c.right, c.left), (seat_top - 0.075, seat_top - 0.035), frame)
    c.box((c.back + leg, c.front - 0.005), (c.right + 0.01, c.left - 0.01), (seat_top - 0.035, seat_top), seat)
    for y in (c.right, c.left - leg):
        c.box((c.front - leg, c.front), (y, y + leg), (0, seat_top - 0.075), frame)
        c.box((c.back, c.back + leg), (y, y + leg), (0, c.height), frame)
    for y in (c.right + leg * 0.25, c.left - leg * 0.75):
        c.box((c.back + leg, c.front - leg), (y, y + leg / 2), (0.2 * c.height, 0.2 * c.height + 0.025), frame)
    for low, high in ((0.66, 0.72), (0.78, 0.84), (0.91, 1.0)):
        c.box(
            (c.back + 0.2 * leg, c.back + 0.8 * leg),
            (c.right + leg, c.left - leg),
            (low * c.height, high * c.height - 0.004),
            frame,
        )


def office_chair(c: Canvas) -> None:
    """A five-armed base on castors, a gas spring, a padded seat and back, arm rests."""
    dark = Material(rgb("#2a2b2e"), "plain", 0.2)
    steel = Material(rgb("#b4b8bd"), "metal", 0.6)
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
            dark,
            turn((0, 0, 1), angle),
        )
        c.ellipsoid(
            ((reach - wheel) * math.cos(angle), (reach - wheel) * math.sin(angle), wheel), (wheel, wheel, wheel), dark
        )
    c.cylinder(0, 0, (0.06 * c.height, 0.12 * c.height), 0.045, dark)
    c.cylinder(0, 0, (0.1 * c.height, seat - 0.08), 0.025, steel)
    c.box((-0.1, 0.1), (-0.1, 0.1), (seat - 0.09, seat - 0.06), dark)
    wide, deep = 0.42 * c.width, 0.42 * c.depth
    c.box((c.back + 0.1 * c.depth, deep), (-wide, wide), (seat - 0.06, seat - 0.015), cloth)
    c.ellipsoid((0.03 * c.depth, 0, seat - 0.02), (deep * 0.92, wide * 0.95, 0.03), cloth)
    post = c.back + 0.05 * c.depth
    c.box((post - 0.015, post + 0.02), (-0.04, 0.04), (seat - 0.05, 0.75 * c.height), dark)
    c.box((post, post + 0.05 * c.depth + 0.02), (-wide * 0.95, wide * 0.95), (0.56 * c.height, c.height), cloth)
    c.ellipsoid((post + 0.07 * c.depth, 0, 0.7 * c.height), (0.05 * c.depth, wide * 0.85, 0.12 * c.height), cloth)
    for side in (-1, 1):
        y = side * (c.width / 2 - 0.03)
        c.box((-0.06, 0.0), (y - 0.015, y + 0.015), (seat - 0.05, 0.66 * c.height), dark)
        c.box((-0.22 * c.depth, 0.22 * c.depth), (y - 0.03, y + 0.03), (0.66 * c.height, 0.69 * c.height), dark)


def armchair(c: Canvas) -> None:
    """A deep single seat with broad arms, on short feet."""
    _couch(c, c.paint("#b5794a", "fabric"), seats=1)


def sofa(c: Canvas) -> None:
    """A couch with as many seat cushions as fit, arms, a cushioned back and two pillows."""
    _couch(c, c.paint("#35558a", "fabric"), seats=max(2, round((c.width - 0.4) / 0.6)))


def _couch(c: Canvas, cloth: Material, seats: int) -> None:
    foot = min(0.1, 0.15 * c.height)
    arm = min(0.2, 0.18 * c.width)
    back = 0.24 * c.depth
    seat = 0.53 * c.height
    cushion = 0.17 * c.height
    body = recolored(cloth, 0.86)
    c.legs(0.04, 0.05, foot, Material(rgb("#3d2a1c"), "wood"), round_=True)
    c.box((c.back, c.front - 0.03), (c.right + 0.01, c.left - 0.01), (foot, seat - cushion), body)
    c.box((c.back, c.back + back), (c.right + arm / 2, c.left - arm / 2), (foot, 0.97 * c.height), cloth)
    for edge, inner in ((c.right, c.right + arm), (c.left, c.left - arm)):
        c.box((c.back, c.front), (edge, inner), (foot, 0.72 * c.height - arm / 4), cloth)
        c.rod("x", (0, (edge + inner) / 2, 0.72 * c.height - arm / 4), arm / 2, c.depth, cloth)
    seat_width = (c.width - 2 * arm) / seats
    for k in range(seats):
        y = c.right + arm + k * seat_width
        gap = 0.006
        c.box((c.back + back, c.front), (y + gap, y + seat_width - gap), (seat - cushion + 0.01, seat - 0.02), cloth)
        c.ellipsoid(
            (back / 2, y + seat_width / 2, seat - 0.035),
            ((c.depth - back) * 0.49, seat_width * 0.49 - gap, 0.045),
            cloth,
        )
        c.box(
            (c.back + back, c.back + back + 0.14 * c.depth),
            (y + gap, y + seat_width - gap),
            (seat, 0.98 * c.height),
            recolored(cloth, 1.06),
        )
        c.ellipsoid(
            (c.back + back + 0.14 * c.depth, y + seat_width / 2, (seat + c.height) / 2),
            (0.045 * c.depth, seat_width * 0.45, (c.height - seat) * 0.45),
            recolored(cloth, 1.06),
        )
    c.rod("y", (c.back + back / 2, 0, c.height - back / 2), back / 2, c.width - arm, cloth)
    pillows = [(-1, "#d9b65c"), (1, "#d8d3c5")] if seats > 1 else [(0, "#d8d3c5")]
    for side, code in pillows:
        c.place(
            Shape.ELLIPSOID,
            (c.back + back + 0.3 * c.depth, side * (c.width / 2 - arm - 0.2), seat + 0.15 * c.height),
            (0.07, 0.2, 0.2 * c.height),
            Material(rgb(code), "fabric"),
            turn((0, 1, 0), -0.35),
        )


def bed(c: Canvas) -> None:
    """A wooden frame with a headboard at the back, mattress, blanket and pillows."""
    wood = Material(rgb("#6b4426"), "wood", 0.15)
    linen = Material(rgb("#f1eee6"), "cloth")
    blanket = c.paint("#6d4d8e", "fabric")
    board = min(0.06, c.depth / 10)
    top = c.height * (0.62 if c.height < 0.7 else 0.55)
    c.box((c.back, c.back + board), (c.right, c.left), (0, c.height), wood)
    c.legs(0.02, 0.07, 0.3 * top, wood)
    c.box((c.back + board, c.front), (c.right, c.left), (0.25 * top, 0.55 * top), wood)
    rim = 0.03
    c.box((c.back + board, c.front - rim), (c.right + rim, c.left - rim), (0.5 * top, top), linen)
    fold = c.back + board + 0.3 * (c.depth - board)
    c.box((fold, c.front - 0.005), (c.right + 0.01, c.left - 0.01), (0.62 * top, top + 0.03), blanket)
    c.box(
        (fold - 0.02, fold + 0.22),
        (c.right + 0.005, c.left - 0.005),
        (0.66 * top, top + 0.045),
        Material(shade(blanket.color, 1.25), "fabric"),
    )
    pillows = 2 if c.width > 1.15 else 1
    for k in range(pillows):
        y = c.right + (k + 0.5) * c.width / pillows
        c.ellipsoid((c.back + board + 0.25, y, top + 0.05), (0.22, min(0.36, 0.43 * c.width / pillows), 0.085), linen)
