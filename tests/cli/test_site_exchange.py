"""`vsnbench sites export` and `sites import` as a person calls them."""

import json
from pathlib import Path

import pytest

from tests.cli.console import vsnbench
from vsnbench.exchange.site_geojson import site_geojson
from vsnbench.protocol.site import load_site


def test_a_site_goes_out_and_comes_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    out = vsnbench(monkeypatch, capsys, "sites", "export", "apartment", "--geojson", "a.geojson", "--svg", "a.svg")
    assert (out.code, out.out) == (0, "a.geojson\na.svg\n")
    for drawing, site in (("a.geojson", "b.yaml"), ("a.svg", "c.yaml")):
        back = vsnbench(monkeypatch, capsys, "sites", "import", drawing, "--output", site)
        assert (back.code, back.out, back.err) == (0, f"{site}\n", "")
        assert load_site(site).sha256 == load_site("apartment").sha256
    again = vsnbench(monkeypatch, capsys, "sites", "import", "a.svg", "--output", "c.yaml")
    assert (again.code, again.err) == (
        2,
        "vsnbench: error: c.yaml is there already: name another file with --output\n",
    )
    assert vsnbench(monkeypatch, capsys, "sites", "export", "apartment").code == 2


def test_a_draft_says_what_it_lacks_and_a_bad_file_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    content = json.loads(site_geojson(load_site("apartment")))
    content["features"] = [each for each in content["features"] if each["properties"]["kind"] != "start"]
    Path("lab.geojson").write_text(json.dumps(content), encoding="utf-8")
    answer = vsnbench(monkeypatch, capsys, "sites", "import", "lab.geojson")
    assert (answer.code, answer.out) == (0, "lab.yaml\n")
    assert answer.err == "a draft, without starts: vsnbench sites edit lab.yaml\n"
    Path("bad.geojson").write_text("{", encoding="utf-8")
    refused = vsnbench(monkeypatch, capsys, "sites", "import", "bad.geojson")
    assert refused.code == 1
    assert refused.err.startswith("vsnbench: error: bad.geojson is no JSON")
    assert refused.err.count("\n") == 1
    content["features"][0]["properties"]["name"] = "n" * 2_000_001
    Path("bad.geojson").write_text(json.dumps(content), encoding="utf-8")
    refused = vsnbench(monkeypatch, capsys, "sites", "import", "bad.geojson")
    assert (refused.code, refused.err) == (
        1,
        "vsnbench: error: bad.geojson makes a site file of more than 2,000,000 characters\n",
    )
    assert not Path("bad.yaml").exists()
