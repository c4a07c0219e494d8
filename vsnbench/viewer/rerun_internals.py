"""All uses of Rerun's private API, with the reason for each.

`pyproject.toml` limits Rerun to the release that this is written for; `tests/viewer/test_rerun_internals.py` fails if
the API changes.
"""

import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings as bindings

from vsnbench.viewer.static_entities import StaticEntities


def convert_blueprint(blueprint: rrb.Blueprint, entities: StaticEntities) -> None:
    """Log a blueprint into a cache. The public API logs it into a stream of its own only."""
    blueprint._log_to_stream(entities)  # noqa: SLF001


def send_blueprint(recording: rr.RecordingStream, blueprint: StaticEntities) -> None:
    """Send a converted blueprint to a recording.

    The public `send_blueprint` creates a stream in memory that it never disconnects, which costs two threads and a
    megabyte per call.
    """
    stream = rr.RecordingStream._from_native(  # noqa: SLF001
        bindings.new_blueprint(
            application_id=recording.get_application_id() or "",
            make_default=False,
            make_thread_default=False,
            default_enabled=True,
        )
    )
    stream.set_time("blueprint", sequence=0)
    blueprint.send(stream)
    in_memory = stream.memory_recording()
    bindings.send_blueprint(in_memory.storage, True, True, recording=recording.to_native())
    stream.disconnect()


def free_unused_streams() -> None:
    """Free the threads and buffers of streams without references. Rerun keeps them until this call."""
    bindings.flush_and_cleanup_orphaned_recordings()
