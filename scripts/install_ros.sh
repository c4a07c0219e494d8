#!/usr/bin/env bash
# Make ROS 1 importable from .venv, on Debian or Ubuntu: `install_ros.sh [--unpacked] [VENV]`.
# With root (or sudo) the script installs the distribution's packages. Without, or with --unpacked, it downloads them and
# unpacks them into the environment. Only the ROS robots and nodes of vsnbench need ROS.
set -euo pipefail
cd "$(dirname "$0")/.."
unpacked=no
[ "${1:-}" != --unpacked ] || { unpacked=yes; shift; }
venv=${1:-.venv}
python=$venv/bin/python
[ -x "$python" ] || { echo "install_ros.sh: $python does not exist. Run 'make setup' first, or pass the environment's directory" >&2; exit 2; }
system=/usr/lib/python3/dist-packages

modules="rospy rosgraph rosmaster genpy genmsg rosgraph_msgs std_msgs std_srvs geometry_msgs nav_msgs sensor_msgs"
works() { "$python" -c "import ${modules// /, }, rosservice" 2>/dev/null; }
works && exit 0

command -v apt-get >/dev/null || {
    echo "install_ros.sh: this system has no apt-get. Install ROS 1 Noetic by hand and write its dist-packages directory" \
        "into $venv/lib/python3*/site-packages/ros1.pth" >&2
    exit 1
}
site=$("$python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
path_file=$site/ros1.pth

packages="python3-rospy python3-rosmaster python3-nav-msgs python3-sensor-msgs python3-geometry-msgs python3-std-srvs
    python3-rosservice python3-rostopic python3-rosnode python3-rosmsg"
as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi
}
can_be_root() {
    [ "$(id -u)" = 0 ] || { command -v sudo >/dev/null && sudo -n true 2>/dev/null; }
}

if [ $unpacked = no ] && can_be_root; then
    [ -d $system/rospy ] && [ -d $system/rosservice ] || {
        echo "installing ROS 1 (once; 150 MB)"
        as_root apt-get update -qq
        # shellcheck disable=SC2086
        as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $packages >/dev/null
    }
    # A .pth file appends its path, so the environment's own numpy and yaml come first; PYTHONPATH would override them.
    echo $system > "$path_file"
elif [ $unpacked = no ] && [ -d $system/rospy ]; then
    echo $system > "$path_file"
else
    # The packages are pure Python; their other dependencies come from pip.
    into=$("$python" -c 'import sys; print(sys.prefix)')/ros1
    downloads=$(mktemp -d)
    trap 'rm -rf "$downloads"' EXIT
    echo "unpacking ROS 1 into $into"
    needed="python3-rospy python3-rosmaster python3-rosgraph python3-roslib python3-genpy python3-genmsg python3-rosservice
        python3-rostopic python3-rosnode python3-rosmsg python3-rosbag python3-rosparam python3-roslz4 python3-catkin
        python3-rosgraph-msgs python3-roscpp-msg python3-std-msgs python3-std-srvs python3-geometry-msgs
        python3-nav-msgs python3-sensor-msgs python3-actionlib-msgs python3-roscpp"
    available=""
    for package in $needed; do
        apt-cache show "$package" >/dev/null 2>&1 && available="$available $package"
    done
    # shellcheck disable=SC2086
    (cd "$downloads" && apt-get -o APT::Sandbox::User=root download -qq $available)
    mkdir -p "$into"
    for archive in "$downloads"/*.deb; do dpkg -x "$archive" "$into"; done
    for tool in "$into"/usr/bin/ros*; do
        [ ! -f "$tool" ] || sed "1s|.*|#!$("$python" -c 'import sys; print(sys.executable)')|" "$tool" > "$venv/bin/${tool##*/}"
        [ ! -f "$tool" ] || chmod +x "$venv/bin/${tool##*/}"
    done
    "$python" -m pip --disable-pip-version-check install --quiet pyyaml defusedxml rospkg netifaces-plus 2>/dev/null ||
        "$python" -m pip --disable-pip-version-check install --quiet pyyaml defusedxml rospkg
    echo "$into/usr/lib/python3/dist-packages" > "$path_file"
fi

if works; then
    echo "ROS 1 is ready for $venv"
else
    echo "install_ros.sh: ROS 1 still cannot be imported:" >&2
    "$python" -c "import ${modules// /, }, rosservice" || exit 1
fi
