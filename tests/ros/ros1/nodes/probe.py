"""Observes and commands a ROS network for a test, with lines of JSON on stdin and stdout."""

import json
import math
import sys
import threading
import time

import rospy
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import String

rospy.init_node("probe", disable_signals=True)
lock = threading.Lock()
truth: list = []
heard: dict = {}
publishers: dict = {}


def on_truth(message: PoseStamped) -> None:
    pose = message.pose
    with lock:
        speeds = {"speed": pose.orientation.w, "commanded": pose.position.z}
        truth.append((time.monotonic(), pose.position.x, pose.position.y, pose.orientation.z, speeds))


def on_word(topic: str, message: String) -> None:
    with lock:
        heard.setdefault(topic, []).append(message.data)


def publisher(topic: str) -> rospy.Publisher:
    if topic not in publishers:
        publishers[topic] = rospy.Publisher(topic, String, queue_size=10)
    return publishers[topic]


def connect(topic: str) -> bool:
    give_up = time.monotonic() + 20
    while not publisher(topic).get_num_connections() and time.monotonic() < give_up:
        time.sleep(0.01)
    return publisher(topic).get_num_connections() > 0


def publish(topic: str, word: str) -> float:
    publisher(topic).publish(String(word))
    return time.monotonic()


def last_truth() -> dict:
    give_up = time.monotonic() + 20
    while not truth and time.monotonic() < give_up:
        time.sleep(0.01)
    _, x, y, heading, speeds = truth[-1]
    return {"x_m": x, "y_m": y, "heading_deg": math.degrees(heading), **speeds}


def stopped_since(since: float, name: str = "speed") -> float | None:
    """Time at which the true or the commanded speed became zero, if it stayed zero for half a second."""
    with lock:
        later = [(at, speeds[name]) for at, *_, speeds in truth if at >= since]
    rest = None
    for at, speed in later:
        rest = None if speed else (rest or at)
    return rest if rest is not None and time.monotonic() - rest > 0.5 else None


def listen(topic: str) -> bool:
    rospy.Subscriber(topic, String, lambda message: on_word(topic, message), queue_size=50)
    return True


def words(topic: str) -> list:
    with lock:
        return list(heard.get(topic, []))


rospy.Subscriber("/base/truth", PoseStamped, on_truth, queue_size=100, tcp_nodelay=True)
ANSWERS = {
    "ready": lambda: True,
    "connect": connect,
    "publish": publish,
    "truth": last_truth,
    "stopped_since": stopped_since,
    "listen": listen,
    "words": words,
}
for line in sys.stdin:
    name, *arguments = json.loads(line)
    sys.stdout.write(json.dumps(ANSWERS[name](*arguments)) + "\n")
    sys.stdout.flush()
