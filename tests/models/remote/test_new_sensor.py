"""A new sensor needs its declaration and a robot that measures it: messages, checks and adapters follow.

The sensor of this test is declared in a copy of two files of the package, in which a process of its own imports.
"""

import os
import subprocess
import sys
from pathlib import Path

from tests.models.remote.servers import ROOT

PACKAGE = ROOT / "vsnbench"
SCAN = """
    def _scan(self) -> npt.NDArray[np.float32]:
        bearings = np.radians(np.arange(-45, 45) + 0.5)
        columns = (100 * (1 - np.tan(bearings))).astype(int)
        ranges_m = []
        for yaw_deg in (45, 135, -135, -45):
            side = Camera(width=200, height=3, horizontal_fov_deg=90, mount_height_m=0.2, yaw_deg=yaw_deg)
            depth_m = self._renderer.measure(side, self._base.physics.pose)[1, columns] / np.cos(bearings)
            ranges_m.append(np.where(depth_m < 12.0, depth_m, np.nan))
        return np.concatenate(ranges_m).astype(np.float32)
"""
DECLARED = {
    "values/observation.py": {
        '    """Only in simulation; for the simulated detector."""\n': """
    SCAN = (
        "scan",
        "scan_m",
        "distance to the nearest surface in each direction, counter-clockwise from straight ahead",
        ArraySpec(np.float32, (360,), span=(0.1, 12.0), unit="m", nan="no echo"),
    )
""",
        "    instances: InstanceImage | None = None\n": "    scan_m: npt.NDArray[np.float32] | None = None\n",
    },
    "robots/simulated_camera.py": {
        '"""Sensors of a simulated robot."""\n': "SIMULATED_SENSORS |= {Sensor.SCAN}\n",
        "            main = self._view(other.without_roll, pose, self._other_depth_rng)\n": (
            "        main = with_changes(main, scan_m=self._scan())\n"
        ),
        "        return with_changes(main, cameras=further)\n": SCAN,
    },
}
"""Lines of the package, and what follows them where the sensor is declared and measured."""
USED = '''
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.models.remote.servers import look, stub_server
from vsnbench import Action, Decision, Diagnostics, ModelCard, Policy, Pose, Sensor
from vsnbench.errors import SensorNotDeclaredError
from vsnbench.models.contract_check import check_policy
from vsnbench.models.remote import vsnbench_policy as wire
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.serving import ServedPolicy
from vsnbench.models.synthetic import every_sensor
from vsnbench.robots.adapter.images import observed
from vsnbench.robots.adapter.messages import AdapterCard, InvalidAnswerError
from vsnbench.protocol.disturbances import parse_disturbances
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.registry import open_robot
from vsnbench.runner.disturbances.policy_view import PolicyView
from vsnbench.sites.site import load_site
from vsnbench.values.camera import CameraRole
from vsnbench.values.encoding.codec import observation_to_message
from vsnbench.values.observation import with_changes

SERVED = """
class Model:
    card = {"name": "scanner", "sensors": ["scan"]}

    def reset(self, goal, seed):
        pass

    def act(self, observation):
        scan_m = observation.scan_m
        given = [str(scan_m.dtype), list(scan_m.shape), scan_m.tobytes().hex(), scan_m.flags.writeable]
        return {"action": "STOP", "diagnostics": {"details": {"given": given, "rgb": observation.rgb is None}}}
"""


class Scanner(Policy):
    card = ModelCard("scanner", sensors=frozenset({Sensor.SCAN}), history=2)

    def reset(self, goal, seed):
        pass

    def act(self, observation):
        scans = [seen.scan_m for seen in (*observation.history, observation)]
        nearest_m = float(np.nanmin(scans)) if np.isfinite(scans).any() else 0.0
        return Decision(Action.TURN_LEFT, diagnostics=Diagnostics(scalars={"nearest_m": nearest_m}))


site = load_site("apartment")
with open_robot("simulated:turtlebot2@64x48", site, ProtocolParameters()) as robot:
    robot.begin(site.starts[0], 0)
    seen = robot.observe()
    view = PolicyView(parse_disturbances(["dropped_frames=0.99"]), robot, 0)
    first, later = view.of(seen), view.of(with_changes(seen, rgb=255 - seen.rgb, scan_m=seen.scan_m + 1))
    np.testing.assert_array_equal(later.scan_m, first.scan_m + 1)
    assert later.rgb is first.rgb, "the frame was dropped"
assert seen.scan_m.shape == (360,) and 0.2 < np.nanmin(seen.scan_m) < np.nanmax(seen.scan_m) < 12

left = frozenset({CameraRole.LEFT})
two_views = replace(Scanner.card, cameras=left).shown(every_sensor(0, roles=left))
assert two_views.sensors == {Sensor.SCAN} and not two_views.cameras[CameraRole.LEFT].sensors

findings = list(check_policy(Scanner(), steps=3))
assert all(finding.passed for finding in findings), findings
assert {finding.what: finding.seen for finding in findings}["sensors on the card"] == "scan"

shown = Scanner.card.shown(seen)
try:
    shown.rgb
except SensorNotDeclaredError:
    pass
else:
    raise AssertionError("the card has no rgb")
received = wire.observation_of(wire.unpack(wire.pack({"type": "act", **observation_to_message(shown)})))
local = Scanner().act(shown)
assert ServedPolicy(Scanner()).act(received)["diagnostics"] == {"scalars": dict(local.diagnostics.scalars)}

with tempfile.TemporaryDirectory() as folder, stub_server(SERVED, Path(folder)) as (url, _):
    policy = RemotePolicy(url)
    assert policy.card.sensors == {Sensor.SCAN}
    policy.reset("chair", 0)
    details = policy.act(shown).diagnostics.details
    policy.close()
assert details["given"] == ["float32", [360], seen.scan_m.tobytes().hex(), False] and details["rgb"]

card = AdapterCard.of({"name": "lidar", "sensors": ["rgb", "scan"]})
image = {"encoding": "raw", "height": 48, "width": 64, "data": bytes(48 * 64 * 3)}
message = {"stamp_s": 1.0, "rgb": image, "arrays": observation_to_message(shown)["arrays"]}
message = wire.unpack(wire.pack({"type": "observation", **message}))
measured = observed(message, seen.camera, Pose(0, 0), {}, card.sensors)
np.testing.assert_array_equal(measured.scan_m, seen.scan_m)
for wrong in ({}, {"scan_m": {"dtype": "float32", "shape": [2], "data": bytes(8)}}):
    try:
        observed({**message, "arrays": wrong}, seen.camera, Pose(0, 0), {}, card.sensors)
    except InvalidAnswerError:
        continue
    raise AssertionError(wrong)
print("used")
'''


def package_with_a_scanner(directory: Path) -> Path:
    """Return a folder with the package, two of whose files declare and measure a scan; the others are links."""
    changed = {PACKAGE / name for name in DECLARED}
    for folder in (PACKAGE, *sorted({file.parent for file in changed})):
        copy = directory / folder.relative_to(ROOT)
        copy.mkdir()
        for entry in folder.iterdir():
            if entry not in changed and entry not in {file.parent for file in changed} and entry.name != "__pycache__":
                (copy / entry.name).symlink_to(entry)
    for name, additions in DECLARED.items():
        text = (PACKAGE / name).read_text(encoding="utf-8")
        for line, added in additions.items():
            assert text.count(line) == 1, f"{name} has no single {line!r}"
            text = text.replace(line, line + added)
        (directory / "vsnbench" / name).write_text(text, encoding="utf-8")
    return directory


def test_a_new_sensor_needs_a_declaration_and_a_robot_that_measures_it(tmp_path: Path) -> None:
    folder = package_with_a_scanner(tmp_path)
    environment = {**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}", "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-c", USED]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300)
    assert done.stdout == "used\n", done.stderr
