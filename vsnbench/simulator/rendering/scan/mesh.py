"""Triangles, textures and splats of a scan, and the file that a site names: a stored ZIP archive of NumPy arrays."""

import hashlib
import io
import zipfile
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.errors import SiteError
from vsnbench.files.atomic import write_atomic
from vsnbench.files.regular import open_regular
from vsnbench.simulator.rendering.scan.splats import Splats
from vsnbench.values.encoding.images import MOST_PIXELS, picture_size

MOST_TRIANGLES = 2_000_000
MOST_BYTES = 500_000_000
"""Maximum size of a scan's file."""
MOST_TEXTURES = 256
MOST_TEXELS = 2 * MOST_PIXELS
"""Maximum number of pixels of all textures of a scan."""
TEXTURE_STEP = 32
"""Sides of textures are multiples of this, so that five halvings leave whole pixels."""
_FARTHEST_M = 1000.0
_HEADER_BYTES = 1000

Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]
Bytes = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class ScanMesh:
    """V vertices and T triangles of a scan, counter-clockwise as seen from inside the rooms."""

    vertices: Floats
    """(V, 3); metres in the site's frame once it is imported."""
    faces: Ints
    """(T, 3) indices of vertices."""
    colors: Bytes
    """(V, 3) sRGB, for triangles without a texture."""
    texture: Ints
    """(T,) index into `textures`; -1 without one."""
    uv: Floats
    """(T, 3, 2) coordinates of the corners in the texture; (0, 0) is its upper left corner."""
    textures: tuple[Bytes, ...] = ()
    """(H, W, 3) sRGB each."""
    splats: Splats | None = None
    """What is drawn instead of the triangles, which then are only the surfaces."""

    @property
    def corners(self) -> Floats:
        """(T, 3, 3) corners of the triangles."""
        return np.ascontiguousarray(self.vertices[self.faces])

    def write(self, path: Path) -> str:
        """Write the scan's file and return its SHA-256.

        Raises:
            SiteError: the file cannot be written.
        """
        import cv2

        content = io.BytesIO()
        arrays = {name: np.ascontiguousarray(getattr(self, name), kind) for name, (kind, _) in _ARRAYS.items()}
        for number, picture in enumerate(self.textures):
            _, png = cv2.imencode(".png", np.ascontiguousarray(picture[..., ::-1]))
            arrays[f"texture-{number}"] = np.asarray(png, np.uint8).reshape(-1)
        if self.splats is not None:
            arrays |= {
                _SPLAT + name: np.ascontiguousarray(getattr(self.splats, name), kind)
                for name, (kind, _) in _SPLATS.items()
            }
        np.savez(content, **arrays)  # type: ignore[arg-type] # entries without dates, not compressed
        data = content.getvalue()
        write_atomic(path, data, SiteError)
        return hashlib.sha256(data).hexdigest()

    def problem(self) -> str:
        """Return what is wrong with the values; empty if nothing is."""
        vertices, triangles = len(self.vertices), len(self.faces)
        if not 0 < triangles <= MOST_TRIANGLES or not 0 < vertices <= 3 * MOST_TRIANGLES:
            return f"it has {triangles:,} triangles; the limit is {MOST_TRIANGLES:,}"
        if len(self.colors) != vertices or len(self.texture) != triangles or len(self.uv) != triangles:
            return "its arrays have different lengths"
        if not np.abs(self.vertices).max() <= _FARTHEST_M or not np.abs(self.uv).max() <= 1e4:  # NaN as well
            return f"coordinates are not numbers within {_FARTHEST_M:g} m"
        if self.faces.min() < 0 or self.faces.max() >= vertices:
            return "a triangle has a vertex that does not exist"
        if self.texture.min() < -1 or self.texture.max() >= len(self.textures):
            return "a triangle has a texture that does not exist"
        if any(side % TEXTURE_STEP for picture in self.textures for side in picture.shape[:2]):
            return f"the sides of a texture are not multiples of {TEXTURE_STEP}"
        return "" if self.splats is None else self.splats.problem(_FARTHEST_M)


_ARRAYS: dict[str, tuple[str, tuple[int, ...]]] = {
    "vertices": ("<f4", (3,)),
    "faces": ("<i4", (3,)),
    "colors": ("|u1", (3,)),
    "texture": ("<i4", ()),
    "uv": ("<f4", (3, 2)),
}
"""Type and trailing dimensions of each array of the file."""
_SPLATS: dict[str, tuple[str, tuple[int, ...]]] = {
    "centres": ("<f4", (3,)),
    "spreads": ("<f4", (6,)),
    "paint": ("|u1", (4,)),
}
_SPLAT = "splat-"
assert [*_ARRAYS, "textures", "splats"] == [field.name for field in fields(ScanMesh)]  # noqa: S101
assert [*_SPLATS] == [field.name for field in fields(Splats)]  # noqa: S101


@lru_cache(maxsize=2)
def load_scan(path: Path, sha256: str) -> ScanMesh:
    """Read the file of a scan that `ScanMesh.write` wrote.

    Raises:
        SiteError: the file cannot be read (`unreadable-file`), has another hash (`scan-changed`), or is not a scan's
            file (`invalid-scan`).
    """
    try:
        with open_regular(path) as file:
            data = file.read(MOST_BYTES + 1)
    except OSError as problem:
        raise SiteError(f"cannot read scan {path}: {problem.strerror or problem}", code="unreadable-file") from problem
    if hashlib.sha256(data).hexdigest() != sha256:
        raise SiteError(
            f"{path} is not the scan of the site file: its SHA-256 differs",
            advice="restore the file, or import the scan again with `vsnbench sites scan`",
            code="scan-changed",
        )
    return parse_scan(data, str(path))


def parse_scan(data: bytes, origin: str) -> ScanMesh:
    """Read the content of a scan's file; `origin` names it in errors.

    Raises:
        SiteError: `invalid-scan`, it is not such a file.
    """
    try:
        if len(data) > MOST_BYTES:
            raise ValueError(f"it has more than {MOST_BYTES // 1_000_000} MB")
        mesh = _parsed(data)
        if problem := mesh.problem():
            raise ValueError(problem)
    except (ValueError, KeyError, OSError, RuntimeError, NotImplementedError, zipfile.BadZipFile) as problem:
        # zipfile raises most of these for damaged archives: NotImplementedError for an unknown compression.
        reason = (str(problem).splitlines() or [type(problem).__name__])[0]
        raise SiteError(
            f"{origin} is not the file of a scan: {reason}",
            advice="import the scan again with `vsnbench sites scan`",
            code="invalid-scan",
        ) from problem
    return mesh


def _parsed(data: bytes) -> ScanMesh:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        entries = {entry.filename.removesuffix(".npy"): entry for entry in archive.infolist()}
        if len(entries) > MOST_TEXTURES + len(_ARRAYS) + len(_SPLATS):
            raise ValueError(f"it has more than {MOST_TEXTURES} textures")
        if any(entry.compress_type != zipfile.ZIP_STORED or entry.file_size > len(data) for entry in entries.values()):
            raise ValueError("an entry is compressed")

        def array(name: str, kind: str, shape: tuple[int, ...]) -> npt.NDArray[Any]:
            if name not in entries:
                raise ValueError(f"the array {name} is missing")
            return _array(archive.read(entries[name]), name, kind, shape)

        arrays: dict[str, Any] = {name: array(name, kind, shape) for name, (kind, shape) in _ARRAYS.items()}
        splats = None
        if any(name.startswith(_SPLAT) for name in entries):
            splats = Splats(**{name: array(_SPLAT + name, kind, shape) for name, (kind, shape) in _SPLATS.items()})
        textures = len(entries) - len(_ARRAYS) - (0 if splats is None else len(_SPLATS))
        pictures = (array(f"texture-{number}", "|u1", ()) for number in range(textures))
        return ScanMesh(**arrays, textures=decode_textures(picture.tobytes() for picture in pictures), splats=splats)


def _array(data: bytes, name: str, kind: str, shape: tuple[int, ...]) -> npt.NDArray[Any]:
    """Return an array of the .npy format; the header is compared with the size before memory is taken."""
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    if version != (1, 0):
        raise ValueError(f"the array {name} has another version of the format")
    sizes, is_fortran, dtype = np.lib.format.read_array_header_1_0(stream, max_header_size=_HEADER_BYTES)
    rest = memoryview(data)[stream.tell() :]
    if is_fortran or dtype.str != kind or tuple(sizes[1:]) != shape or not sizes:
        raise ValueError(f"the array {name} has another type or shape")
    if len(rest) != int(np.prod(sizes, dtype=object)) * dtype.itemsize:
        raise ValueError(f"the array {name} is cut off")
    return np.frombuffer(rest, dtype).reshape(sizes)


def decode_textures(files: Any) -> tuple[Bytes, ...]:
    """Return the pixels of PNG or JPEG files, (H, W, 3) each; sizes are checked before pixels are decoded.

    Raises:
        ValueError: one is not such an image, or they have too many pixels.
    """
    import cv2

    left, textures = MOST_TEXELS, []
    for number, content in enumerate(files, start=1):
        size = picture_size(content)
        if size is None or min(size) < 1:
            raise ValueError(f"texture {number} is neither PNG nor JPEG")
        left -= size[0] * size[1]
        if size[0] * size[1] > MOST_PIXELS or left < 0:
            raise ValueError(f"its textures have more than {MOST_TEXELS:,} pixels")
        try:
            bgr = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
        except cv2.error:
            bgr = None
        if bgr is None or bgr.shape[1::-1] != size:
            raise ValueError(f"texture {number} cannot be decoded")
        textures.append(np.ascontiguousarray(np.asarray(bgr, np.uint8)[..., ::-1]))
    return tuple(textures)
