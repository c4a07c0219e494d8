"""The Rerun copies that a run makes of its episodes, and with `--live` the viewer that shows them as they happen."""

import logging
import sys
from pathlib import Path
from types import TracebackType
from typing import Self

from vsnbench.end_signals import EndAsked
from vsnbench.errors import UsageError
from vsnbench.record.entries import EpisodeHeader
from vsnbench.viewer.recording import FILE_NAME, EpisodeRecording
from vsnbench.viewer.viewers import Viewer, WebViewer, has_display, open_window, require_rerun

logger = logging.getLogger(__name__)


class RerunEpisodes:
    """Copies every episode into its `episode.rrd`, and shows it live where that was asked for; a context manager."""

    def __init__(self, *, live: bool) -> None:
        self._live = live
        self._viewer: Viewer | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._viewer is not None:
            self._viewer.close()

    @property
    def is_live(self) -> bool:
        """Whether somebody is shown the episodes as they happen."""
        return self._live

    def prepare(self) -> None:
        """With `--live`, open Rerun's window, or serve it to a browser where there is no display.

        Raises:
            VsnbenchError: Rerun's program is missing or does not start.
        """
        if not self._live:
            return
        require_rerun()
        if has_display():
            self._viewer = open_window()
            return
        try:
            served = WebViewer()
        except UsageError:  # the usual port is taken, perhaps by another robot's run
            served = WebViewer(0)
        self._viewer = served
        logger.warning("no display here: watch live at %s", served.address)

    def open_episode(self, header: EpisodeHeader, directory: Path) -> EpisodeRecording:
        """Return the copy of an episode whose files lie in `directory`."""
        return EpisodeRecording(header, directory / FILE_NAME, self._viewer.grpc_url if self._viewer else None)

    def linger(self) -> None:
        """Let a person look at the last episode for as long as they like; a script does not wait."""
        if self._viewer is None or not sys.stderr.isatty():
            return
        how = "press Ctrl-C" if isinstance(self._viewer, WebViewer) else "close its window or press Ctrl-C"
        asked = EndAsked()
        with asked.listening():  # the viewer is ended with this process
            sys.stderr.write(f"The run is over and Rerun stays open: {how} to end.\n")
            while self._viewer.is_open and not asked.wait(0.2):
                pass
        sys.stderr.write("\n")
