"""Files that a lab writes or receives: protocols, studies, configurations, ROS maps and bundles."""

import random
from pathlib import Path

import cv2
import numpy as np

from tests.fuzz import mutations
from tests.fuzz.command_line import call
from tests.fuzz.target import SettingsFile, Target
from tests.study.studies import study_text
from vsnbench.errors import VsnbenchError

PROTOCOL = """
name: lab
max_actions: 120
max_time_s: 300.0
success_distance_m: 0.8
turn_deg: 15.0
depth_guard: {enabled: true, distance_m: 0.5, margin_m: 0.03, min_pixels: 40}
placement: {distance_m: 0.1, heading_deg: 3.0}
"""
CONFIG = b"""
results = "results"
site = "apartment"

[console]
address = "127.0.0.1"
port = 8710

[isolation]
memory_gib = 4.5

[bundle]
author = "A. Turing"
licence = "CC-BY-4.0"
"""
MAP = (
    "image: map.png\nresolution: 0.05\norigin: [-1.0, -2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
)


class ProtocolTarget(SettingsFile):
    """Protocol files, and every fault that `protocol check` lists."""

    files = (PROTOCOL,)

    def read(self) -> None:
        from vsnbench.protocol.named import load_protocol, protocol_file_faults

        protocol_file_faults(str(self.path))
        load_protocol(str(self.path))


class StudyTarget(SettingsFile):
    """Study files."""

    files = (study_text(), study_text(primary={"kind": "rate", "arm": "one", "rate": 0.5}))

    def read(self) -> None:
        from vsnbench.study.file import parse_study, read_text

        parse_study(read_text(self.path), "study.yaml")


class ConfigTarget:
    """`vsnbench.toml`."""

    def __init__(self, home: Path) -> None:
        self.path = home / "vsnbench.toml"

    def load(self, rng: random.Random, index: int | None) -> None:
        from vsnbench.config import read_config_file

        content = CONFIG if index is None else mutations.bytes_of(rng, CONFIG)
        if index is not None and rng.random() < 0.5:
            lines = CONFIG.decode().splitlines()
            place = rng.randrange(len(lines))
            lines[place] = f"{rng.choice(('port', 'results', 'memory_gib', 'x'))} = {mutations.value(rng)!r}"
            content = "\n".join(lines).encode("utf-8", "replace")
        self.path.write_bytes(content)
        read_config_file(self.path)


class MapTarget(SettingsFile):
    """Maps of map_server, and their images."""

    files = (MAP,)

    def __init__(self, home: Path) -> None:
        super().__init__(home)
        grid = np.full((40, 60), 254, np.uint8)
        grid[10:12] = 0
        self.image = home / "map.png"
        self.images = [bytes(cv2.imencode(ending, grid)[1]) for ending in (".png", ".pgm")]

    def load(self, rng: random.Random, index: int | None) -> None:
        image, spoils_image = rng.choice(self.images), rng.random() < 0.5
        self.image.write_bytes(mutations.bytes_of(rng, image) if index is not None and spoils_image else image)
        super().load(rng, None if spoils_image else index)

    def read(self) -> None:
        from vsnbench.interop.ros_map import read_ros_map

        read_ros_map(self.path)


class BundleTarget:
    """Bundles, under `verify`."""

    def __init__(self, home: Path) -> None:
        from tests.viewer.synthetic_episode import record
        from vsnbench.results.files.directory import ResultsDirectory

        results = ResultsDirectory.locate(home / "results", environment={})
        record(results, 2)
        self.path = home / "given.zip"
        if call("bundle", "--campaign", "1", str(self.path), "--results", str(results.path)):
            raise VsnbenchError("the bundle was not made")
        self.good = self.path.read_bytes()

    def load(self, rng: random.Random, index: int | None) -> None:
        from vsnbench.evidence.bundle.archive import open_bundle
        from vsnbench.files.temporary import ScratchDirectory

        self.path.write_bytes(self.good if index is None else mutations.bytes_of(rng, self.good))
        call("verify", str(self.path))
        with ScratchDirectory("fuzz") as scratch:
            if open_bundle(self.path, scratch.path / "opened").problems:
                raise VsnbenchError


DOCUMENTS: dict[str, type[Target]] = {
    "protocol": ProtocolTarget,
    "study": StudyTarget,
    "configuration": ConfigTarget,
    "map": MapTarget,
    "bundle": BundleTarget,
}
