"""What a robot saw when it was first accepted at a mark: one photo for each site, mark and kind of robot."""

import hashlib

from vsnbench.errors import RecordError
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import Site, StartingPosition
from vsnbench.record.confined import read_confined
from vsnbench.record.results import ResultsDirectory
from vsnbench.whole_files import write_whole


class MarkPhotos:
    """The photos of one results directory and one kind of robot, in `marks/SITE/`.

    A mark that the survey puts elsewhere is another mark; the first photo of a mark stays.
    """

    def __init__(self, results: ResultsDirectory, robot: RobotProfile) -> None:
        self._results = results
        self._robot = robot

    def find(self, site: Site, start: StartingPosition) -> bytes | None:
        """Return the mark's photo as JPEG; None where none is kept, or none can be read."""
        try:
            return read_confined(self._results.path, self._named(site, start))
        except RecordError:
            return None

    def keep(self, site: Site, start: StartingPosition, jpeg: bytes | None) -> None:
        """Keep the mark's photo, unless there is one already.

        Raises:
            RecordError: it cannot be written.
        """
        path = self._results.path / self._named(site, start)
        if jpeg is not None and not path.exists():
            write_whole(path, jpeg)

    def _named(self, site: Site, start: StartingPosition) -> str:
        what = f"{start.position} {start.heading_deg} {self._robot.sha256}"
        return f"marks/{site.name}/{start.number}-{hashlib.sha256(what.encode()).hexdigest()[:10]}.jpg"
