"""Only ROS robots and nodes need ROS; without it, one line tells how to install it."""

import subprocess
import sys

WITHOUT_ROS = """
import importlib.abc, sys

class NoRos(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {"rospy", "rosgraph", "genpy", "std_msgs", "std_srvs", "geometry_msgs", "nav_msgs",
                                  "sensor_msgs", "rosgraph_msgs", "roslib", "rosmaster"}:
            raise ModuleNotFoundError(name)
        return None

sys.meta_path.insert(0, NoRos())
find = sys.modules["importlib.util"].find_spec if "importlib.util" in sys.modules else None
import importlib.util
importlib.util.find_spec = lambda name: None if name in {"rospy", "genpy"} else find(name) if find else None
"""


def without_ros(code: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-c", WITHOUT_ROS + code], capture_output=True, text=True, timeout=120, cwd="."
    )


def test_without_ros_one_line_tells_how_to_install_it() -> None:
    done = without_ros(
        "from vsnbench.cli.main import main; sys.argv = ['vsnbench', 'robots', 'serve', 'turtlebot2']; main()"
    )
    assert done.returncode == 1
    assert "ROS 1 is not installed for this Python (no module rospy): run scripts/install_ros.sh" in done.stderr
    assert done.stderr.count("\n") == 1


def test_the_rest_of_the_product_needs_no_ros() -> None:
    modules = (
        "vsnbench.robots.registry, vsnbench.robots.ros.robot, vsnbench.robots.checkup.ros1, "
        "vsnbench.runner.setup.launch, "
        "vsnbench.cli.running.run, vsnbench.cli.robots.robots, vsnbench.cli.robots.doctor, "
        "vsnbench.cli.robots.nodes, vsnbench.ros.ros1.service_call, "
        "vsnbench.sensing.mover, vsnbench.simulator.dynamics.simulated_base"
    )
    done = without_ros(f"import {modules}\nassert 'rospy' not in sys.modules")
    assert done.returncode == 0, done.stderr


def test_the_doctor_names_what_is_missing(tmp_path) -> None:
    words = f"['vsnbench', 'doctor', '--robot', 'turtlebot2', '--results', {str(tmp_path / 'results')!r}]"
    done = without_ros(f"from vsnbench.cli.main import main; sys.argv = {words}; main()")
    assert done.returncode == 1
    assert "run scripts/install_ros.sh" in done.stdout
