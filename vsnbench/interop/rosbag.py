"""Exports an episode as a ROS 1 bag for rosbag and rviz."""

from collections.abc import Iterable
from pathlib import Path

from vsnbench.files.atomic import atomic_file
from vsnbench.interop.bag_messages import Messages, type_store
from vsnbench.interop.recorded_messages import FIXED_FRAMES, kinds_of, recorded_messages
from vsnbench.results.model import EpisodeRecord
from vsnbench.values.step import StepRecord


def write_bag(
    episode: EpisodeRecord, steps: Iterable[StepRecord], results_directory: Path, path: Path
) -> dict[str, int]:
    """Write the bag and return the number of messages per topic.

    Raises:
        UsageError: rosbags is not installed.
        RecordError: the bag cannot be written, or the record contains a path outside its directory.
    """
    store = type_store()
    from rosbags.rosbag1 import Writer

    kinds = kinds_of(episode)
    counts = dict.fromkeys(kinds, 0)
    with atomic_file(path) as part, Writer(part) as writer:
        channels = {
            topic: writer.add_connection(topic, kind, typestore=store, latching=1 if topic == FIXED_FRAMES else None)
            for topic, kind in kinds.items()
        }
        for topic, time_ns, message in recorded_messages(episode, steps, results_directory, Messages(store)):
            writer.write(channels[topic], time_ns, store.serialize_ros1(message, kinds[topic]))
            counts[topic] += 1
    return counts
