"""Exports an episode as an MCAP file with ROS 2 messages, for Foxglove and `ros2 bag`."""

from collections.abc import Iterable
from pathlib import Path

from vsnbench.errors import UsageError
from vsnbench.files.atomic import atomic_file
from vsnbench.installation import command_to_add
from vsnbench.interop.bag_messages import Messages, type_store
from vsnbench.interop.recorded_messages import kinds_of, recorded_messages
from vsnbench.results.model import EpisodeRecord
from vsnbench.values.step import StepRecord


def write_mcap(
    episode: EpisodeRecord, steps: Iterable[StepRecord], results_directory: Path, path: Path
) -> dict[str, int]:
    """Write the file and return the number of messages per topic.

    Each schema is the text of the message definition (`ros2msg`), each message is CDR, as `ros2 bag` writes them. The
    metadata record `vsnbench` has model, goal, start and result.

    Raises:
        UsageError: mcap or rosbags is not installed.
        RecordError: the file cannot be written, or the record contains a path outside its directory.
    """
    try:
        from mcap.writer import Writer
    except ImportError as error:
        raise UsageError("MCAP files require the library mcap", advice=command_to_add("bags")) from error
    store, channels = type_store(ros2=True), dict[str, int]()
    kinds = kinds_of(episode)
    counts = dict.fromkeys(kinds, 0)
    with atomic_file(path) as part, part.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="vsnbench")
        schemas = {}
        for topic, kind in kinds.items():
            if kind not in schemas:
                definition, _ = store.generate_msgdef(kind, ros_version=2)
                schemas[kind] = writer.register_schema(kind, "ros2msg", definition.encode())
            channels[topic] = writer.register_channel(topic, "cdr", schemas[kind])
        writer.add_metadata("vsnbench", _about(episode))
        for topic, time_ns, message in recorded_messages(episode, steps, results_directory, Messages(store)):
            content = bytes(store.serialize_cdr(message, kinds[topic]))
            writer.add_message(channels[topic], time_ns, content, time_ns, counts[topic])
            counts[topic] += 1
        writer.finish()  # type: ignore[no-untyped-call]
    return counts


def _about(episode: EpisodeRecord) -> dict[str, str]:
    success = {True: "success", False: "failure", None: "none"}[episode.success]
    return {
        "episode": str(episode.id),
        "model": episode.model,
        "robot": episode.robot,
        "site": episode.site,
        "goal": episode.goal,
        "start": str(episode.start),
        "end_reason": str(episode.end_reason),
        "result": success,
    }
