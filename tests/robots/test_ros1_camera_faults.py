"""`doctor` and an observation tell a frozen, half blind, slow and late camera apart, over ROS 1."""

import pytest

from tests.processes import wait_until
from tests.robots.camera_faults import require_frozen_half, require_slow_and_late, require_slow_camera_ends
from tests.robots.fault_table import checks_of
from tests.robots.ros1_rig import PROFILE, live_rig

pytestmark = pytest.mark.ros


def test_faults_of_a_camera_are_told_apart(tmp_path) -> None:
    with live_rig(tmp_path) as rig:

        def doctor(*words: str) -> dict[str, tuple[str, str]]:
            where = ["--robot", str(PROFILE), "--results", str(tmp_path), "--json"]
            return checks_of(rig.network.start("-m", "vsnbench.cli.main", "doctor", *where, *words))

        require_slow_camera_ends(rig.client, lambda: rig.fault("camera", "slow"))
        rig.fault("camera", "slow+late")
        require_slow_and_late(doctor())
        rig.fault("camera", "frozen+half")
        rig.client.close()  # one node steers a robot
        wait_until(lambda: not rig.network.master.live_node("/vsnbench"), "the client has left")
        require_frozen_half(doctor("--move"))
