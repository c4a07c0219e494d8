"""One image of a whole site: views of every room and a close-up of every kind of object.

Viewpoints are chosen by trial: small images are rendered from many places, and the most informative ones are used.
"""

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import numpy.typing as npt
from shapely.geometry import Point

from vsnbench.simulator.rendering.renderer import Eye, Frame, Renderer
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.geometry.walls import top_m
from vsnbench.sites.site import Room, Site, SiteObject

Image = npt.NDArray[np.uint8]

_ROOM_FOV_DEG = 79
_CLOSE_FOV_DEG = 50
_TRIAL = (80, 60)
_AREA_PER_VIEW_M2 = 14


_View = tuple[Eye, float, str]
"""A camera pose, its field of view in degrees, and a caption."""


def contact_sheet(site: Site, columns: int = 5, width: int = 320, height: int = 240) -> Image:
    """Draw a sheet of views of a site.

    Returns:
        (H, W, 3) uint8 RGB.
    """
    renderer = Renderer(build_scene(site))
    views = [view for room in site.rooms for view in _room_views(site, renderer, room)]
    views += [_close_up(site, renderer, index) for index in _one_of_each(site)]
    cells = [_picture(renderer, view, width, height) for view in views]
    blank = np.full_like(cells[0], 255)
    cells += [blank] * (-len(cells) % columns)
    rows = [np.hstack(cells[k : k + columns]) for k in range(0, len(cells), columns)]
    return np.asarray(np.vstack(rows), np.uint8)


def save_image(image: Image, path: Path) -> None:
    """Write an RGB image in the format of the path's suffix.

    Raises:
        OSError: the file cannot be written.
    """
    import cv2

    _, encoded = cv2.imencode(path.suffix, image[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    path.write_bytes(encoded.tobytes())


def _one_of_each(site: Site) -> list[int]:
    """Return the index of the first object of each category and model."""
    first: dict[tuple[str, str], int] = {}
    for index, thing in enumerate(site.objects):
        first.setdefault((thing.category, thing.model or ""), index)
    return [first[key] for key in sorted(first)]


def _picture(renderer: Renderer, view: _View, width: int, height: int) -> Image:
    """Render at double size, average, and add frame and caption."""
    import cv2

    eye, fov_deg, caption = view
    fine = _render(renderer, eye, fov_deg, 2 * width, 2 * height).rgb
    image = cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA)
    strip = np.full((22, width, 3), 255, np.uint8)
    cv2.putText(strip, caption, (4, 15), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (40, 40, 40), 1, cv2.LINE_AA)
    cell = np.vstack([image, strip])
    cell[:, -2:] = 255
    return np.asarray(cell, np.uint8)


def _render(renderer: Renderer, eye: Eye, fov_deg: float, width: int, height: int) -> Frame:
    return renderer.render_from(eye, width, height, width / 2 / math.tan(math.radians(fov_deg) / 2))


def _is_free(site: Site, x: float, y: float, z: float, margin_m: float = 0.2) -> bool:
    here = Point(x, y)
    if not any(room.shape.contains(here) for room in site.rooms):
        return False
    if any(wall.shape.distance(here) < margin_m for wall in site.walls):
        return False
    return not any(
        thing.shape.distance(here) < margin_m
        for thing in site.objects
        if thing.elevation_m < z + margin_m and top_m(thing) > z - margin_m
    )


def _room_views(site: Site, renderer: Renderer, room: Room) -> list[_View]:
    """Choose the views with the most objects that no other view shows; larger rooms get more views."""
    wanted = max(1, round(room.shape.area / _AREA_PER_VIEW_M2))
    tried = []
    for eye in _corners(site, room):
        ids = _render(renderer, eye, _ROOM_FOV_DEG, *_TRIAL)
        near = ids.instance[np.isfinite(ids.depth_m) & (ids.depth_m > 0.8)]
        instances, counts = np.unique(near, return_counts=True)
        inside = [
            (int(number), min(int(count), 250))
            for number, count in zip(instances, counts, strict=True)
            if number > 0 and count > 12 and room.shape.contains(Point(site.objects[number - 1].position))
        ]
        crowded = float((ids.depth_m < 0.7).mean())
        tried.append((eye, dict(inside), crowded))
    views: list[_View] = []
    seen: set[int] = set()
    for number in range(min(wanted, len(tried))):
        best = max(
            tried,
            key=lambda item: (
                sum(n for k, n in item[1].items() if k not in seen) + 0.1 * sum(item[1].values()) - 4000 * item[2]
            ),
        )
        tried.remove(best)
        seen |= set(best[1])
        views.append((best[0], _ROOM_FOV_DEG, f"{room.name} {number + 1}" if wanted > 1 else room.name))
    return views


def _corners(site: Site, room: Room) -> Iterable[Eye]:
    x0, y0, x1, y1 = room.shape.bounds
    middle = room.shape.representative_point()
    for x in np.arange(x0 + 0.35, x1 - 0.2, 0.6):
        for y in np.arange(y0 + 0.35, y1 - 0.2, 0.6):
            if not room.shape.contains(Point(x, y)) or not _is_free(site, float(x), float(y), 1.45, 0.25):
                continue
            towards = math.atan2(middle.y - y, middle.x - x)
            for turn in (-0.7, 0.0, 0.7):
                yield Eye(float(x), float(y), 1.45, towards + turn, -0.22)


def _close_up(site: Site, renderer: Renderer, index: int) -> _View:
    """Choose a view of an object from about its front, as near as shows the whole object."""
    thing = site.objects[index]
    caption = thing.category if thing.model in (None, thing.category) else f"{thing.category}: {thing.model}"
    best, best_score = Eye(*thing.position, 1.2, 0.0), -math.inf
    for eye in _around(site, thing):
        instance = _render(renderer, eye, _CLOSE_FOV_DEG, *_TRIAL).instance
        own = instance == index + 1
        cut = int(own[0].sum() + own[-1].sum() + own[:, 0].sum() + own[:, -1].sum())
        aside = abs(math.remainder(eye.heading_rad + math.pi - math.radians(thing.heading_deg), math.tau))
        steep = max(0.0, -eye.tilt_rad - 0.35)
        score = min(float(own.sum()), 1500) - 25 * cut - 350 * abs(aside - 0.5) - 250 * steep
        if score > best_score:
            best, best_score = eye, score
    return best, _CLOSE_FOV_DEG, caption.replace("_", " ")


def _around(site: Site, thing: SiteObject) -> Iterable[Eye]:
    x, y = thing.position
    depth, width, height = thing.size_m
    middle = thing.elevation_m + height / 2
    reach = math.hypot(depth, width, height) / 2
    for turn in (0.0, 0.35, -0.35, 0.7, -0.7, 1.1, -1.1, 1.6, -1.6, 2.4, -2.4, math.pi):
        direction = math.radians(thing.heading_deg) + turn
        for distance in (reach * 1.6 + 0.1, reach * 2.1 + 0.1, reach * 2.7 + 0.2, reach * 3.5 + 0.3):
            ex, ey = x + distance * math.cos(direction), y + distance * math.sin(direction)
            for z in (max(0.5, middle + 0.35 * distance), 1.5):
                if z < site.ceiling_height_m - 0.1 and _is_free(site, ex, ey, z, 0.1):
                    tilt = math.atan2(middle - z, distance)
                    yield Eye(ex, ey, z, direction + math.pi, tilt)
