"""What `study plan` shows of a record for a study on progress."""

from vsnbench.errors import RecordError
from vsnbench.report.analysis.episodes_frame import read_report_data
from vsnbench.report.study.pilot import PilotPair, pilot_pairs
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.schema.migrate import open_record
from vsnbench.runner.study.arms import StudyPlace


def recorded_pairs(place: StudyPlace, results: ResultsDirectory) -> tuple[PilotPair, ...]:
    """Return the recorded pairs for a study on progress; none for other studies, or without a record."""
    if not place.study.of_progress:
        return ()
    try:
        with open_record(results.database_url) as engine:
            record = read_report_data(engine)
    except RecordError:
        return ()
    starts = len({block.start for block in place.shared_blocks})
    return pilot_pairs(record, place.study, place.site.sha256, starts)
