"""A node of `run_node` that ends slowly, as one that stops a base, and publishes a last message."""

import time

import rospy
from std_msgs.msg import String

from vsnbench.ros.ros1.node import run_node


class _Audience(rospy.SubscribeListener):
    def peer_subscribe(self, topic_name, topic_publish, peer_publish) -> None:
        print("connected", flush=True)


class LastWords:
    def __init__(self) -> None:
        self._words = rospy.Publisher("/last_words", String, subscriber_listener=_Audience(), queue_size=1)

    def close(self) -> None:
        time.sleep(0.3)
        self._words.publish("standing still")


run_node("leaver", [], lambda _master: LastWords(), "working")
