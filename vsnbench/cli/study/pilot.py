"""What `study plan` shows of a record for a study on progress."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

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


def pilot_fields(pairs: Sequence[PilotPair]) -> list[dict[str, Any]]:
    """Return the pairs as JSON fields; null for what is not finite."""
    fields = []
    for pair in pairs:
        content = asdict(pair) | {"saved": pair.saved if math.isfinite(pair.saved) else None}
        for metric in ("success", "progress"):
            blocks = content[metric]["blocks"]
            content[metric]["blocks"] = blocks if math.isfinite(blocks) else None
        fields.append(content)
    return fields
