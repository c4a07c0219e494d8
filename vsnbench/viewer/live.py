"""Rerun recordings of a run's episodes, and the live viewer of `--live`."""

import logging
import sys
from pathlib import Path
from typing import Self

from vsnbench.errors import UsageError
from vsnbench.results.files.episode_entries import EpisodeHeader
from vsnbench.runtime.signals import EndAsked
from vsnbench.viewer.recording import FILE_NAME, EpisodeRecording
from vsnbench.viewer.viewers import Viewer, has_display, open_window, require_rerun

logger = logging.getLogger(__name__)


class RerunEpisodes:
    """Writes the `episode.rrd` of each episode, and shows episodes live if requested; a context manager."""

    def __init__(self, *, live: bool) -> None:
        self._live = live
        self._viewer: Viewer | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._viewer is not None:
            self._viewer.close()

    @property
    def is_live(self) -> bool:
        """Whether episodes are shown live."""
        return self._live

    def prepare(self) -> None:
        """With `--live`, open Rerun's window, or the web viewer on a machine without a display.

        Raises:
            VsnbenchError: Rerun's program is missing or does not start.
        """
        if not self._live:
            return
        require_rerun()
        if has_display():
            self._viewer = open_window()
            return
        from vsnbench.viewer.web_viewer import WebViewer

        try:
            viewer = WebViewer()
        except UsageError:  # the default port may belong to the run of another robot
            viewer = WebViewer(0)
        self._viewer = viewer
        logger.warning("no display: watch live at %s", viewer.address)

    def open_episode(self, header: EpisodeHeader, directory: Path) -> EpisodeRecording:
        """Return the recording of an episode with its files in `directory`."""
        return EpisodeRecording(header, directory / FILE_NAME, self._viewer.grpc_url if self._viewer else None)

    def linger(self) -> None:
        """Keep the viewer open after the last episode until the user closes it; without a terminal, return."""
        if self._viewer is None or not sys.stderr.isatty():
            return
        asked = EndAsked()
        with asked.listening():  # the viewer ends with this process
            sys.stderr.write(f"The run has ended. Rerun stays open: {self._viewer.how_to_end} to end.\n")
            while self._viewer.is_open and not asked.wait(0.2):
                pass
        sys.stderr.write("\n")
