"""Furniture for each room of a generated site; goal categories are required, other pieces optional."""

from numpy.random import Generator

from vsnbench.simulator.generated_sites import arrangements as sets
from vsnbench.simulator.generated_sites import palette
from vsnbench.simulator.generated_sites.layout import PlannedRoom, RoomKind
from vsnbench.simulator.generated_sites.placing import Arrangement, Piece, Placer


def furnish_rooms(placer: Placer) -> bool:
    """Furnish every room; return False if a required piece does not fit."""
    rng = placer.rng
    by_kind = {room.kind: room for room in placer.rooms}
    living = by_kind[RoomKind.LIVING]
    kitchen = by_kind.get(RoomKind.KITCHEN, living)
    study = by_kind.get(RoomKind.STUDY)
    if not (
        _bathroom(placer, by_kind[RoomKind.BATHROOM])
        and _bedroom(placer, by_kind[RoomKind.BEDROOM])
        and _kitchen(placer, kitchen)
        and _living(placer, living)
    ):
        return False
    if RoomKind.SECOND_BEDROOM in by_kind and not _second_bedroom(placer, by_kind[RoomKind.SECOND_BEDROOM]):
        return False
    if study is not None and not _study(placer, study):
        return False
    if study is None and rng.random() < 0.7:
        rooms = [living, by_kind.get(RoomKind.SECOND_BEDROOM, living), by_kind[RoomKind.BEDROOM]]
        placer.against_wall(rooms[rng.integers(3)], sets.desk(rng))
    if RoomKind.CORRIDOR in by_kind:
        _corridor(placer, by_kind[RoomKind.CORRIDOR])
    return _decorate(placer, living, by_kind)


def _bathroom(placer: Placer, room: PlannedRoom) -> bool:
    rng = placer.rng
    if not placer.against_wall(room, sets.toilet(rng)):
        return False
    basin = Piece("sink", palette.size(rng, 0.48, 0.6, 0.85), model="vanity", color=palette.wood(rng))
    if not placer.against_wall(room, sets.single(basin, 0.5)):
        return False
    tub = Piece("bathtub", palette.size(rng, 0.72, 1.6, 0.55, 0.04))
    shower = Piece("shower", palette.size(rng, 0.85, 0.85, 2.0, 0.05))
    for piece in (tub, shower) if rng.random() < 0.5 else (shower, tub):
        if placer.against_wall(room, sets.single(piece, 0.3), corner=1.0):
            break
    if rng.random() < 0.6:
        machine = Piece("washing_machine", (0.6, 0.6, 0.85), color=palette.pale(rng))
        placer.against_wall(room, sets.single(machine, 0.4), corner=0.8)
    return True


def _bedroom(placer: Placer, room: PlannedRoom) -> bool:
    rng = placer.rng
    if not placer.against_wall(room, sets.bed(rng), corner=0.15):
        return False
    _wardrobe(placer, room)
    if rng.random() < 0.3:
        placer.against_wall(room, sets.screen_wall(rng) if rng.random() < 0.5 else sets.single(_chest(rng), 0.4))
    if rng.random() < 0.3:
        placer.in_corner(room, sets.plant(rng))
    if rng.random() < 0.25:
        placer.against_wall(room, Arrangement((sets.spare_chair(rng),)))
    if rng.random() < 0.6:
        placer.on_wall(room, sets.picture(rng))
    return True


def _second_bedroom(placer: Placer, room: PlannedRoom) -> bool:
    rng = placer.rng
    if not placer.against_wall(room, sets.bed(rng, narrow=True), corner=0.7):
        return False
    if rng.random() < 0.5:
        placer.against_wall(room, sets.desk(rng, screen=bool(rng.random() < 0.6)))
    _wardrobe(placer, room)
    return True


def _study(placer: Placer, room: PlannedRoom) -> bool:
    rng = placer.rng
    if not placer.against_wall(room, sets.desk(rng), corner=0.2):
        return False
    if rng.random() < 0.8:
        placer.against_wall(room, sets.single(_bookshelf(rng), 0.4))
    if rng.random() < 0.3:
        placer.against_wall(room, sets.sofa(rng))
    if rng.random() < 0.4:
        placer.in_corner(room, sets.plant(rng))
    return True


def _kitchen(placer: Placer, room: PlannedRoom) -> bool:
    rng = placer.rng
    for longest in (3.9, 3.3, 2.8, 2.6):
        row = sets.kitchen_row(rng, longest)
        if row is not None and placer.against_wall(room, row, corner=0.7):
            break
    else:
        return False
    if room.kind is RoomKind.KITCHEN and rng.random() < 0.35:
        placer.against_wall(room, Arrangement((sets.spare_chair(rng),)))
    return True


def _living(placer: Placer, room: PlannedRoom) -> bool:
    rng = placer.rng
    if not placer.against_wall(room, sets.screen_wall(rng), corner=0.1):
        return False
    if not placer.against_wall(room, sets.sofa(rng), corner=0.1) and not placer.free_standing(room, sets.sofa(rng)):
        return False
    if not placer.free_standing(room, sets.dining(rng)) and not placer.free_standing(room, sets.dining(rng)):
        return False
    if rng.random() < 0.2:
        placer.against_wall(room, sets.sofa(rng), tries=12)
    if rng.random() < 0.6:
        placer.against_wall(room, Arrangement((sets.armchair(rng),)))
    if rng.random() < 0.6:
        placer.against_wall(room, sets.single(_bookshelf(rng), 0.4))
    if rng.random() < 0.5:
        placer.against_wall(room, sets.single(_chest(rng), 0.4))
    return True


def _corridor(placer: Placer, room: PlannedRoom) -> None:
    rng = placer.rng
    if rng.random() < 0.5:
        shoes = Piece("cabinet", palette.size(rng, 0.3, 0.8, 0.9), color=palette.wood(rng))
        placer.against_wall(room, sets.single(shoes, 0.75), tries=10)
    if rng.random() < 0.7:
        placer.on_wall(room, sets.picture(rng))


def _decorate(placer: Placer, living: PlannedRoom, by_kind: dict[RoomKind, PlannedRoom]) -> bool:
    """Add at least one plant, then lamps and pictures."""
    rng = placer.rng
    others = [room for kind, room in by_kind.items() if kind not in (RoomKind.BATHROOM, RoomKind.CORRIDOR)]
    grown = sum(placer.in_corner(living, sets.plant(rng)) for _ in range(int(rng.integers(1, 3))))
    if grown == 0 and not any(placer.in_corner(room, sets.plant(rng)) for room in others):
        return False
    if rng.random() < 0.6:
        placer.in_corner(living, sets.floor_lamp(rng))
    for _ in range(int(rng.integers(0, 3))):
        placer.on_wall(living, sets.picture(rng))
    return True


def _wardrobe(placer: Placer, room: PlannedRoom) -> None:
    rng = placer.rng
    wide = float(rng.choice([1.0, 1.3, 1.6]))
    piece = Piece("wardrobe", palette.size(rng, 0.6, wide, 2.1, 0.05), color=palette.wood(rng))
    placer.against_wall(room, sets.single(piece, 0.5), corner=0.7)


def _bookshelf(rng: Generator) -> Piece:
    return Piece("bookshelf", palette.size(rng, 0.3, 0.95, 1.85, 0.12), color=palette.wood(rng))


def _chest(rng: Generator) -> Piece:
    return Piece("cabinet", palette.size(rng, 0.4, 1.1, 0.85, 0.12), color=palette.wood(rng))
