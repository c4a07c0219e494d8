"""A site with errors is refused before anything is written."""

import logging
from pathlib import Path

import pytest

from vsnbench.errors import SiteError
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.runner.operator.provider import OperatorProvider
from vsnbench.runner.setup.launch import launch
from vsnbench.runner.setup.request import RunRequest
from vsnbench.runner.setup.trial_setup import TrialSetupSpec
from vsnbench.settings.yaml_text import dump_yaml
from vsnbench.sites.site import load_site

UNATTENDED = OperatorProvider(unattended=True)


def request(tmp_path: Path, **changes: object) -> RunRequest:
    content = load_site("apartment").content() | {"name": "flat"} | changes
    path = tmp_path / "flat.yaml"
    path.write_text(dump_yaml(content), encoding="utf-8")
    results = ResultsDirectory.locate(tmp_path / "results", None)
    setup = TrialSetupSpec(load_site(str(path)), "random", ("chair",), parameters=ProtocolParameters(max_actions=2))
    return RunRequest(setup, results, site=str(path), starts=(1,))


def test_a_missing_wall_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    walls = load_site("apartment").content()["walls"]
    asked = request(tmp_path, walls=walls[:4] + walls[5:])
    with pytest.raises(SiteError, match=r"the living space's edge from .* has no wall.* vsnbench sites check"):
        launch(asked, UNATTENDED)
    assert not (tmp_path / "results").exists()


def test_an_object_outside_the_site_is_refused(tmp_path: Path) -> None:
    things = load_site("apartment").content()["objects"]
    moved = [thing | {"position": [40.0, 40.0]} if thing["id"] == "sofa-1" else thing for thing in things]
    with pytest.raises(SiteError, match=r"sofa-1 at \(40, 40\) is outside every room"):
        launch(request(tmp_path, objects=moved), UNATTENDED)


def test_warnings_are_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    starts = load_site("apartment").content()["starts"]
    with caplog.at_level(logging.WARNING):
        launched = launch(request(tmp_path, starts=starts[:3]), UNATTENDED)
    assert "has 3 starting positions" in caplog.text
    assert launched.campaign_id
