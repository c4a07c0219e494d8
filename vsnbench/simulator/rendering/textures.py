"""Procedural textures: small seamless images, computed once, that multiply a surface's colour.

Each is stored at half, quarter, ... sizes too, so that distant surfaces are averaged.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import cache

import numpy as np
import numpy.typing as npt

from vsnbench.files.disk_cache import cached_array, code_key

SIZE = 256
"""Width and height of a texture, pixels."""
LEVELS = 9
"""Number of stored sizes: 256, 128, ... 1."""
FULL = 160.0
"""Stored value that does not change the surface's colour; linear light."""

Plane = npt.NDArray[np.float64]


class Mapping(Enum):
    """Orientation of a texture on a face."""

    GRAIN = "grain"
    """Along the longer side."""
    LEVEL = "level"
    """Upright."""
    FIT = "fit"
    """Upright, one copy stretched over the face."""


@dataclass(frozen=True, slots=True)
class Texture:
    """Function that draws a texture, and the size of one copy."""

    draw: Callable[[np.random.Generator], Plane]
    """Returns (SIZE, SIZE) or (SIZE, SIZE, 3) multipliers around 1; row is t, column is s."""
    size_m: tuple[float, float] = (1.0, 1.0)
    mapping: Mapping = Mapping.GRAIN


def _grid() -> tuple[Plane, Plane]:
    """Return s and t in [0, 1) of every pixel."""
    steps = (np.arange(SIZE) + 0.5) / SIZE
    s, t = np.meshgrid(steps, steps)
    return s, t


def _noise(rng: np.random.Generator, cells_s: int, cells_t: int) -> Plane:
    """Return seamless smooth noise in [-1, 1] with `cells` cells along each side."""
    lattice = rng.uniform(-1, 1, (cells_t, cells_s))
    s, t = _grid()
    x, y = s * cells_s, t * cells_t
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = x - i, y - j
    fx, fy = fx * fx * (3 - 2 * fx), fy * fy * (3 - 2 * fy)
    i0, i1, j0, j1 = i % cells_s, (i + 1) % cells_s, j % cells_t, (j + 1) % cells_t
    low = lattice[j0, i0] * (1 - fx) + lattice[j0, i1] * fx
    high = lattice[j1, i0] * (1 - fx) + lattice[j1, i1] * fx
    return np.asarray(low * (1 - fy) + high * fy)


def _clouds(rng: np.random.Generator, cells: int, octaves: int = 4) -> Plane:
    total = np.zeros((SIZE, SIZE))
    for octave in range(octaves):
        total += _noise(rng, cells << octave, cells << octave) * 0.5**octave
    return total


def _plain(_: np.random.Generator) -> Plane:
    return np.ones((SIZE, SIZE))


def _plaster(rng: np.random.Generator) -> Plane:
    return 1 + 0.012 * _clouds(rng, 8, 3) + 0.02 * _relief(_clouds(rng, 48, 2)) + 0.01 * _speckle(rng)


def _speckle(rng: np.random.Generator) -> Plane:
    """Return an independent value in [-1, 1] for every pixel."""
    return rng.uniform(-1, 1, (SIZE, SIZE))


def _relief(height: Plane) -> Plane:
    """Return the shading of a bumpy surface that is lit from above and the left, in [-1, 1]."""
    slope = np.roll(height, 1, 0) - np.roll(height, -1, 0) + 0.7 * (np.roll(height, -1, 1) - np.roll(height, 1, 1))
    return np.asarray(np.clip(slope / (2.5 * np.std(slope)), -1, 1))


def _grain(rng: np.random.Generator, rings: float) -> Plane:
    """Streaks along s with slow bends, from broad growth rings to fine pores."""
    _, t = _grid()
    bend = 0.09 * _noise(rng, 2, 3) + 0.05 * _noise(rng, 2, 9) + 0.012 * _noise(rng, 6, 6)
    # Growth rings are dark at one edge and fade towards the next ring.
    phase = rings * (t + bend)
    rings_ = (phase - np.floor(phase)) ** 1.6
    strength = 0.5 + 0.5 * _noise(rng, 2, 7)
    fine = 0.6 * _noise(rng, 3, 256) + 0.4 * _noise(rng, 5, 128)
    pores = (_noise(rng, 16, 256) > 0.55) * 0.5
    broad = 0.5 + 0.5 * _noise(rng, 1, 12)
    return np.asarray(0.3 * rings_ * strength + 0.4 * (0.5 + 0.5 * fine) + 0.3 * broad - 0.3 * pores)


def _two_tone(share: Plane, dark: tuple[float, float, float], light: tuple[float, float, float]) -> Plane:
    return np.asarray(np.array(dark) + share[..., None] * (np.array(light) - np.array(dark)))


def _wood(rng: np.random.Generator) -> Plane:
    return _two_tone(_grain(rng, 9), (0.74, 0.72, 0.72), (1.24, 1.27, 1.34))


def _planks(rng: np.random.Generator) -> Plane:
    s, t = _grid()
    rows, length = 8, 2
    row = np.floor(t * rows).astype(int)
    shift = rng.uniform(0, 1, rows)[row]
    along = s * length + shift
    plank = np.floor(along).astype(int) % length
    tone = rng.uniform(0.74, 1.12, (rows, length))[row, plank]
    warm = rng.uniform(-0.05, 0.05, (rows, length))[row, plank]
    grain = _grain(rng, 28)
    across = t * rows - np.floor(t * rows)
    end = along - np.floor(along)
    edge = np.minimum(np.minimum(across, 1 - across) * 0.12, np.minimum(end, 1 - end) * 1.0)
    seam = np.clip(edge / 0.0045, 0, 1)
    value = tone * (0.86 + 0.2 * grain) * (0.45 + 0.55 * seam)
    return np.asarray(value[..., None] * np.stack([1 + warm, np.ones_like(warm), 1 - 1.5 * warm], axis=-1))


def _tiling(rng: np.random.Generator, count: int, joint: float, spread: float) -> Plane:
    s, t = _grid()
    i, j = np.floor(s * count).astype(int), np.floor(t * count).astype(int)
    tone = rng.uniform(1 - spread, 1 + spread / 2, (count, count))[j, i]
    x, y = s * count - i, t * count - j
    edge = np.minimum(np.minimum(x, 1 - x), np.minimum(y, 1 - y))
    body = np.clip((edge - joint) / 0.012, 0, 1)
    return np.asarray((tone + 0.03 * _clouds(rng, 8, 3)) * body + 0.55 * (1 - body))


def _fabric(rng: np.random.Generator) -> Plane:
    """A coarse weave of mottled yarn, with soft dents."""
    rows, columns = np.indices((SIZE, SIZE))
    weave = np.where((rows // 2 + columns // 2) % 2, 0.06, -0.06)
    yarn = 0.06 * _noise(rng, 256, 64) + 0.06 * _noise(rng, 64, 256)
    return 0.98 + weave + yarn + 0.05 * _clouds(rng, 3, 3) + 0.05 * _relief(_clouds(rng, 2, 2)) + 0.03 * _speckle(rng)


def _cloth(rng: np.random.Generator) -> Plane:
    """Linen with folds: creases along ridges of smooth noise."""
    height = -np.abs(_clouds(rng, 3, 2)) - 0.5 * np.abs(_noise(rng, 7, 4))
    soft = _relief(_soften(height, 3))
    return 0.98 + 0.11 * soft + 0.03 * _clouds(rng, 4, 3) + 0.02 * _speckle(rng)


def _soften(plane: Plane, reach: int) -> Plane:
    """Return the mean over the neighbours within `reach` pixels along both sides, seamless."""
    for axis in (0, 1):
        plane = np.mean([np.roll(plane, shift, axis) for shift in range(-reach, reach + 1)], axis=0)
    return plane


def _carpet(rng: np.random.Generator) -> Plane:
    return 0.96 + 0.04 * _clouds(rng, 4, 3) + 0.1 * _clouds(rng, 64, 2) + 0.12 * _speckle(rng)


def _rug(rng: np.random.Generator) -> Plane:
    s, t = _grid()
    fold = np.abs(((s * 2) % 1) - 0.5) + np.abs(((t * 2) % 1) - 0.5)
    bands = np.where(np.abs(fold - 0.5) < 0.07, 0.55, np.where(fold < 0.18, 0.7, 1.0))
    return _carpet(rng) * bands


def _metal(rng: np.random.Generator) -> Plane:
    return 0.98 + 0.05 * _noise(rng, 2, 128) + 0.03 * _noise(rng, 4, 64)


def _stone(rng: np.random.Generator) -> Plane:
    speckle = rng.uniform(0, 1, (SIZE, SIZE))
    grit = 0.16 * (speckle > 0.95) - 0.18 * (speckle < 0.06)
    return np.asarray(0.97 + 0.05 * _clouds(rng, 3, 5) + grit + 0.03 * _speckle(rng))


def _leaf(rng: np.random.Generator) -> Plane:
    """Ribs and patches of lighter green."""
    s, t = _grid()
    ribs = np.abs(((s + 0.6 * np.abs(t - 0.5)) * 12) % 1 - 0.5) < 0.06
    tone = 0.95 + 0.25 * _clouds(rng, 5, 3) + 0.12 * ribs
    return _two_tone(np.clip(tone / 1.6, 0, 1), (0.45, 0.5, 0.35), (1.6, 1.45, 1.3))


def _books(rng: np.random.Generator) -> Plane:
    s, t = _grid()
    count = 8
    book = np.floor(s * count).astype(int)
    tone = rng.uniform(0.75, 1.15, count)[book]
    x = s * count - book
    spine = np.clip(np.minimum(x, 1 - x) / 0.1, 0.25, 1)
    band = np.where((np.abs(((t * 3) % 1) - 0.5) < 0.05) & (np.abs(x - 0.5) < 0.4), 1.35, 1.0)
    return np.asarray(tone * spine * band)


def _screen(rng: np.random.Generator) -> Plane:
    """A desktop: wallpaper, a window of text, a task bar."""
    s, t = _grid()
    picture = np.stack([0.05 + 0.1 * t, 0.16 + 0.2 * t + 0 * s, 0.42 + 0.25 * s], axis=-1)
    window = (s > 0.14) & (s < 0.7) & (t > 0.2) & (t < 0.85)
    picture[window] = (0.86, 0.87, 0.9)
    picture[(s > 0.14) & (s < 0.7) & (t > 0.79) & (t < 0.85)] = (0.22, 0.27, 0.36)
    line = np.floor((t - 0.22) / 0.045).astype(int)
    reach = rng.uniform(0.2, 0.5, 20)[np.clip(line, 0, 19)]
    text = window & (((t - 0.22) / 0.045) % 1 < 0.5) & (t < 0.77) & (t > 0.22) & (s > 0.18) & (s < 0.18 + reach)
    picture[text] = (0.25, 0.27, 0.32)
    picture[t < 0.06] = (0.08, 0.09, 0.12)
    return picture


def _film(rng: np.random.Generator) -> Plane:
    """A landscape at dusk."""
    s, t = _grid()
    sky = np.stack([0.75 - 0.5 * t, 0.32 - 0.12 * t, 0.25 + 0.2 * t], axis=-1)
    ridge = 0.45 + 0.1 * _noise(rng, 5, 1) + 0.05 * _noise(rng, 11, 1)
    near = 0.25 + 0.08 * _noise(rng, 4, 1)
    sky[t < ridge] = (0.1, 0.12, 0.22)
    sky[t < near] = (0.03, 0.05, 0.08)
    sun = np.hypot((s - 0.68) * 1.7, t - 0.58) < 0.07
    sky[sun & (t > ridge)] = (1.3, 0.9, 0.5)
    return sky


def _painting(rng: np.random.Generator) -> Plane:
    """Broad brush strokes of colour."""
    s, t = _grid()
    wave = t + 0.09 * _noise(rng, 3, 3) + 0.03 * _noise(rng, 9, 9)
    fields = [(0.1, 0.22, 0.38), (0.2, 0.42, 0.45), (0.75, 0.62, 0.35), (0.8, 0.4, 0.2), (0.85, 0.78, 0.66)]
    picture = np.array(fields)[np.clip(np.floor(wave * 5), 0, 4).astype(int)]
    picture[np.hypot(s - 0.35, (t - 0.68) * 0.8) < 0.1] = (0.9, 0.75, 0.45)
    return np.asarray(picture * (1 + 0.12 * _noise(rng, 16, 96))[..., None])


def _sky(rng: np.random.Generator) -> Plane:
    """The outdoors behind windows: s is the horizontal direction, t runs from straight down to straight up."""
    _, t = _grid()
    elevation = 2 * t - 1
    haze = np.clip(elevation * 2.2, 0, 1)[..., None]
    picture = (1 - haze) * np.array([1.15, 1.2, 1.25]) + haze * np.array([0.42, 0.68, 1.15])
    cloud = np.clip(_clouds(rng, 5, 5) * 1.4 - 0.35 + 0.3 * (0.5 - np.abs(elevation - 0.35)), 0, 0.8)[..., None]
    picture = picture * (1 - cloud) + 1.3 * cloud
    hills = 0.045 + 0.03 * _noise(rng, 9, 1) + 0.012 * _noise(rng, 40, 1)
    trees = 0.0 + 0.03 * _noise(rng, 24, 1) + 0.02 * _noise(rng, 80, 1)
    picture[elevation < hills] = (0.42, 0.52, 0.55)
    leaves = (0.75 + 0.35 * _noise(rng, 120, 120))[..., None] * np.array([0.2, 0.32, 0.13])
    picture = np.where((elevation < trees)[..., None], leaves, picture)
    lawn = np.array([0.3, 0.42, 0.16]) * (0.95 + 0.1 * _noise(rng, 60, 60))[..., None]
    return np.where((elevation < -0.06)[..., None], lawn, picture)


TEXTURES: dict[str, Texture] = {
    "plain": Texture(_plain),
    "sky": Texture(_sky, mapping=Mapping.LEVEL),
    "plaster": Texture(_plaster, (1.2, 1.2), Mapping.LEVEL),
    "wood": Texture(_wood, (0.9, 0.45)),
    "planks": Texture(_planks, (2.4, 1.0), Mapping.LEVEL),
    "tiles": Texture(lambda rng: _tiling(rng, 4, 0.012, 0.1), (1.6, 1.6), Mapping.LEVEL),
    "wall_tiles": Texture(lambda rng: _tiling(rng, 6, 0.014, 0.03), (1.2, 1.2), Mapping.LEVEL),
    "fabric": Texture(_fabric, (0.6, 0.6)),
    "cloth": Texture(_cloth, (1.1, 1.1)),
    "carpet": Texture(_carpet, (0.6, 0.6), Mapping.LEVEL),
    "rug": Texture(_rug, (0.8, 0.8), Mapping.LEVEL),
    "metal": Texture(_metal, (0.6, 0.3)),
    "stone": Texture(_stone, (0.8, 0.8)),
    "leaf": Texture(_leaf, (0.3, 0.3)),
    "books": Texture(_books, (0.3, 0.3), Mapping.LEVEL),
    "glass": Texture(_plain),
    "screen": Texture(_screen, mapping=Mapping.FIT),
    "film": Texture(_film, mapping=Mapping.FIT),
    "painting": Texture(_painting, mapping=Mapping.FIT),
}
SKY = list(TEXTURES).index("sky")


@cache
def texture_atlas() -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.int64]]:
    """Draw all textures.

    Returns:
        (N, 4) uint8 pixels, RGB and padding, of every texture at every size in sequence; and (LEVELS,) the position of
        each size within one texture, which has `(4 * SIZE**2 - 1) // 3` pixels.
    """
    sizes = [SIZE >> level for level in range(LEVELS)]
    starts = np.cumsum([0, *(size * size for size in sizes)])[:-1]
    shape = (len(TEXTURES) * sum(size * size for size in sizes), 4)
    return cached_array("textures", code_key(__file__), np.uint8, shape, _drawn), starts.astype(np.int64)


def mean_colors() -> npt.NDArray[np.float64]:
    """Return the (T, 3) mean multipliers of all textures."""
    atlas, starts = texture_atlas()
    each = (4 * SIZE * SIZE - 1) // 3
    return np.asarray(atlas[starts[-1] :: each, :3] / FULL)


def _drawn() -> npt.NDArray[np.uint8]:
    """Draw every texture at every size."""
    layers = []
    for number, style in enumerate(TEXTURES.values()):
        image = style.draw(np.random.default_rng(number))
        if image.ndim == 2:
            image = np.repeat(image[..., None], 3, axis=2)
        for _ in range(LEVELS):
            stored = np.zeros((len(image) ** 2, 4), np.uint8)
            stored[:, :3] = np.clip(np.rint(image * FULL), 0, 255).reshape(-1, 3)
            layers.append(stored)
            if len(image) > 1:
                image = (image[::2, ::2] + image[1::2, ::2] + image[::2, 1::2] + image[1::2, 1::2]) / 4
    return np.concatenate(layers)
