"""Classifies the failures of a record in a thread of its own, because that takes a millisecond or more for each."""

import logging
import threading

from sqlalchemy import Engine, func, select

from vsnbench.errors import VsnbenchError
from vsnbench.report.analysis.episodes_frame import read_report_data
from vsnbench.report.analysis.failures import failure_kinds
from vsnbench.results.schema.engine import reading
from vsnbench.results.schema.tables import VerdictRow

logger = logging.getLogger(__name__)


class FailureKinds:
    """Kinds of the failures by episode, as far as they are known."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._known: dict[int, str] = {}
        self._last_verdict = 0
        self._thread: threading.Thread | None = None
        self._starting = threading.Lock()
        self._closed = threading.Event()

    @property
    def is_complete(self) -> bool:
        """Whether no classification is under way."""
        return self._thread is None or not self._thread.is_alive()

    def known(self) -> dict[int, str]:
        """Return the kinds that are known now."""
        return dict(self._known)

    def update(self) -> None:
        """Begin to classify what was judged since the last call, unless that is under way or the page is closed."""
        with self._starting:
            if self.is_complete and not self._closed.is_set():
                self._thread = threading.Thread(target=self._classify, name="failure-kinds", daemon=True)
                self._thread.start()

    def close(self) -> None:
        """End the thread."""
        with self._starting:
            self._closed.set()
        if self._thread is not None:
            self._thread.join(10.0)

    def _classify(self) -> None:
        try:
            with reading(self._engine).begin() as connection:
                last = connection.scalar(select(func.max(VerdictRow.id))) or 0
                if last == self._last_verdict:
                    return
                query = select(VerdictRow.episode_id).where(VerdictRow.id > self._last_verdict).distinct()
                for number in connection.scalars(query):
                    self._known.pop(number, None)
            record = read_report_data(self._engine)
            for number, kind in failure_kinds(self._engine, record, set(self._known)):
                self._known[number] = kind.value
                if self._closed.is_set():
                    return
            self._last_verdict = last
        except VsnbenchError as error:
            logger.warning("failures are not classified: %s", error)
