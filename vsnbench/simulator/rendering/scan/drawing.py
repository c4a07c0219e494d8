"""Draws a scan from any pose: colour, depth and labels from the surveyed volumes of objects."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import shapely

from vsnbench.simulator.rendering.raster import NEAR_M, nearest_first
from vsnbench.simulator.rendering.scan.mesh import Bytes, Floats, Ints, ScanMesh
from vsnbench.simulator.rendering.scan.pixels import fill_holes, label_points
from vsnbench.simulator.rendering.scan.raster import CHUNK, draw_triangles
from vsnbench.simulator.rendering.scan.shading import LEVELS, shade_triangles
from vsnbench.sites.geometry.walls import top_m
from vsnbench.sites.site import SiteObject

_CELL_M = 0.02
_AROUND_M = 0.03
"""How far surfaces of an object may lie outside its surveyed volume, on the floor plan and upwards."""
_ABOVE_FLOOR_M = 0.03
"""Lower points belong to the floor, except those of objects that are themselves as low."""

View = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], float, float, float]
"""Position (3,), axes (3, 3), focal length and centre of a camera, as the kernels take them."""


class ScanDrawer:
    """Draws views of one scan; it has its own buffers and is not thread-safe."""

    def __init__(self, mesh: ScanMesh) -> None:
        self._buffers: dict[tuple[int, int], tuple[Floats, Ints]] = {}
        self._labels: tuple[npt.NDArray[np.float64], Ints, Ints, npt.NDArray[np.float64]] | None = None
        self._splats = mesh.splats
        if self._splats is not None:
            self._splats = self._splats.chosen(_along_a_curve(self._splats.centres))
            self._centres, self._radii = _spheres(_boxes(self._splats.centres[:, None]))
            widest = np.sqrt(self._splats.spreads[:, [0, 3, 5]].max(axis=1).clip(0)).astype(np.float64)
            self._radii += 3 * np.maximum.reduceat(widest, np.arange(0, len(widest), CHUNK))
            return
        order = _along_a_curve(mesh.vertices[mesh.faces].mean(axis=1))
        self._corners = np.ascontiguousarray(mesh.corners[order])
        self._texture = np.ascontiguousarray(mesh.texture[order])
        self._paint = _paint(mesh, order)
        self._sizes, self._starts, self._texels = _pyramids(mesh.textures)
        self._density = _density(self._corners, self._paint, self._texture, self._sizes)
        self._boxes = _boxes(self._corners)
        self._centres, self._radii = _spheres(self._boxes)

    def look(self, view: View, rgb: Bytes, depth_m: Floats) -> None:
        """Draw a view: colours (H, W, 3), and depth (H, W) along the optical axis, which is NaN in holes.

        A hole's colour is the mean of the known pixels around it, over a square that is as large as needed.
        """
        if self._splats is not None:
            light = self._splats.draw(view, (np.flatnonzero(self._in_view(view, depth_m.shape)), CHUNK), depth_m)
            known = ~np.isnan(depth_m)
            rgb[:] = np.where(known[..., None], light[..., :3] / np.maximum(1 - light[..., 3:], 0.5) + 0.5, 0)
            if not known.all():
                fill_holes(rgb, known)
            return
        nearness, seen = self._faces(view, depth_m.shape)
        surface = (self._corners, self._paint, self._texture, self._density, self._sizes, self._starts, self._texels)
        if shade_triangles(*view, nearness, seen, *surface, rgb, depth_m):
            fill_holes(rgb, seen >= 0)

    def measure(self, view: View, shape: tuple[int, int]) -> Floats:
        """Return only the depth of `look`."""
        if self._splats is not None:
            depth_m = np.empty(shape, np.float32)
            self._splats.draw(view, (np.flatnonzero(self._in_view(view, shape)), CHUNK), depth_m)
            return depth_m
        nearness, _ = self._faces(view, shape)
        with np.errstate(divide="ignore"):
            depth_m = np.reciprocal(nearness)
        depth_m[nearness == 0] = np.nan
        return depth_m

    def survey(self, objects: Sequence[SiteObject]) -> None:
        """Take the objects whose volumes give the labels."""
        self._labels = _volumes(objects)

    def label(self, view: View, depth_m: Floats, instance: Ints) -> None:
        """Write 1 + index of the surveyed object of each pixel, 0 for none."""
        instance.fill(0)
        if self._labels is not None:
            origin, first, second, spans = self._labels
            label_points(*view, depth_m, origin, _CELL_M, first, second, spans, instance)

    def _faces(self, view: View, size: tuple[int, ...]) -> tuple[Floats, Ints]:
        key = (size[0], size[1])
        if key not in self._buffers:
            self._buffers[key] = (np.empty(key, np.float32), np.empty(key, np.int32))
        nearness, seen = self._buffers[key]
        nearness.fill(0.0)
        seen.fill(-1)
        order = nearest_first(view[0], self._centres, self._radii)
        order = order[self._in_view(view, size)[order]]
        draw_triangles(*view, self._corners, self._boxes, order, nearness, seen)
        return nearness, seen

    def _in_view(self, view: View, size: tuple[int, ...]) -> npt.NDArray[np.bool_]:
        """Return which chunks may be in view, by the spheres around them."""
        eye, axes, focal, centre_x, centre_y = view
        x, y, z = ((self._centres - eye) @ axes.T).T
        inside: npt.NDArray[np.bool_] = z + self._radii >= NEAR_M
        for across, centre, length in ((x, centre_x, size[1]), (y, centre_y, size[0])):
            slope = max(centre + 0.5, length - centre) / focal
            inside &= np.abs(across) - slope * z <= self._radii * np.sqrt(1 + slope * slope)
        return inside


def _along_a_curve(points: Floats) -> npt.NDArray[np.intp]:
    """Return the points (N, 3) in an order in which neighbours are near each other in space."""
    low, high = points.min(axis=0), points.max(axis=0)
    cells = ((points - low) / max(float((high - low).max()), 1e-6) * 1023).astype(np.uint64)
    code = np.zeros(len(cells), np.uint64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return np.argsort(code, kind="stable")


def _paint(mesh: ScanMesh, order: npt.NDArray[np.intp]) -> Floats:
    paint = mesh.colors[mesh.faces[order]].astype(np.float32)
    textured = mesh.texture[order] >= 0
    paint[textured, :, :2] = mesh.uv[order[textured]]
    return np.ascontiguousarray(paint)


def _pyramids(
    textures: Sequence[Bytes],
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.uint32]]:
    """Return sizes (N, 2), starts (N, LEVELS) and packed pixels of all textures, each halved five times."""
    sizes = np.array([picture.shape[1::-1] for picture in textures], np.int64).reshape(-1, 2)
    starts = np.zeros((len(textures), LEVELS), np.int64)
    texels = np.zeros(sum(int(w >> level) * int(h >> level) for w, h in sizes for level in range(LEVELS)), np.uint32)
    at = 0
    for number, picture in enumerate(textures):
        for level in range(LEVELS):
            starts[number, level] = at
            packed = texels[at : at + picture.shape[0] * picture.shape[1]].reshape(picture.shape[:2])
            for channel in range(3):
                packed |= picture[..., channel].astype(np.uint32) << np.uint32(8 * channel)
            at += packed.size
            if level + 1 < LEVELS:
                total = picture[::2, ::2].astype(np.uint16) + picture[1::2, ::2]
                total += picture[::2, 1::2].astype(np.uint16) + picture[1::2, 1::2]
                picture = ((total + 2) >> 2).astype(np.uint8)  # noqa: PLW2901 - the next size
    return sizes, starts, texels


def _density(corners: Floats, paint: Floats, texture: Ints, sizes: npt.NDArray[np.int64]) -> Floats:
    """Return the texels per metre of each triangle."""
    density = np.zeros(len(corners), np.float32)
    textured = np.flatnonzero(texture >= 0)
    if textured.size:
        edges = corners[textured, 1:].astype(np.float64) - corners[textured, :1]
        area = np.sqrt((np.cross(edges[:, 0], edges[:, 1]) ** 2).sum(axis=1))
        flat = paint[textured, 1:, :2].astype(np.float64) - paint[textured, :1, :2]
        texels = np.abs(flat[:, 0, 0] * flat[:, 1, 1] - flat[:, 0, 1] * flat[:, 1, 0])
        texels *= sizes[texture[textured]].prod(axis=1)
        density[textured] = np.sqrt(texels / np.maximum(area, 1e-12))
    return density


def _boxes(corners: Floats) -> npt.NDArray[np.float64]:
    """Return the lowest and highest coordinates (C, 2, 3) of chunks of triangles, or of points."""
    starts = np.arange(0, len(corners), CHUNK)
    low = np.minimum.reduceat(corners.min(axis=1), starts, axis=0)
    high = np.maximum.reduceat(corners.max(axis=1), starts, axis=0)
    return np.stack([low, high], axis=1).astype(np.float64)


def _spheres(boxes: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return centres (C, 3) and radii (C,) of the spheres around boxes."""
    low, high = boxes[:, 0], boxes[:, 1]
    return (low + high) / 2, np.sqrt(((high - low) ** 2).sum(axis=1)) / 2 + 1e-6


def _volumes(
    objects: Sequence[SiteObject],
) -> tuple[npt.NDArray[np.float64], Ints, Ints, npt.NDArray[np.float64]] | None:
    """Return origin (2,), the two highest objects over each cell of a grid, and the height range of each object."""
    if not objects:
        return None
    shapes = [thing.shape.buffer(_AROUND_M, join_style="mitre") for thing in objects]
    x_min, y_min, x_max, y_max = shapely.total_bounds(shapes).tolist()
    xs, ys = (np.arange(low, high + _CELL_M, _CELL_M) + _CELL_M / 2 for low, high in ((x_min, x_max), (y_min, y_max)))
    first, second = (np.zeros((len(ys), len(xs)), np.int32) for _ in range(2))
    spans = np.zeros((len(objects) + 1, 2))
    for index in sorted(range(len(objects)), key=lambda index: top_m(objects[index])):
        thing, shape = objects[index], shapes[index]
        spans[index + 1] = (max(thing.elevation_m - _AROUND_M, _ABOVE_FLOOR_M), top_m(thing) + _AROUND_M)
        if top_m(thing) < 2 * _ABOVE_FLOOR_M:
            spans[index + 1, 0] = thing.elevation_m + top_m(thing) / 3
        x0, y0, x1, y1 = shape.bounds
        columns = slice(*np.searchsorted(xs, (x0, x1)).tolist())
        rows = slice(*np.searchsorted(ys, (y0, y1)).tolist())
        grid = np.meshgrid(xs[columns], ys[rows])
        inside = shapely.contains_xy(shape, *grid)
        second[rows, columns][inside] = first[rows, columns][inside]
        first[rows, columns][inside] = index + 1
    return np.array([x_min, y_min]), first, second, spans
