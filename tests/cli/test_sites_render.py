import sys
from pathlib import Path

import cv2
import pytest

from tests.simulator.scenery import a_site
from vsnbench.cli.main import main
from vsnbench.settings.yaml_text import dump_yaml
from vsnbench.sites.site import SiteObject


@pytest.fixture
def site_file(tmp_path: Path) -> Path:
    site = a_site(SiteObject(id="stool", category="chair", position=(3, 2), size_m=(0.5, 0.5, 0.9)))
    path = tmp_path / "plain.yaml"
    path.write_text(dump_yaml(site.content()), encoding="utf-8")
    return path


def vsnbench(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["vsnbench", *words])
    with pytest.raises(SystemExit) as end:
        main()
    return int(end.value.code or 0)


def test_look_writes_a_picture_and_names_it(
    site_file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = site_file.with_name("look.png")
    assert vsnbench(monkeypatch, "sites", "render", str(site_file), "--output", str(picture)) == 0
    assert capsys.readouterr().out.strip() == str(picture)
    assert cv2.imread(str(picture)).std() > 20
