"""Every loader of what comes from outside, with good inputs to spoil."""

import csv
import io
import json
import random
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np

from tests.fuzz import mutations
from tests.fuzz.command_line import call
from tests.fuzz.documents import DOCUMENTS
from tests.fuzz.record import RecordTarget
from tests.fuzz.scans import SCANS
from tests.fuzz.target import SettingsFile, Target
from tests.fuzz.weights import CHECKPOINTS, ONNX_FILE
from vsnbench.errors import VsnbenchError

ROOT = Path(__file__).resolve().parents[2]


SMALL_SITE = """
name: cell
title: A cell
rooms: [{name: cell, polygon: [[0, 0], [4, 0], [4, 3], [0, 3]]}]
walls:
  - {start: [0, 0], end: [4, 0]}
  - {start: [4, 0], end: [4, 3]}
  - {start: [4, 3], end: [0, 3]}
  - {start: [0, 3], end: [0, 0]}
objects:
  - {id: chair-1, category: chair, position: [3, 2], size_m: [0.5, 0.5, 0.9], heading_deg: 30}
starts: [{number: 1, position: [1, 1], heading_deg: 0}, {number: 2, position: [2, 1], heading_deg: 90}]
"""


class SiteTarget(SettingsFile):
    """Site files, and what `sites check` does with those that are read."""

    files = (SMALL_SITE,)

    def read(self) -> None:
        code = call("sites", "check", str(self.path))
        if code:
            raise VsnbenchError


class ProfileTarget(SettingsFile):
    """Robot profiles."""

    files = tuple((ROOT / "vsnbench" / "robots" / "profiles").glob("*.yaml"))

    def read(self) -> None:
        from vsnbench.robots.profiles import load_profile

        load_profile(self.path)


class ModelSettingsTarget(SettingsFile):
    """The files of --model-config and of discrete_move."""

    files = (
        "decision: sampled\ncompass: turns\nturn_deg: 30.0\nas_published: true\nthreads: 2\nprecision: single\n",
        "detector: simulated\nsimulated_recall: 0.7\n",
        "linear_velocity_m_s: 0.3\ntimeout_s: 20\nmax_corrections: 3\nlatency_s: 0.05\n",
    )

    def read(self) -> None:
        from vsnbench.control.discrete_move_settings import motion_settings
        from vsnbench.errors import UsageError
        from vsnbench.models.pirlnav.settings import PIRLNavSettings
        from vsnbench.models.vlv.settings import VLVSettings
        from vsnbench.robots.profiles import load_profile
        from vsnbench.settings.yaml_file import read_settings

        text = self.path.read_bytes()
        if b"decision" in text or b"compass" in text:
            read_settings(self.path, PIRLNavSettings, UsageError, "PIRLNav settings")
        elif b"simulated" in text:
            read_settings(self.path, VLVSettings, UsageError, "VLV settings")
        else:
            motion_settings(load_profile("turtlebot2"), self.path)


class PictureTarget:
    """Pictures of a record: what a report, a bag and an import decode."""

    def __init__(self, home: Path) -> None:
        self.folder = home / "episodes" / "000001" / "rgb"
        self.folder.mkdir(parents=True)
        self.home = home
        picture = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
        depth = np.tile(np.linspace(500, 5000, 64).astype(np.uint16), (48, 1))
        self.good = [
            bytes(cv2.imencode(".jpg", picture)[1]),
            bytes(cv2.imencode(".png", picture)[1]),
            bytes(cv2.imencode(".png", depth)[1]),
            bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1]),
            bytes(cv2.imencode(".bmp", picture)[1]),
        ]

    def load(self, rng: random.Random, index: int | None) -> None:
        from vsnbench.report.figures.frame_strips import frame_strip
        from vsnbench.results.files.confined_paths import read_confined
        from vsnbench.values.encoding.images import decode_picture

        content = self.good[0] if index is None else mutations.bytes_of(rng, rng.choice(self.good))
        if index is not None and rng.random() < 0.2 and len(content) > 24:  # a size that is not the picture's
            content = content[:16] + rng.randbytes(8) + content[24:]
        (self.folder / "0001.jpg").write_bytes(content)
        kept = read_confined(self.home, "episodes/000001/rgb/0001.jpg") or b""
        shapes = [decode_picture(kept, flags) for flags in (cv2.IMREAD_COLOR, cv2.IMREAD_UNCHANGED)]
        frame_strip(self.home, "episodes/000001")
        if shapes[0] is None:
            raise VsnbenchError


class ImageMessageTarget:
    """Images that a camera's driver sends."""

    def __init__(self, home: Path) -> None:
        self.functions: list[tuple[Callable[[Any], Any], str, int]]
        from vsnbench.sensing.images.camera_images import decode_color, decode_depth, decode_labels

        self.functions = [
            *((decode_color, name, 3) for name in ("rgb8", "bgr8")),
            *((decode_color, "rgba8", 4), (decode_color, "mono8", 1)),
            *((decode_depth, "16UC1", 2), (decode_depth, "32FC1", 4), (decode_labels, "32SC1", 4)),
        ]

    def load(self, rng: random.Random, index: int | None) -> None:
        decode, encoding, width_bytes = rng.choice(self.functions)
        message = SimpleNamespace(height=6, width=8, encoding=encoding, is_bigendian=0, step=8 * width_bytes)
        message.data = rng.randbytes(6 * 8 * width_bytes)
        if index is not None:
            for _ in range(rng.choice((1, 1, 2))):
                field = rng.choice(("height", "width", "encoding", "is_bigendian", "step", "data"))
                numbers = (0, 1, 2, 7, 9, 255, 65535, 2**31, 2**32 - 1)  # what the message's fields can hold
                changed: Any = rng.choice(numbers)
                if field == "encoding":
                    changed = rng.choice(mutations.WORDS)
                elif field == "data":
                    changed = mutations.bytes_of(rng, message.data)
                setattr(message, field, changed)
        decode(message)


class DatabaseURLTarget:
    """What is typed after --db."""

    def __init__(self, home: Path) -> None:
        self.good = [
            b"postgresql+psycopg://lab:secret@db.lab:5432/trials?sslmode=require",
            b"sqlite:///results/vsnbench.db",
            b"postgresql://lab@/trials?host=/tmp&host=/var/run",
        ]

    def load(self, rng: random.Random, index: int | None) -> None:
        from vsnbench.results.database_url import libpq_connection, redacted_url, without_passwords
        from vsnbench.results.schema.engine import open_engine

        good = rng.choice(self.good)
        url = (good if index is None else mutations.bytes_of(rng, good)).decode("utf-8", "replace")
        without_passwords(url)
        redacted_url(url)
        open_engine(url, read_only=False).dispose()
        if not url.startswith("sqlite"):
            libpq_connection(url)


class HabitatTarget:
    """`import habitat`."""

    def __init__(self, home: Path) -> None:
        self.home = home
        self.good: Any = [
            {"object_category": "chair", "success": 1, "num_steps": 20, "distance_to_goal": 0.4, "path_length": 3.0},
            {"goal": "bed", "success": 0.0, "steps": 150, "geodesic_distance": 4.5},
        ]

    def load(self, rng: random.Random, index: int | None) -> None:
        text = json.dumps(self.good)
        if index is not None:
            text = json.dumps(mutations.tree(rng, self.good))
        content = text.encode("utf-8", "replace")
        if index is not None and rng.random() < 0.35:
            content = mutations.bytes_of(rng, json.dumps(self.good).encode())
        if index is not None and rng.random() < 0.04:
            content = rng.choice((b"[" * 100_000, b'{"a":' * 100_000, b"1" * 100_000, b'["' + b"\\ud800" * 9 + b'"]'))
        file = self.home / "results.json"
        file.write_bytes(content)
        words = ["import", "habitat", str(file), "--model", "m", "--max-steps", "150", "--success-distance", "1"]
        if call(*words, "--results", str(self.home / f"results-{index}")):
            raise VsnbenchError


class UpstreamLogTarget:
    """`import ros4vsn`: the log and its pictures."""

    def __init__(self, home: Path) -> None:
        self.home = home
        self.log = home / "log"
        (self.log / "rgb").mkdir(parents=True)
        self.picture = bytes(cv2.imencode(".png", np.full((8, 8, 3), 90, np.uint8))[1])
        self.rows = [
            ["1700000000.5", "chair", "['forward', 'left', 'stop']", "3"],
            ["2024-05-01 10:00:00", "bed", "[1, 2, 0]", "3"],
        ]

    def load(self, rng: random.Random, index: int | None) -> None:
        content = self.spoilt(rng) if index is not None else _csv(self.rows)
        (self.log / "datos.csv").write_bytes(content)
        for number in range(6):
            path = self.log / "rgb" / f"{number}.png"
            spoil = index is not None and rng.random() < 0.03
            path.write_bytes(mutations.bytes_of(rng, self.picture) if spoil else self.picture)
        words = ["import", "ros4vsn", str(self.log), "--model", "m"]
        if call(*words, "--results", str(self.home / f"results-{index}")):
            raise VsnbenchError

    def spoilt(self, rng: random.Random) -> bytes:
        if rng.random() < 0.4:
            return mutations.bytes_of(rng, _csv(self.rows))
        rows: Any = mutations.tree(rng, self.rows)
        if not isinstance(rows, list):
            rows = [rows]
        return _csv([[str(cell) for cell in row] if isinstance(row, list) else [str(row)] for row in rows])


def _csv(rows: list[list[str]]) -> bytes:
    text = io.StringIO()
    csv.writer(text).writerows(rows)
    return text.getvalue().encode("utf-8", "replace")


TARGETS: dict[str, type[Target]] = {
    "site": SiteTarget,
    "profile": ProfileTarget,
    "model settings": ModelSettingsTarget,
    **DOCUMENTS,
    **CHECKPOINTS,
    "onnx": ONNX_FILE,
    "picture": PictureTarget,
    "image message": ImageMessageTarget,
    "database url": DatabaseURLTarget,
    "habitat": HabitatTarget,
    "upstream log": UpstreamLogTarget,
    "record": RecordTarget,
    **SCANS,
}
