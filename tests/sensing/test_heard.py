"""What a listener kept: of each topic the last messages, who sent them, and nothing of the time of connecting."""

from vsnbench.sensing.heard import Hearing


def hearing() -> Hearing:
    made = Hearing(["/odom", "/image"])
    for number in range(20):
        made.keep("/odom", bytes([number]), "/base" if number else "", arrival_s=10 + number / 50, stamp_s=10)
    return made


def test_the_last_messages_are_kept_and_every_arrival_counts() -> None:
    made = hearing()
    assert made.settled("/odom") == bytes([19])
    heard = made._heard["/odom"]
    assert (len(heard.arrivals), len(heard.messages)) == (20, 12)
    assert heard.senders == {"/base"}, "a sender that is not known is none"
    assert round(heard.rate_hz) == 50
    assert round(heard.age_s, 2) == 0.38


def test_nothing_newest_of_a_topic_that_is_silent_or_not_listened_to() -> None:
    made = hearing()
    assert made.settled("/image") is None
    assert made.settled("/elsewhere") is None


def test_what_came_while_publishers_were_being_connected_does_not_count() -> None:
    made = hearing()
    assert made.listen(0.0, 0.0)["/odom"].arrivals == []
    assert set(made.listen(0.0, 0.0)) == {"/odom", "/image"}
