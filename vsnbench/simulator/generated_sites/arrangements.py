"""Groups of furniture: a desk with screen and chair, a bed with nightstands, a row of kitchen furniture.

Every arrangement has its back on x = 0 and faces x; free-standing arrangements are centred.
"""

from dataclasses import replace

from numpy.random import Generator

from vsnbench.simulator.generated_sites import palette
from vsnbench.simulator.generated_sites.placing import Arrangement, Piece, Strip


def single(piece: Piece, free_m: float = 0.0) -> Arrangement:
    """Return one piece against the wall, with free floor in front of it."""
    depth, width, _ = piece.size_m
    free = (Strip((depth, depth + free_m), (-width / 2, width / 2)),) if free_m else ()
    return Arrangement((replace(piece, x_m=depth / 2),), free)


def bed(rng: Generator, *, narrow: bool = False) -> Arrangement:
    """Return a bed with up to two nightstands, each with or without a lamp."""
    size = palette.size(rng, 2.02, 0.95 if narrow else 1.5, 0.55, 0.06)
    pieces = [Piece("bed", size, size[0] / 2, color=palette.fabric(rng))]
    color = palette.wood(rng)
    for side in rng.permutation([-1, 1])[: 1 if narrow else int(rng.integers(1, 3))]:
        stand = palette.size(rng, 0.4, 0.42, 0.5)
        y = float(side) * (size[1] / 2 + stand[1] / 2 + 0.05)
        pieces.append(Piece("nightstand", stand, stand[0] / 2, y, color=color))
        if rng.random() < 0.6:
            lamp = Piece("lamp", palette.size(rng, 0.22, 0.22, 0.42), stand[0] / 2, y, model="table_lamp")
            pieces.append(replace(lamp, elevation_m=stand[2], color=palette.pale(rng)))
    return Arrangement(tuple(pieces), (Strip((0.6, size[0]), (-size[1] / 2 - 0.5, -size[1] / 2)),))


def desk(rng: Generator, *, screen: bool = True) -> Arrangement:
    """Return a desk, usually with a monitor, and its chair."""
    size = palette.size(rng, 0.68, 1.3, 0.74)
    pieces = [Piece("table", size, size[0] / 2, model="desk", color=palette.wood(rng))]
    if screen:
        monitor = palette.size(rng, 0.2, 0.6, 0.45)
        place = Piece("monitor", monitor, monitor[0] / 2 + 0.06, float(rng.uniform(-0.2, 0.2)), model="desk_monitor")
        pieces.append(replace(place, elevation_m=size[2], color=palette.dark(rng)))
    pieces.append(_chair(rng, str(rng.choice(["office_chair", "office_chair", "dining_chair"])), size[0] + 0.36))
    return Arrangement(tuple(pieces), (Strip((size[0], size[0] + 0.9), (-0.5, 0.5)),))


def dining(rng: Generator) -> Arrangement:
    """Return a table with two to six chairs around it, free-standing."""
    seats_a_side = int(rng.integers(1, 4))
    size = palette.size(rng, 0.88, 0.55 * seats_a_side + 0.45, 0.75, 0.05)
    pieces = [Piece("table", size, model="dining_table", color=palette.wood(rng))]
    rng.integers(2)  # not used; without this draw, seeds would give other sites
    color, chair = palette.fabric(rng), palette.size(rng, 0.48, 0.46, 0.9, 0.06)
    for side in (-1, 1):
        for k in range(seats_a_side):
            if rng.random() < 0.12 and k > 0:
                continue
            y = (k + 0.5) * size[1] / seats_a_side - size[1] / 2
            x = side * (size[0] / 2 + chair[0] / 2 + float(rng.uniform(0.02, 0.12)))
            turn = (180.0 if side > 0 else 0.0) + float(rng.uniform(-6, 6))
            pieces.append(Piece("chair", chair, x, y, turn, "dining_chair", color))
    reach, wide = size[0] / 2 + chair[0] + 0.75, size[1] / 2 + 0.75
    return Arrangement(tuple(pieces), (Strip((-reach, reach), (-wide, wide)),))


def screen_wall(rng: Generator) -> Arrangement:
    """Return a sideboard with a television on it."""
    size = palette.size(rng, 0.42, 1.6, 0.5)
    model = str(rng.choice(["sideboard", "cabinet"]))
    television = palette.size(rng, 0.22, 1.05, 0.64)
    screen = Piece("monitor", television, size[0] / 2, float(rng.uniform(-0.15, 0.15)), model="television")
    board = Piece("cabinet", size, size[0] / 2, model=model, color=palette.wood(rng))
    free = Strip((size[0], size[0] + 0.8), (-size[1] / 2, size[1] / 2))
    return Arrangement((board, replace(screen, elevation_m=size[2], color=palette.dark(rng))), (free,))


def sofa(rng: Generator) -> Arrangement:
    """Return a sofa, usually with a coffee table and a rug in front of it."""
    size = palette.size(rng, 0.93, float(rng.choice([1.55, 2.0, 2.3])), 0.8, 0.06)
    pieces = [Piece("sofa", size, size[0] / 2, color=palette.fabric(rng))]
    front = size[0]
    if rng.random() < 0.75:
        table = palette.size(rng, 0.6, 1.05, 0.42)
        gap = float(rng.uniform(0.32, 0.45))
        place = front + gap + table[0] / 2
        pieces.append(Piece("table", table, place, model="coffee_table", color=palette.wood(rng)))
        front = place + table[0] / 2
    if rng.random() < 0.6:
        rug = (round(max(front - size[0] + 0.3, 1.2), 2), round(size[1] + 0.3, 2), 0.01)
        middle = size[0] + rug[0] / 2 - 0.1
        pieces.append(Piece("rug", rug, middle, color=palette.fabric(rng), solid=False))
    return Arrangement(tuple(pieces), (Strip((size[0], front + 0.7), (-size[1] / 2, size[1] / 2)),))


def armchair(rng: Generator) -> Piece:
    """Return an armchair at a random angle."""
    turn = float(rng.uniform(-45, 45))
    return Piece("chair", palette.size(rng, 0.76, 0.76, 0.85), 0.6, 0.0, turn, "armchair", palette.fabric(rng))


def spare_chair(rng: Generator) -> Piece:
    """Return a chair against a wall."""
    size = palette.size(rng, 0.48, 0.46, 0.9, 0.06)
    return Piece("chair", size, 0.27, 0.0, 0.0, "dining_chair", palette.fabric(rng))


def kitchen_row(rng: Generator, longest_m: float) -> Arrangement | None:
    """Return refrigerator, counters, stove and sink in a row of at most `longest_m`; None if nothing fits."""
    depth, front = 0.6, palette.wood(rng)
    machine = palette.pale(rng)
    widths = [("refrigerator", 0.68), ("counter", 0.0), ("stove", 0.6), ("counter", 0.0)]
    spare = min(longest_m, 3.9) - 1.28 - 0.1
    if spare < 1.2:
        return None
    counters = [round(spare * 0.45, 2), round(spare * 0.55, 2)]
    if rng.random() < 0.5:
        widths.reverse()
    total = 1.28 + sum(counters) + 0.12
    y, pieces = -total / 2, []
    for category, fixed in widths:
        width = fixed or counters.pop()
        middle = y + width / 2
        height = round(float(rng.uniform(1.6, 1.95)), 2) if category == "refrigerator" else 0.9
        deep = 0.68 if category == "refrigerator" else depth
        color = front if category == "counter" else machine
        pieces.append(Piece(category, (deep, width, height), deep / 2, middle, color=color))
        if category == "counter" and len(counters) == 0:
            sink_m = (0.45, min(0.6, width - 0.1), 0.2)
            pieces.append(Piece("sink", sink_m, depth / 2, middle, model="kitchen_sink", elevation_m=0.9))
        if category == "counter" and rng.random() < 0.7:
            pieces.append(Piece("wall_cabinet", (0.34, width, 0.7), 0.17, middle, color=front, elevation_m=1.45))
        y += width + 0.04
    return Arrangement(tuple(pieces), (Strip((0.68, 1.6), (-total / 2, total / 2)),))


def toilet(rng: Generator) -> Arrangement:
    """Return a toilet and the free floor in front of it."""
    return single(Piece("toilet", palette.size(rng, 0.68, 0.4, 0.78, 0.06), color=palette.pale(rng)), 0.6)


def plant(rng: Generator) -> Piece:
    """Return a plant of any size."""
    wide = round(float(rng.uniform(0.36, 0.55)), 2)
    return Piece("plant", (wide, wide, round(float(rng.uniform(0.7, 1.5)), 2)), color=palette.clay(rng))


def floor_lamp(rng: Generator) -> Piece:
    """Return a lamp on a pole."""
    return Piece("lamp", palette.size(rng, 0.36, 0.36, 1.6), model="floor_lamp", color=palette.pale(rng))


def picture(rng: Generator) -> Piece:
    """Return a picture for a wall."""
    width, height = float(rng.uniform(0.5, 1.1)), float(rng.uniform(0.5, 0.75))
    size = (0.03, round(width, 2), round(height, 2))
    return Piece("picture", size, elevation_m=1.3, color=palette.wood(rng))


def _chair(rng: Generator, model: str, x_m: float) -> Piece:
    size = palette.size(rng, 0.6, 0.6, 1.0, 0.06) if model == "office_chair" else palette.size(rng, 0.48, 0.46, 0.9)
    y_m, turn_deg = float(rng.uniform(-0.08, 0.08)), 180.0 + float(rng.uniform(-12, 12))
    return Piece("chair", size, x_m, y_m, turn_deg, model, palette.fabric(rng))
