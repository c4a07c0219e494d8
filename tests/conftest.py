"""Which tests wait for `make test`: marked here, in one place, by what was measured."""

from pathlib import Path

import pytest

HERE = Path(__file__).parent

SLOW = frozenset(
    {
        *("cli/test_doctor.py", "cli/test_hostile_archive.py", "cli/test_models.py", "cli/test_report.py"),
        *("cli/test_run.py", "cli/test_run_pirlnav.py", "cli/test_sites.py", "cli/test_study.py", "cli/test_view.py"),
        *("cli/test_sweep.py", "exchange/test_killed_merge.py", "exchange/test_merge.py"),
        *("models/test_oracle.py", "models/pirlnav/test_checkpoint.py", "models/pirlnav/test_parity.py"),
        *("models/pirlnav/test_policy.py", "models/vlv/test_map_against_site.py", "models/vlv/test_mask_rcnn.py"),
        *("models/vlv/test_policy.py", "models/vlv/test_value_network.py", "protocol/test_site_check.py"),
        *("protocol/test_goal_distance.py", "report/test_figures.py", "report/test_page.py", "simulator/test_twins.py"),
        *("runner/pool/test_local.py", "runner/pool/test_merging.py", "statistics/test_coverage.py"),
    }
)
"""Files whose tests took together more than 8 s, each file alone on one of two busy cores."""

SLOW_ROOMS = frozenset({"fuzz", "training"})


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is slow, and what starts a PostgreSQL server."""
    for item in items:
        place = item.path.relative_to(HERE)
        if place.as_posix() in SLOW or place.parts[0] in SLOW_ROOMS:
            item.add_marker(pytest.mark.slow)
        chosen = str(getattr(getattr(item, "callspec", None), "params", {}))
        if "postgresql" in getattr(item, "fixturenames", ()) or "postgresql" in chosen:
            item.add_marker(pytest.mark.postgresql)
