"""Every loader of a file that a user writes or receives, with a good file to spoil."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from tests.study.studies import study_text
from vsnbench.config import read_config_file
from vsnbench.control.discrete_move_settings import motion_settings
from vsnbench.errors import UsageError, VsnbenchError
from vsnbench.interop.habitat import read_habitat
from vsnbench.interop.ros_map import read_ros_map
from vsnbench.interop.upstream_log import read_upstream_log
from vsnbench.models.pirlnav.settings import PIRLNavSettings
from vsnbench.models.stack.file import ANNOTATED_EXAMPLE as STACK_EXAMPLE
from vsnbench.models.stack.file import load_stack
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.protocol.named import load_protocol, protocol_file_faults
from vsnbench.robots.profiles import embedded_profiles, load_dynamics, load_profile
from vsnbench.settings.yaml_file import read_settings, text_faults
from vsnbench.settings.yaml_text import dump_yaml, load_yaml
from vsnbench.sites.goals import MAX_IMAGE_BYTES
from vsnbench.sites.site import embedded_sites, load_site, site_file_faults
from vsnbench.study.file import parse_study, read_text
from vsnbench.values.robot_profile import RobotProfile

LONG = re.compile(r"<(.+?) x (\d+)>")
"""`<a x 3>` in a text of the table is `aaa`."""
FLAT = Path(__file__).parents[1] / "site_checks" / "flat.yaml"


@dataclass(frozen=True)
class Loader:
    """How a kind of file is read, and a good one."""

    read: Callable[[Path], object]
    good: str
    name: str = "given.yaml"
    faults: Callable[[Path], list[Any]] = lambda _: []
    """All faults of a file, for those whose check lists more than the first."""


def _profile_faults(path: Path) -> list[Any]:
    return list(text_faults(path.read_text(encoding="utf-8"), path.name, RobotProfile, "robot profile"))


def _settings(model: Any, kind: str) -> Callable[[Path], object]:
    return lambda path: read_settings(path, model, UsageError, kind)


APARTMENT = embedded_sites()["apartment"].read_text(encoding="utf-8")
TURTLEBOT2, TURTLEBOT4 = (
    embedded_profiles()[name].read_text(encoding="utf-8") for name in ("turtlebot2", "turtlebot4")
)
LOADERS = {
    "site": Loader(load_site, FLAT.read_text(encoding="utf-8"), faults=site_file_faults),
    "apartment": Loader(load_site, APARTMENT, faults=site_file_faults),
    "goal": Loader(load_site, APARTMENT, faults=site_file_faults),
    "profile": Loader(load_profile, TURTLEBOT2, faults=_profile_faults),
    "profile of ROS 2": Loader(load_profile, TURTLEBOT4, faults=_profile_faults),
    "dynamics": Loader(lambda path: load_dynamics(path, load_profile("turtlebot2")), "dead_time_s: 0.1\n"),
    "protocol": Loader(
        lambda path: load_protocol(str(path)), "name: lab\n", faults=lambda path: list(protocol_file_faults(str(path)))
    ),
    "study": Loader(lambda path: parse_study(read_text(path), path.name), study_text()),
    "PIRLNav settings": Loader(_settings(PIRLNavSettings, "PIRLNav settings"), "decision: sampled\n"),
    "VLV settings": Loader(_settings(VLVSettings, "VLV settings"), "detector: simulated\n"),
    "stack": Loader(load_stack, STACK_EXAMPLE.read_text(encoding="utf-8")),
    "motion settings": Loader(lambda path: motion_settings(load_profile("turtlebot2"), path), "timeout_s: 20\n"),
    "vsnbench.toml": Loader(read_config_file, 'site = "apartment"\n', "vsnbench.toml"),
    "ROS map": Loader(read_ros_map, "image: bed.png\nresolution: 0.05\n"),
    "Habitat results": Loader(read_habitat, '[{"goal": "chair", "success": 1, "steps": 3}]', "given.json"),
    "upstream log": Loader(lambda path: read_upstream_log(path.parent), "1,chair,['Forward'],1\n", "datos.csv"),
}


def spoil(loader: Loader, change: Any, folder: Path) -> Path:
    """Write the loader's good file with a change, and the pictures that a change may name.

    A mapping sets fields by their paths; a list replaces a text by another; a text is the whole file.
    """
    picture = cv2.imencode(".png", np.random.default_rng(0).integers(0, 256, (48, 64, 3)).astype(np.uint8))[1].tobytes()
    for name, content in {"bed": picture, "large": picture + bytes(MAX_IMAGE_BYTES), "cut": picture[:40]}.items():
        (folder / f"{name}.png").write_bytes(content)
    (folder / "loop.png").symlink_to("loop.png")
    path = folder / loader.name
    path.write_text(_text(loader.good, change), encoding="utf-8")
    return path


def _text(good: str, change: Any) -> str:
    if isinstance(change, str):
        return LONG.sub(lambda found: found[1] * int(found[2]), change)
    if isinstance(change, list):
        text, instead = change
        assert text in good, text
        return good.replace(text, instead, 1)
    content = load_yaml(good)
    for field, value in change.items():
        *parents, last = [int(part) if part.isdecimal() else part for part in field.split(".")]
        here = content
        for part in parents:
            here = here[part] if isinstance(here, list) else here.setdefault(part, {})
        here[last] = value
    return dump_yaml(content)


def refusal(loader: Loader, path: Path) -> tuple[str, str, list[str]]:
    """Return the code and the line of the error, and all faults that a check lists.

    Some faults only the check reports: a site with an unknown category can be run.
    """
    faults = loader.faults(path)
    lines = [str(fault) for fault in faults]
    try:
        loader.read(path)
    except VsnbenchError as error:
        return error.code, str(error), lines
    return (faults[0].code, lines[0], lines) if faults else ("", "", [])
