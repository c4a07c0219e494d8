"""Scans: files of scanning apps and their textures, and the file that a site names."""

import gzip
import json
import random
import struct
from pathlib import Path

import numpy as np

from tests.fuzz import mutations
from tests.fuzz.target import Target
from tests.simulator.scan.made_scans import splats_of, write_scan, write_splats
from tests.simulator.scan.rooms import room


class AppScanTarget:
    """A scan of an app, and what `sites scan` makes of it."""

    suffix = ""

    def __init__(self, home: Path) -> None:
        self.path = home / f"room.{self.suffix}"
        self.write()
        self.good = {path: path.read_bytes() for path in home.glob("*") if path.is_file()}

    def write(self) -> None:
        write_scan(room(table=True), self.path)

    def load(self, rng: random.Random, index: int | None) -> None:
        from vsnbench.simulator.scan.alignment import align_scan
        from vsnbench.simulator.scan.proposal import propose_site
        from vsnbench.simulator.scan.reading import read_scan
        from vsnbench.sites.scan import SiteScan

        spoilt = rng.choice(sorted(self.good)) if rng.random() < 0.3 else self.path
        for path, content in self.good.items():
            path.write_bytes(content if index is None or path != spoilt else self.spoil(rng, path, content))
        mesh, _ = align_scan(read_scan(self.path), "z", 1.0)
        propose_site(mesh, "room", SiteScan(file="room.scan.npz", sha256="0" * 64))

    def spoil(self, rng: random.Random, path: Path, content: bytes) -> bytes:
        return mutations.bytes_of(rng, content)


class GLBTarget(AppScanTarget):
    """A GLB file: its description as a tree, or its bytes."""

    suffix = "glb"

    def spoil(self, rng: random.Random, path: Path, content: bytes) -> bytes:
        if rng.random() < 0.3:
            return mutations.bytes_of(rng, content)
        length = struct.unpack_from("<I", content, 12)[0]
        tree = mutations.tree(rng, json.loads(content[20 : 20 + length]))
        text = json.dumps(tree, default=str).encode()
        text += b" " * (-len(text) % 4)
        body = content[20 + length :]
        return struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(body), len(text), 0x4E4F534A) + text + body


class PLYTarget(AppScanTarget):
    """A PLY file: lines of its header, or its bytes."""

    suffix = "ply"

    def spoil(self, rng: random.Random, path: Path, content: bytes) -> bytes:
        if rng.random() < 0.5:
            return mutations.bytes_of(rng, content)
        head, body = content.split(b"end_header\n", 1)
        lines = head.decode().splitlines()
        place = rng.randrange(len(lines))
        words = lines[place].split()
        words[rng.randrange(len(words))] = str(
            rng.choice((*mutations.NUMBERS, *mutations.WORDS, "face", "list", "uchar"))
        )
        lines[place] = " ".join(words)
        return "\n".join(lines).encode("utf-8", "replace") + b"\nend_header\n" + body


class SplatTarget(PLYTarget):
    """A PLY file of Gaussian splats: lines of its header, or its bytes."""

    def write(self) -> None:
        write_splats(splats_of(room(table=True), 20), self.path)


class SPZTarget(AppScanTarget):
    """An SPZ file: its bytes, or those that it has compressed."""

    suffix = "spz"

    def write(self) -> None:
        write_splats(splats_of(room(table=True), 20), self.path)

    def spoil(self, rng: random.Random, path: Path, content: bytes) -> bytes:
        if rng.random() < 0.3:
            return mutations.bytes_of(rng, content)
        plain = gzip.decompress(content)
        if rng.random() < 0.5:
            return gzip.compress(mutations.bytes_of(rng, plain), 1)
        return gzip.compress(mutations.bytes_of(rng, plain[:16]) + plain[16:], 1)


class OBJTarget(AppScanTarget):
    """An OBJ file, its material file and its texture."""

    suffix = "obj"

    def spoil(self, rng: random.Random, path: Path, content: bytes) -> bytes:
        if path.suffix == ".png" or rng.random() < 0.3:
            return mutations.bytes_of(rng, content)
        lines = content.decode().splitlines()
        place = rng.randrange(len(lines))
        words = lines[place].split() or [""]
        words[rng.randrange(len(words))] = str(
            rng.choice((*mutations.NUMBERS, *mutations.WORDS, "f", "1/1/1", "usemtl x"))
        )
        lines[place] = " ".join(words)
        return "\n".join(lines).encode("utf-8", "replace")


class ScanFileTarget:
    """The file that a site names, with splats in every second input, and a view of it."""

    def __init__(self, home: Path) -> None:
        from vsnbench.simulator.scan.reading import read_scan

        path, splats = home / "room.scan.npz", home / "room.spz"
        write_splats(splats_of(room(table=True), 12), splats)
        self.good = []
        for scan in (room(table=True), read_scan(splats)):
            scan.write(path)
            self.good.append(path.read_bytes())

    def load(self, rng: random.Random, index: int | None) -> None:
        from vsnbench.simulator.rendering.renderer import Eye, camera_axes
        from vsnbench.simulator.rendering.scan.drawing import ScanDrawer
        from vsnbench.simulator.rendering.scan.mesh import parse_scan

        good = self.good[(index or 0) % 2]
        drawer = ScanDrawer(parse_scan(good if index is None else mutations.bytes_of(rng, good), "room"))
        view = (np.array([1.0, 1.0, 1.0]), camera_axes(Eye(0.0, 0.0, 0.0, 0.5)), 80.0, 63.5, 47.5)
        drawer.look(view, np.empty((96, 128, 3), np.uint8), np.empty((96, 128), np.float32))


SCANS: dict[str, type[Target]] = {
    "glb": GLBTarget,
    "ply": PLYTarget,
    "splat ply": SplatTarget,
    "spz": SPZTarget,
    "obj": OBJTarget,
    "scan file": ScanFileTarget,
}
