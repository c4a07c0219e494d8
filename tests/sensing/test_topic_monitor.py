"""A monitor keeps the last messages and the senders of each topic, but nothing from the time of connection."""

from vsnbench.sensing.topic_monitor import TopicMonitor


def monitor() -> TopicMonitor:
    made = TopicMonitor(["/odom", "/color", "/image"])
    for number in range(20):
        made.add("/odom", bytes([number]), "/base" if number else "", arrival_s=10 + number / 50, stamp_s=10)
    return made


def test_the_last_messages_are_kept_and_every_arrival_counts() -> None:
    made = monitor()
    assert made.settled("/odom") == bytes([19])
    odometry = made._topics["/odom"]
    assert (len(odometry.arrivals), len(odometry.messages)) == (20, 20)
    for _ in range(20):
        made.add("/color", bytes(100_000), "/camera", arrival_s=10, stamp_s=10)
    images = made._topics["/color"]
    assert (len(images.arrivals), len(images.messages)) == (20, 12), "images are large"
    assert odometry.senders == {"/base"}, "an unknown sender does not count"
    assert round(odometry.rate_hz) == 50
    assert round(odometry.age_s, 2) == 0.38


def test_a_silent_or_unknown_topic_has_no_newest_message() -> None:
    made = monitor()
    assert made.settled("/image") is None
    assert made.settled("/elsewhere") is None


def test_messages_from_the_time_of_connection_do_not_count() -> None:
    made = monitor()
    assert made.listen(0.0, 0.0)["/odom"].arrivals == []
    assert set(made.listen(0.0, 0.0)) == {"/odom", "/color", "/image"}
