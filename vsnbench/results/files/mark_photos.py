"""Photos from the robot's camera at its start marks: one per site, mark and kind of robot."""

import hashlib

from vsnbench.errors import RecordError
from vsnbench.files.atomic import write_atomic
from vsnbench.results.files.confined_paths import read_confined
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.sites.site import Site, StartingPosition
from vsnbench.values.robot_profile import RobotProfile


class MarkPhotos:
    """Photos of one results directory and one kind of robot, in `marks/SITE/`.

    A mark that was moved in the survey is a new mark. The first photo of a mark is kept.
    """

    def __init__(self, results: ResultsDirectory, robot: RobotProfile) -> None:
        self._results = results
        self._robot = robot

    def find(self, site: Site, start: StartingPosition) -> bytes | None:
        """Return the mark's photo as JPEG; None if there is none or it cannot be read."""
        try:
            return read_confined(self._results.path, self._named(site, start))
        except RecordError:
            return None

    def keep(self, site: Site, start: StartingPosition, jpeg: bytes | None) -> None:
        """Store the mark's photo, unless there is one.

        Raises:
            RecordError: it cannot be written.
        """
        path = self._results.path / self._named(site, start)
        if jpeg is not None and not path.exists():
            write_atomic(path, jpeg)

    def _named(self, site: Site, start: StartingPosition) -> str:
        what = f"{start.position} {start.heading_deg} {self._robot.sha256}"
        return f"marks/{site.name}/{start.number}-{hashlib.sha256(what.encode()).hexdigest()[:10]}.jpg"
