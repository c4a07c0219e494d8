"""Reads files of scanning apps: meshes with trimesh, and splats; everything is bounded before it is parsed."""

import contextlib
import importlib.util
import io
import logging
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vsnbench.errors import SiteError
from vsnbench.files.regular import open_regular
from vsnbench.installation import command_to_add
from vsnbench.simulator.rendering.scan.mesh import (
    MOST_BYTES,
    MOST_TEXTURES,
    MOST_TRIANGLES,
    Bytes,
    ScanMesh,
)
from vsnbench.simulator.rendering.scan.splats import Splats
from vsnbench.simulator.scan.glb import check_glb
from vsnbench.simulator.scan.splat_files import (
    PLY_TYPES,
    VOXEL_M,
    is_splat_header,
    read_ply_splats,
    read_spz,
    surfaces,
)
from vsnbench.simulator.scan.textures import fill_unused, texture_pixels

_UP: Final = {".glb": "y", ".obj": "y", ".ply": "z", ".spz": "y"}
"""Axis that points up, by the kind of file."""
_MOST_IMAGE_BYTES = 100_000_000
_MOST_MATERIAL_BYTES = 1_000_000
_HEADER_BYTES = 16_384
_DECIMATE = "decimate it in the scanning app, or in MeshLab (Quadric Edge Collapse Decimation)"
_GREY = (160, 160, 160)


def usual_up(path: Path, scan: ScanMesh) -> str:
    """Return the axis that points up in such files: y, z in a PLY file of triangles, -y in one of splats."""
    return "-y" if scan.splats is not None and path.suffix.lower() == ".ply" else _UP[path.suffix.lower()]


def read_scan(path: Path, metres_per_unit: float = 1.0) -> ScanMesh:
    """Read the file of a scanning app, in its own frame and unit.

    The triangles of splats are squares of `VOXEL_M` where opaque splats are.

    Args:
        path: the file.
        metres_per_unit: scale, for the surfaces of splats.

    Raises:
        SiteError: the file cannot be read (`unreadable-file`), is too large (`scan-too-large`), is neither a mesh
            nor splats that can be read (`invalid-scan`), or lacks a texture (`scan-texture`).
    """
    if path.suffix.lower() not in _UP:
        kinds = "export it as .glb, .obj, .ply or .spz"
        raise SiteError(f"cannot read the scan {path}", advice=kinds, code="invalid-scan")
    kind = path.suffix.lower()[1:]
    if kind in ("glb", "obj"):
        _check_packages()
    data = _bytes_of(path, MOST_BYTES, "scan")
    files: dict[str, bytes] = {}
    try:
        if (splats := _splats_in(data, kind)) is not None:
            return surfaces(splats, VOXEL_M / metres_per_unit)
        _check_packages()
        if kind == "glb":
            triangles = check_glb(data)
        elif kind == "ply":
            triangles, names = _check_ply(data)
            files = {name: _beside(path, name, "texture") for name in names}
        else:
            triangles = _least_obj_triangles(data)
            files = _materials(path, data)
        if triangles > MOST_TRIANGLES:
            raise SiteError(
                f"{path} has {triangles:,} triangles; the limit is {MOST_TRIANGLES:,}",
                advice=_DECIMATE,
                code="scan-too-large",
            )
        return _joined(_geometries(data, kind, files))
    except ValueError as problem:
        reason = (str(problem).splitlines() or [""])[0][:200]
        advice = "" if "export" in reason else "export it again as .glb or .ply"
        raise SiteError(f"cannot read the scan {path}: {reason}", advice=advice, code="invalid-scan") from problem


def _check_packages() -> None:
    if importlib.util.find_spec("trimesh") is None or importlib.util.find_spec("PIL") is None:
        add = f"run: {command_to_add('scan')}"
        raise SiteError("reading meshes of scans needs trimesh", advice=add, code="missing-package")


def _bytes_of(path: Path, most: int, what: str) -> bytes:
    try:
        with open_regular(path) as file:
            data = file.read(most + 1)
    except OSError as problem:
        raise SiteError(
            f"cannot read the {what} {path}: {problem.strerror or problem}",
            advice=f"copy the {what} to that place" if what == "texture" else "",
            code="scan-texture" if what == "texture" else "unreadable-file",
        ) from problem
    if len(data) > most:
        raise SiteError(f"{path} has more than {most // 1_000_000} MB", advice=_DECIMATE, code="scan-too-large")
    return data


def _beside(scan: Path, name: str, what: str) -> bytes:
    """Return the content of a file that a scan names; it must be in the scan's folder."""
    root = scan.parent.resolve()
    try:
        path = (root / name.replace("\\", "/")).resolve()
    except (OSError, RuntimeError, ValueError):
        path = root.parent
    if not path.is_relative_to(root) or path == root:
        raise SiteError(
            f"{scan} names the {what} {name[:100]!r} outside its folder",
            advice="copy the file next to the scan and correct the name",
            code="scan-texture",
        )
    return _bytes_of(path, _MOST_IMAGE_BYTES if what == "texture" else _MOST_MATERIAL_BYTES, "texture")


def _materials(path: Path, data: bytes) -> dict[str, bytes]:
    """Return the material file of an OBJ file and the textures that it names, by name."""
    line = re.search(rb"^mtllib[ \t]+([^\r\n]{1,300})", data, re.MULTILINE)
    if line is None:
        return {}
    name = line[1].decode("utf-8", "replace").strip()
    files = {name: _beside(path, name, "material file")}
    named = re.findall(rb"^[ \t]*map_Kd[ \t]+([^\r\n]{1,300})", files[name], re.MULTILINE | re.IGNORECASE)
    if len(named) > MOST_TEXTURES:
        raise ValueError(f"it has more than {MOST_TEXTURES} textures")
    for texture in {entry.decode("utf-8", "replace").strip() for entry in named}:
        files[texture] = _beside(path, texture, "texture")
    if sum(map(len, files.values())) > MOST_BYTES:
        raise ValueError(f"its textures have more than {MOST_BYTES // 1_000_000} MB")
    return files


def _least_obj_triangles(data: bytes) -> int:
    if data.count(b"\nv ") > 3 * MOST_TRIANGLES or data.count(b"\nvt ") > 3 * MOST_TRIANGLES:
        raise ValueError(f"it has more than {3 * MOST_TRIANGLES:,} vertices")
    if re.search(rb"^[^\n]{2000}", data, re.MULTILINE):
        raise ValueError("a line has more than 2,000 characters")
    return data.count(b"\nf ")


def _splats_in(data: bytes, kind: str) -> Splats | None:
    """Return the splats of a file; None if it has triangles."""
    if kind == "spz":
        return read_spz(data)
    end = data.find(b"end_header", 0, _HEADER_BYTES)
    if kind != "ply" or not data.startswith(b"ply") or end < 0:
        return None
    header = data[:end].decode("ascii", "replace")
    return read_ply_splats(data, header, end) if is_splat_header(header) else None


def _check_ply(data: bytes) -> tuple[int, list[str]]:
    """Return the number of faces and the names of textures in a PLY header, after comparing it with the file's size."""
    end = data.find(b"end_header", 0, _HEADER_BYTES)
    if not data.startswith(b"ply") or end < 0:
        raise ValueError(f"it has no PLY header within {_HEADER_BYTES:,} bytes")
    lines = data[:end].decode("ascii", "replace").splitlines()
    counts: dict[str, int] = {}
    textures, least, row = [], 0, 0
    is_text = any(line.split()[1:2] == ["ascii"] for line in lines[:3])
    for line in lines:
        words = line.split()
        if words[:1] == ["element"]:
            if len(words) != 3 or not words[2].isdigit() or len(words[2]) > 12 or words[1] in counts:
                raise ValueError(f"its header has the line {line[:60]!r}")
            row = counts[words[1]] = int(words[2])
        elif words[:1] == ["property"]:
            kind = words[2] if words[1:2] == ["list"] and len(words) > 2 else ([*words, ""])[1]
            if kind not in PLY_TYPES:
                raise ValueError(f"its header has the type {kind[:20]!r}")
            least += row * (2 if is_text else int(PLY_TYPES[kind][1:]))
        elif [word.lower() for word in words[:2]] == ["comment", "texturefile"]:
            textures.append(" ".join(words[2:]))
    if counts.get("vertex", 0) > 3 * MOST_TRIANGLES:
        raise SiteError(
            f"the scan has {counts['vertex']:,} vertices; the limit is {3 * MOST_TRIANGLES:,}",
            advice=_DECIMATE,
            code="scan-too-large",
        )
    if not counts.get("face"):
        raise ValueError("it has neither triangles nor splats: export the mesh of the same scan")
    if counts["face"] <= MOST_TRIANGLES and least > len(data) - end:
        raise ValueError("its header promises more than the file has")
    return counts["face"], textures


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep what trimesh logs about a broken file out of the terminal."""
    log = logging.getLogger("trimesh")
    before, log.disabled = log.disabled, True
    try:
        yield
    finally:
        log.disabled = before


def _geometries(data: bytes, kind: str, files: dict[str, bytes]) -> list[Any]:
    import trimesh

    try:
        with _quiet(), np.errstate(all="ignore"):
            scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, resolver=files, process=False)
            return [
                _placed(part, matrix)
                for matrix, name in (scene.graph[node] for node in scene.graph.nodes_geometry)
                if isinstance(part := scene.geometry[name], trimesh.Trimesh) and len(part.faces)
            ]
    except Exception as problem:  # a parser of broken files fails in any way
        raise ValueError((str(problem).splitlines() or [type(problem).__name__])[0]) from problem


def _placed(part: Any, matrix: Any) -> Any:
    """Return a copy of a part at its place in the scene; trimesh's copy lacks colours of vertices with a material."""
    placed = part.copy()
    placed.apply_transform(matrix)
    if part.visual.kind == "texture":
        placed.visual.vertex_attributes = part.visual.vertex_attributes
    return placed


def _joined(parts: list[Any]) -> ScanMesh:
    """Return the parts of a scene as one mesh."""
    if not parts:
        raise ValueError("it has no triangles")
    if sum(len(part.faces) for part in parts) > MOST_TRIANGLES:
        raise SiteError(f"the scan has more than {MOST_TRIANGLES:,} triangles", advice=_DECIMATE, code="scan-too-large")
    images: list[Any] = []
    vertices, faces, colors, texture, uv = [], [], [], [], []
    start = 0
    for part in parts:
        points, triangles = np.asarray(part.vertices, np.float64), np.asarray(part.faces, np.int64)
        if points.shape[1:] != (3,) or triangles.shape[1:] != (3,):
            raise ValueError("its vertices do not have three coordinates")
        if triangles.min() < 0 or triangles.max() >= len(points):
            raise ValueError("a triangle has a vertex that does not exist")
        image, coordinates, shade = _look_of(part, len(points))
        number = -1
        if image is not None:
            number = next((index for index, known in enumerate(images) if known is image), len(images))
            images += [image] if number == len(images) else []
        vertices.append(points)
        faces.append(triangles + start)
        colors.append(shade)
        texture.append(np.full(len(triangles), number, np.int32))
        uv.append(coordinates[triangles])
        start += len(points)
    points, triangles, corners = np.concatenate(vertices), np.concatenate(faces), np.concatenate(uv)
    whole = np.isfinite(points[triangles]).all(axis=(1, 2)) & np.isfinite(corners).all(axis=(1, 2))
    whole &= (np.abs(corners) < 1e4).all(axis=(1, 2)) & (np.abs(points[triangles]) < 1e6).all(axis=(1, 2))
    if not whole.any():
        raise ValueError("it has no triangles with finite coordinates")
    points[~(np.abs(points) < 1e6)] = 0.0  # of no triangle
    mesh = ScanMesh(
        points.astype(np.float32),
        triangles[whole].astype(np.int32),
        np.concatenate(colors),
        np.concatenate(texture)[whole],
        corners[whole].astype(np.float32),
    )
    pictures = texture_pixels(images)
    for index, picture in enumerate(pictures):
        fill_unused(picture, mesh.uv[mesh.texture == index])
    values = (mesh.vertices, mesh.faces, mesh.colors, mesh.texture, mesh.uv)
    return ScanMesh(*values, textures=tuple(pictures))


def _look_of(part: Any, count: int) -> tuple[Any, npt.NDArray[np.float64], Bytes]:
    """Return the image (or None), the (V, 2) texture coordinates and the (V, 3) colours of a part."""
    import trimesh

    nowhere = np.zeros((count, 2))
    colors = np.tile(np.array(_GREY, np.uint8), (count, 1))
    visual = part.visual
    try:
        if visual.kind != "texture":
            own = np.asarray(visual.vertex_colors)[:, :3]
            return None, nowhere, own.astype(np.uint8) if own.shape == (count, 3) else colors
        material = visual.material
        image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
        coordinates = visual.uv
        if image is not None and coordinates is not None and np.shape(coordinates) == (count, 2):
            return image, np.asarray(coordinates, np.float64) * [1.0, -1.0] + [0.0, 1.0], colors
        own = visual.vertex_attributes.get("color")
        if image is None and own is not None and len(own) == count:
            return None, nowhere, np.asarray(trimesh.visual.to_rgba(own), np.uint8)[:, :3]
        colors[:] = np.asarray(material.main_color)[:3]
    except Exception as problem:
        raise ValueError(f"its colours cannot be read ({type(problem).__name__})") from problem
    return None, nowhere, colors
