"""Scans that are made: a site as an app of a phone would deliver it, with holes, noise, drift, another scale and frame.

A site's surfaces are cut into cells. Views from inside the rooms decide which cells a walk with a phone would see, and
give their colours.
"""

import gzip
import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.free_space import free_space
from vsnbench.simulator.rendering.renderer import Eye, Renderer, camera_axes
from vsnbench.simulator.rendering.scan.mesh import ScanMesh
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.site import Site

Array = npt.NDArray[Any]

WIDTH, HEIGHT, FOCAL = 480, 480, 240.0
PATCH = 6
"""Texels of a cell along one side."""


@dataclass(frozen=True)
class Imperfection:
    """What is wrong with a scan."""

    cell_m: float = 0.10
    holes: int = 60
    hole_m: float = 0.15
    noise_m: float = 0.003
    drift_m: float = 0.02
    scale: float = 1.0
    """Units of the scan per metre."""
    tilt_deg: tuple[float, float] = (2.0, -1.5)
    yaw_deg: float = 33.0
    seed: int = 7


@dataclass(frozen=True)
class MadeScan:
    """A scan in the frame of its app (y up), and where each vertex is on the site."""

    mesh: ScanMesh
    truth_m: Array
    """(V, 3)."""

    def placed(self, vertices: Array) -> tuple[float, Array]:
        """Return the turn (radians) and the shift (3,) that take the site's frame to that of imported vertices."""
        source, target = self.truth_m[:, :2], vertices[:, :2]
        a, b = source - source.mean(axis=0), target - target.mean(axis=0)
        turn = math.atan2(float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()), float((a * b).sum()))
        rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
        shift = target.mean(axis=0) - rotation @ source.mean(axis=0)
        return turn, np.array([*shift, float(np.median(vertices[:, 2] - self.truth_m[:, 2]))])


def make_scan(site: Site, imperfection: Imperfection | None = None) -> MadeScan:
    """Return an imperfect scan of a site."""
    flaws = imperfection or Imperfection()
    rng = np.random.default_rng(flaws.seed)
    renderer = Renderer(build_scene(site))
    cells = _cells(renderer._mesh.corners, flaws.cell_m)
    colors, is_seen = _photographed(cells, renderer, site)
    keep = is_seen.mean(axis=1) > 0.3
    for at in rng.choice(len(cells), flaws.holes, replace=False):
        keep &= np.linalg.norm(cells.mean(axis=1) - cells[at].mean(axis=0), axis=1) > flaws.hole_m
    cells, colors, is_seen = cells[keep], colors[keep], is_seen[keep]
    mean = (colors * is_seen[..., None]).sum(axis=1) / is_seen.sum(axis=1)[:, None]
    colors = np.where(is_seen[..., None], colors, mean[:, None])
    truth, index = np.unique(np.round(cells.reshape(-1, 3), 4), axis=0, return_inverse=True)
    quads = index.reshape(-1, 4)
    drifted = truth + _drift(truth, flaws.drift_m, rng) + rng.normal(0, flaws.noise_m, truth.shape)
    texture, uv = _atlas(colors)
    faces = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    corner_uv = uv[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 2)
    flat = (np.diff(np.sort(faces, axis=1), axis=1) == 0).any(axis=1)
    of_vertex = np.zeros((len(truth), 3), np.uint8)
    corner_texels = [0, PATCH * PATCH - 1 - (PATCH - 1), PATCH * PATCH - 1, PATCH - 1]
    of_vertex[quads.reshape(-1)] = colors[:, corner_texels].reshape(-1, 3)
    vertices = (drifted @ _app_frame(flaws).T * flaws.scale + np.array([1.0, 0.4, -2.0])).astype(np.float32)
    mesh = ScanMesh(
        vertices,
        faces[~flat].astype(np.int32),
        of_vertex,
        np.zeros((~flat).sum(), np.int32),
        corner_uv[~flat].astype(np.float32),
        (texture,),
    )
    return MadeScan(mesh, truth)


def write_scan(mesh: ScanMesh, path: Path) -> None:
    """Write a scan as an app would, by the suffix of the path: textured .glb and .obj, coloured .ply."""
    import trimesh
    from PIL import Image

    if path.suffix == ".ply":
        made = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=mesh.colors, process=False)
    else:
        corners = mesh.vertices[mesh.faces].reshape(-1, 3)
        uv = mesh.uv.reshape(-1, 2) * [1, -1] + [0, 1]
        material = trimesh.visual.material.SimpleMaterial(image=Image.fromarray(mesh.textures[0]))
        visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
        made = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), visual=visual, process=False)
    made.export(path)


def splats_of(mesh: ScanMesh, parts: int = 2, opacity: float = 0.95) -> dict[str, Array]:
    """Return flat splats on the triangles, `parts` squared on each, as training gives them: logarithms and logits."""
    corners = mesh.vertices[mesh.faces].astype(float)
    shares = []
    for i in range(parts):
        for j in range(parts - i):
            shares.append(((i + 1 / 3) / parts, (j + 1 / 3) / parts))
            if i + j < parts - 1:
                shares.append(((i + 2 / 3) / parts, (j + 2 / 3) / parts))
    weights = np.array([(1 - s - t, s, t) for s, t in shares])
    points = np.einsum("pk,fkc->fpc", weights, corners).reshape(-1, 3)
    uv = np.einsum("pk,fkc->fpc", weights, mesh.uv.astype(float)).reshape(-1, 2)
    texture = mesh.texture.repeat(len(shares))
    colors = np.einsum("pk,fkc->fpc", weights, mesh.colors[mesh.faces].astype(float)).reshape(-1, 3) / 255
    for number, picture in enumerate(mesh.textures):
        high, wide = picture.shape[:2]
        own = texture == number
        x, y = (np.floor(uv[own, k] % 1 * size).astype(int) for k, size in ((0, wide), (1, high)))
        colors[own] = picture[y, x] / 255
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(crossed, axis=1)
    normal = crossed / np.maximum(length, 1e-12)[:, None]
    width = 0.55 * np.sqrt(length / 2) / parts
    # The shortest way from z to the normal.
    turn = np.column_stack([1 + normal[:, 2], -normal[:, 1], normal[:, 0], np.zeros(len(normal))])
    turn[normal[:, 2] < -0.9999] = (0, 1, 0, 0)
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    scales = np.column_stack([width, width, np.full(len(width), width.mean() / 20)])
    return {
        "places": points,
        "scales": np.log(np.maximum(scales, 1e-6)).repeat(len(shares), axis=0),
        "turns": turn.repeat(len(shares), axis=0),
        "colors": (colors - 0.5) / 0.28209479,
        "opacity": np.full(len(points), math.log(opacity / (1 - opacity))),
    }


def write_splats(splats: dict[str, Array], path: Path, *, version: int = 3) -> None:
    """Write splats as a .ply of 3D Gaussian splatting, or as an .spz of version 2 or 3."""
    count = len(splats["places"])
    if path.suffix == ".ply":
        names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"]
        names += ["scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
        head = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
        head += [*(f"property float {name}" for name in names), "end_header", ""]
        columns = (splats["places"], np.zeros((count, 3)), splats["colors"], splats["opacity"][:, None])
        body = np.concatenate([*columns, splats["scales"], splats["turns"]], axis=1)
        path.write_bytes("\n".join(head).encode() + body.astype("<f4").tobytes())
        return
    whole = np.rint(splats["places"] * (1 << 12)).astype("<i4").reshape(-1, 1).view(np.uint8)[:, :3]
    opacity = 255 / (1 + np.exp(-splats["opacity"]))
    colors = splats["colors"] * 0.15 * 255 + 127.5
    scales = (splats["scales"] + 10) * 16
    xyzw = splats["turns"][:, [1, 2, 3, 0]]
    if version == 2:
        turns = (xyzw[:, :3] * np.where(xyzw[:, 3:] < 0, -127.5, 127.5) + 127.5).clip(0, 255).round().astype(np.uint8)
    else:
        largest = np.abs(xyzw).argmax(axis=1)
        xyzw = xyzw * np.sign(xyzw[np.arange(count), largest])[:, None]
        bits = largest.astype(np.uint32)
        for k in range(4):
            size = np.rint(np.abs(xyzw[:, k]) * math.sqrt(2) * 511).clip(0, 511).astype(np.uint32)
            packed = (bits << 10) | ((xyzw[:, k] < 0).astype(np.uint32) << 9) | size
            bits = np.where(largest == k, bits, packed).astype(np.uint32)
        turns = bits.astype("<u4").view(np.uint8)
    parts = [whole, *(np.rint(part).clip(0, 255).astype(np.uint8) for part in (opacity, colors, scales)), turns]
    head = struct.pack("<IIIBBBB", 0x5053474E, version, count, 0, 12, 0, 0)
    path.write_bytes(gzip.compress(head + b"".join(part.tobytes() for part in parts), 1))


def _app_frame(flaws: Imperfection) -> Array:
    """Return the rotation from the site to the app's frame: y up, tilted, turned."""
    pitch, roll = np.radians(flaws.tilt_deg)
    yaw = math.radians(flaws.yaw_deg)
    about_z = np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, math.cos(pitch), -math.sin(pitch)], [0, math.sin(pitch), math.cos(pitch)]])
    about_y = np.array([[math.cos(roll), 0, math.sin(roll)], [0, 1, 0], [-math.sin(roll), 0, math.cos(roll)]])
    y_up = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    return y_up @ about_x @ about_y @ about_z


def _drift(points: Array, most_m: float, rng: np.random.Generator) -> Array:
    """Return a displacement that changes slowly over metres, at most `most_m` along each axis."""
    waves = np.array([2 * math.pi / 9, 2 * math.pi / 7, 2 * math.pi / 11])
    phases = rng.uniform(0, 2 * math.pi, 3)
    shares = np.stack([np.sin(points[:, k % 2] * waves[k] + phases[k]) for k in range(3)], axis=1)
    return shares * most_m * np.array([1.0, 1.0, 0.4])


def _cells(corners: Array, cell_m: float) -> Array:
    """Cut faces (F, 4, 3) into cells (N, 4, 3) of at most about `cell_m`."""
    wide = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    high = np.maximum(*(np.linalg.norm(corners[:, k] - corners[:, (k + 1) % 4], axis=1) for k in (1, 3)))
    wide = np.maximum(wide, np.linalg.norm(corners[:, 2] - corners[:, 3], axis=1))
    counts = np.maximum(np.ceil(np.stack([wide, high], axis=1) / cell_m - 0.25), 1).astype(int)
    cells = []
    for columns, rows in np.unique(counts, axis=0):
        these = corners[(counts == (columns, rows)).all(axis=1)]
        s, t = np.linspace(0, 1, columns + 1)[None, :, None], np.linspace(0, 1, rows + 1)[:, None, None]
        a, b, c, d = (these[:, k, None, None, :] for k in range(4))
        grid = (a * (1 - s) + b * s) * (1 - t) + (d * (1 - s) + c * s) * t
        square = np.stack([grid[:, :-1, :-1], grid[:, :-1, 1:], grid[:, 1:, 1:], grid[:, 1:, :-1]], axis=3)
        cells.append(square.reshape(-1, 4, 3))
    return np.concatenate(cells)


def _photographed(cells: Array, renderer: Renderer, site: Site) -> tuple[Array, Array]:
    """Return colours (N, PATCH², 3) of the cells' texels and whether a view showed each."""
    s, t = np.meshgrid(np.linspace(0, 1, PATCH), np.linspace(0, 1, PATCH))
    weights = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=-1).reshape(-1, 4)
    points = np.einsum("pk,nkc->npc", weights, cells).reshape(-1, 3)
    middles, reach = cells.mean(axis=1), np.linalg.norm(cells - cells.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    normals = np.cross(cells[:, 2] - cells[:, 0], cells[:, 3] - cells[:, 1])
    colors, nearest = np.zeros((len(points), 3), np.float32), np.full(len(points), np.inf, np.float32)
    for eye in _walk(site):
        at, axes = np.array([eye.x_m, eye.y_m, eye.z_m]), camera_axes(eye)
        frame = renderer.render_from(eye, WIDTH, HEIGHT, FOCAL)
        local = (middles - at) @ axes.T
        inside = (local[:, 2] > -reach) & (np.abs(local[:, :2]).max(axis=1) < local[:, 2] + 2 * reach)
        faces_it = ((at - middles) * normals).sum(axis=1) > 0
        texels = (
            np.flatnonzero(inside & (local[:, 2] < 4.0) & faces_it)[:, None] * PATCH**2 + np.arange(PATCH**2)
        ).reshape(-1)
        x, y, z = ((points[texels] - at) @ axes.T).T
        columns = np.rint((WIDTH - 1) / 2 + FOCAL * x / np.maximum(z, 0.05)).astype(int)
        rows = np.rint((HEIGHT - 1) / 2 + FOCAL * y / np.maximum(z, 0.05)).astype(int)
        valid = (z > 0.1) & (columns >= 0) & (rows >= 0) & (columns < WIDTH) & (rows < HEIGHT) & (z < nearest[texels])
        texels, columns, rows, z = texels[valid], columns[valid], rows[valid], z[valid]
        shown = np.abs(frame.depth_m[rows, columns] - z) < 0.01 + 0.01 * z
        texels = texels[shown]
        nearest[texels], colors[texels] = z[shown], frame.rgb[rows[shown], columns[shown]]
    count = PATCH * PATCH
    return colors.reshape(-1, count, 3), np.isfinite(nearest).reshape(-1, count)


def _walk(site: Site) -> list[Eye]:
    """Return views of a walk: every 1.5 m of the free floor, in all directions, level, up and down."""
    space = free_space(site, 0.25)
    eyes = []
    for row in range(10, space.cells.shape[0], 60):
        for column in range(10, space.cells.shape[1], 60):
            if space.cells[row, column]:
                x, y = float(space.x_m[row, column]), float(space.y_m[row, column])
                for k in range(4):
                    heading = math.tau * k / 4 + 0.2
                    eyes += [Eye(x, y, 1.4, heading, tilt) for tilt in (-0.75, 0.0, 0.6)]
    return eyes


def _atlas(colors: Array) -> tuple[Array, Array]:
    """Return a texture with a square for each cell, and the (N, 4, 2) coordinates of its corners."""
    columns = math.ceil(math.sqrt(len(colors)))
    side = math.ceil(columns * PATCH / 32) * 32
    texture = np.zeros((side, side, 3), np.uint8)
    k = np.arange(len(colors))
    left, top = (k % columns) * PATCH, (k // columns) * PATCH
    i, j = np.meshgrid(np.arange(PATCH), np.arange(PATCH))
    texture[(top[:, None] + j.reshape(-1)), (left[:, None] + i.reshape(-1))] = np.rint(colors).astype(np.uint8)
    ends = np.array([(0.5, 0.5), (PATCH - 0.5, 0.5), (PATCH - 0.5, PATCH - 0.5), (0.5, PATCH - 0.5)])
    return texture, (np.stack([left, top], axis=1)[:, None, :] + ends) / side
