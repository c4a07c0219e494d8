"""Reads Gaussian splats from PLY files of 3D Gaussian splatting and SPZ files, and finds their surfaces."""

import math
import re
import struct
import zlib
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vsnbench.errors import SiteError
from vsnbench.simulator.rendering.scan.mesh import ScanMesh
from vsnbench.simulator.rendering.scan.splats import MOST_SPLATS, Splats

VOXEL_M: Final = 0.04
"""Side of the voxels whose opaque splats are surfaces."""
_OPAQUE: Final = 100
"""Opacity, 0 to 255, from which a splat is part of a surface."""
_LEAST_WEIGHT: Final = 0.6
"""Sum of opacities from which a voxel has a surface."""
_SPAN: Final = 1.5
"""Standard deviations up to which a splat covers its surface."""
_MOST_STEPS: Final = 12
_BAND: Final = 0.2820948
"""Value of the spherical harmonic of degree 0."""
_SPZ_HEADER: Final = struct.Struct("<IIIBBBB")
_SPZ_MAGIC, _SPZ_COLOR = 0x5053474E, 0.15
_GZIP: Final = 16 + zlib.MAX_WBITS
PLY_TYPES: Final = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
_AS_PLAIN: Final = "export the splats as a plain .ply of 3D Gaussian splatting, or as .spz"

Floats = npt.NDArray[np.float64]


def is_splat_header(header: str) -> bool:
    """Return whether a PLY header describes splats."""
    names = {line.split()[-1] for line in header.splitlines() if line.startswith("property ")}
    return bool(names & {"f_dc_0", "scale_0", "rot_0", "packed_position"})


def read_ply_splats(data: bytes, header: str, start: int) -> Splats:
    """Read the vertices of a PLY file of 3D Gaussian splatting.

    Args:
        data: the file.
        header: its header.
        start: where the header's last word begins.

    Raises:
        ValueError: the file is not complete, or lacks a property.
        SiteError: it has too many splats (`scan-too-large`).
    """
    first, element, order, count = "", "", "", 0
    rows: list[tuple[str, str]] = []
    for line in header.splitlines():
        words = line.split()
        if words[:1] == ["format"] and len(words) > 1:
            order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(words[1], "")
        elif words[:1] == ["element"] and len(words) == 3:
            first, element = first or words[1], words[1]
            count = int(words[2]) if element == "vertex" and re.fullmatch("[0-9]{1,12}", words[2]) else count
        elif words[:1] == ["property"] and element == "vertex":
            if len(words) != 3 or words[1] not in PLY_TYPES:
                raise ValueError(f"its header has the line {line[:60]!r}")
            rows.append((words[2], order + PLY_TYPES[words[1]]))
    _check_count(count)
    names = [name for name, _ in rows]
    if "packed_position" in names:
        raise ValueError(f"its splats are compressed: {_AS_PLAIN}")
    if not order or first != "vertex" or len(set(names)) != len(names):
        raise ValueError(f"its splats are not plain binary values: {_AS_PLAIN}")
    if "opacity" not in names:
        raise ValueError(f"its splats have no opacity: {_AS_PLAIN}")
    needed = ["x", "y", "z", *(f"{name}_{k}" for name, n in (("f_dc", 3), ("scale", 3), ("rot", 4)) for k in range(n))]
    if missing := [name for name in needed if name not in names]:
        raise ValueError(f"its splats have no {missing[0]}: {_AS_PLAIN}")
    kind = np.dtype(rows)
    body = data[data.find(b"\n", start) + 1 :]
    if len(body) < count * kind.itemsize:
        raise ValueError("its header promises more than the file has")
    table = np.frombuffer(body, kind, count)

    def columns(*which: str) -> Floats:
        return np.stack([table[name].astype(np.float64) for name in which], axis=1)

    with np.errstate(over="ignore", invalid="ignore"):
        opacity = 1 / (1 + np.exp(-columns("opacity")[:, 0]))
        colors = 0.5 + _BAND * columns("f_dc_0", "f_dc_1", "f_dc_2")
        scales = np.exp(columns("scale_0", "scale_1", "scale_2"))
    return _splats(columns("x", "y", "z"), scales, columns("rot_0", "rot_1", "rot_2", "rot_3"), colors, opacity)


def read_spz(data: bytes) -> Splats:
    """Read an SPZ file of version 2 or 3.

    Raises:
        ValueError: it is not such a file, or is not complete.
        SiteError: it has too many splats (`scan-too-large`).
    """
    if data[:4] == b"NGSP":
        raise ValueError("its splats have version 4 of SPZ: export version 3, or a .ply of 3D Gaussian splatting")
    unpacker = zlib.decompressobj(_GZIP)
    try:
        head = unpacker.decompress(data, _SPZ_HEADER.size)
        if len(head) < _SPZ_HEADER.size:
            raise ValueError("it is not an SPZ file")
        magic, version, count, degree, fraction, _, _ = _SPZ_HEADER.unpack(head)
        if magic != _SPZ_MAGIC or version not in (2, 3) or degree > 4 or fraction > 24:
            raise ValueError("it is not an SPZ file of version 2 or 3")
        _check_count(count)
        turn_bytes = 3 if version == 2 else 4
        needed = count * (9 + 1 + 3 + 3 + turn_bytes)
        body = unpacker.decompress(unpacker.unconsumed_tail, needed)
    except zlib.error as problem:
        raise ValueError(f"it cannot be decompressed ({problem})") from problem
    if len(body) < needed:
        raise ValueError("its header promises more than the file has")
    values, at = np.frombuffer(body, np.uint8), 0

    def take(width: int) -> Any:
        nonlocal at
        at += count * width
        return values[at - count * width : at].reshape(count, width)

    triples = take(9).reshape(count, 3, 3).astype(np.int32)
    whole = triples[..., 0] | (triples[..., 1] << 8) | (triples[..., 2] << 16)
    places = (whole - ((whole & 0x800000) << 1)) / float(1 << fraction)
    opacity = take(1)[:, 0] / 255
    colors = 0.5 + _BAND * (take(3) / 255 - 0.5) / _SPZ_COLOR
    scales = np.exp(take(3) / 16.0 - 10.0)
    turns = _first_three(take(3)) if version == 2 else _smallest_three(take(4))
    return _splats(places, scales, turns, colors, opacity)


def _check_count(count: int) -> None:
    if count > MOST_SPLATS:
        raise SiteError(
            f"the scan has {count:,} splats; the limit is {MOST_SPLATS:,}",
            advice="crop or reduce the splats in the scanning app, or in SuperSplat",
            code="scan-too-large",
        )
    if count == 0:
        raise ValueError("it has no splats")


def _first_three(packed: npt.NDArray[np.uint8]) -> Floats:
    """Return the (N, 4) quaternions w, x, y, z of version 2, which stores x, y and z."""
    xyz = packed / 127.5 - 1
    w = np.sqrt(np.maximum(1 - (xyz * xyz).sum(axis=1), 0))
    return np.column_stack([w, xyz])


def _smallest_three(packed: npt.NDArray[np.uint8]) -> Floats:
    """Return the (N, 4) quaternions w, x, y, z of version 3, which leaves out the largest of x, y, z, w."""
    bits = packed.astype(np.uint32) @ np.array([1, 1 << 8, 1 << 16, 1 << 24], np.uint32)
    largest, values = (bits >> 30).astype(int), np.zeros((len(bits), 4))
    rows = np.arange(len(bits))
    for place in range(3, -1, -1):
        other = largest != place
        size = (bits & 511) / 511 * math.sqrt(0.5)
        values[other, place] = np.where(bits >> 9 & 1, -size, size)[other]
        bits = np.where(other, bits >> 10, bits)
    values[rows, largest] = np.sqrt(np.maximum(1 - (values * values).sum(axis=1), 0))
    return values[:, [3, 0, 1, 2]]


def _splats(places: Floats, scales: Floats, turns: Floats, colors: Floats, opacity: Floats) -> Splats:
    """Return the splats with finite values.

    Args:
        places: (N, 3).
        scales: (N, 3) standard deviations along the own axes.
        turns: (N, 4) quaternions w, x, y, z of any length.
        colors: (N, 3) from 0 to 1.
        opacity: (N,) from 0 to 1.
    """
    with np.errstate(all="ignore"):
        length = np.sqrt((turns * turns).sum(axis=1))
        fits = np.isfinite(places).all(axis=1) & np.isfinite(colors).all(axis=1) & (length > 1e-6) & (length < 1e6)
        fits &= (np.abs(places) < 1e6).all(axis=1) & (scales < 1e4).all(axis=1) & (opacity > 1 / 255)
    if not fits.any():
        raise ValueError("it has no splats with finite values that are not transparent")
    w, x, y, z = (turns[fits] / length[fits, None]).T
    axes = np.stack(
        [
            *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        ],
        axis=1,
    ).reshape(-1, 3, 3)
    stretched = axes * scales[fits, None, :]
    spreads = (stretched @ stretched.transpose(0, 2, 1)).reshape(-1, 9)[:, [0, 1, 2, 4, 5, 8]]
    paint = np.column_stack([colors[fits], opacity[fits]])
    return Splats(
        places[fits].astype(np.float32),
        spreads.astype(np.float32),
        np.rint(np.clip(paint, 0, 1) * 255).astype(np.uint8),
    )


def surfaces(splats: Splats, voxel: float) -> ScanMesh:
    """Return a square for each voxel in which opaque splats are, in the plane in which they lie, facing the middle.

    Args:
        splats: the splats.
        voxel: side of a voxel in the unit of the splats.

    Raises:
        ValueError: no splat is opaque.
    """
    opaque = splats.chosen(splats.paint[:, 3] >= _OPAQUE)
    points, paint = _points_on(opaque, voxel) if len(opaque.centres) else (np.zeros((0, 3)), np.zeros((0, 4)))
    if not len(points):
        raise ValueError("its splats are all transparent")
    low = np.percentile(points, 0.5, axis=0)
    cells = np.floor((points - low) / voxel)
    near = (np.abs(cells) < 2**20).all(axis=1)
    points, paint, cells = points[near], paint[near], cells[near].astype(np.int64) + 2**20
    _, of = np.unique((cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2], return_inverse=True)
    weight = paint[:, 3]
    total = np.bincount(of, weight)

    def mean(values: Floats) -> Floats:
        return np.stack([np.bincount(of, weight * column) for column in values.T], axis=1) / total[:, None]

    middles, colors = mean(points), mean(paint[:, :3])
    off = (points - middles[of]) / voxel
    spread = mean(np.stack([off[:, i] * off[:, j] for i in range(3) for j in range(3)], axis=1)).reshape(-1, 3, 3)
    kept = total >= _LEAST_WEIGHT
    if not kept.any():
        raise ValueError("its splats are too thin for a surface")
    _, axes = np.linalg.eigh(spread[kept])
    normal, side = axes[..., 0], axes[..., 2]
    middles, colors = middles[kept], colors[kept]
    inside = np.median(middles, axis=0) - middles
    normal *= np.where((normal * inside).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    other = np.cross(normal, side)
    corners = [middles + voxel / 2 * (a * side + b * other) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    vertices = np.stack(corners, axis=1).reshape(-1, 3).astype(np.float32)
    first = np.arange(len(middles))[:, None, None] * 4
    faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(np.int32)
    shades = np.rint(colors).astype(np.uint8).repeat(4, axis=0)
    texture = np.full(len(faces), -1, np.int32)
    return ScanMesh(vertices, faces, shades, texture, np.zeros((len(faces), 3, 2), np.float32), splats=splats)


def _points_on(splats: Splats, step: float) -> tuple[Floats, Floats]:
    """Return points (P, 3) on splats in the plane of their two largest axes, and colour and opacity (P, 4) of each."""
    xx, xy, xz, yy, yz, zz = splats.spreads.astype(np.float64).T
    variances, axes = np.linalg.eigh(np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(-1, 3, 3))
    reach = _SPAN * np.sqrt(np.maximum(variances[:, 1:], 0))
    counts = np.clip(np.ceil(2 * reach / step), 1, _MOST_STEPS).astype(int)
    paint = splats.paint.astype(np.float64)
    paint[:, 3] /= 255
    points, shades = [], []
    for first, second in np.unique(counts, axis=0):
        which = np.flatnonzero((counts == (first, second)).all(axis=1))
        s, t = np.meshgrid(*((np.arange(n) + 0.5) / n * 2 - 1 for n in (first, second)))
        s, t = (grid.reshape(1, -1, 1) for grid in (s, t))
        along = axes[which, None, :, 1] * reach[which, None, :1] * s
        across = axes[which, None, :, 2] * reach[which, None, 1:] * t
        points.append((splats.centres[which, None] + along + across).reshape(-1, 3))
        shades.append(paint[which].repeat(s.size, axis=0))
    return np.concatenate(points), np.concatenate(shades)
