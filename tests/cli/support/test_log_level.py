"""--verbose and $VSNBENCH_LOG_LEVEL."""

import logging
import os

import pytest

from tests.cli.console import vsnbench
from vsnbench.cli.support.log_level import VARIABLE, verbose


@pytest.mark.parametrize(("count", "level"), [(1, logging.INFO), (2, logging.DEBUG), (3, logging.DEBUG)])
def test_verbose_lowers_the_level_of_this_process_and_its_children_in_its_context(count: int, level: int) -> None:
    logger = logging.getLogger("vsnbench")
    before = logger.level, os.environ.get(VARIABLE)
    with verbose(count):
        assert (logger.level, os.environ[VARIABLE]) == (level, logging.getLevelName(level).lower())
    assert (logger.level, os.environ.get(VARIABLE)) == before


def test_an_unknown_level_and_a_contradiction_are_usage_errors(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert vsnbench(monkeypatch, capsys, "config", "show", "-q", "-v").code == 2
    monkeypatch.setenv(VARIABLE, "loud")
    answer = vsnbench(monkeypatch, capsys, "config", "show")
    assert answer.code == 2
    assert "debug, info, warning, error" in answer.err
