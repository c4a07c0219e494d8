"""The editor over a scan: the scan from above under the pointer, and where scan and survey differ."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.accessibility import accessibility_findings
from tests.cli.chromium import chromium_page
from tests.simulator.scan.made_scans import splats_of, write_scan, write_splats
from tests.simulator.scan.rooms import SIZE_M, TABLE_M, room
from tests.web.browser import Browser
from tests.web.site_editor.drawing import PATIENCE_MS, Drawing, served
from vsnbench.cli.sites import app
from vsnbench.errors import UsageError
from vsnbench.web.site_editor.scan_import import import_scan

pytest.importorskip("trimesh")
ON_TABLE = (sum(TABLE_M[0:4:2]) / 2, sum(TABLE_M[1:4:2]) / 2)


@pytest.fixture(scope="module", params=["glb", "spz"])
def site_file(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site made from the scan of a room with a table, as triangles and as splats."""
    folder = tmp_path_factory.mktemp("lab")
    source = folder / f"room.{request.param}"
    if request.param == "glb":
        write_scan(room(table=True), source)
    else:
        write_splats(splats_of(room(table=True), 30), source)
    import_scan(source, folder / "lab.yaml", "z")
    return folder / "lab.yaml"


def test_the_scan_from_above_says_how_high_its_surface_is(browser: Browser) -> None:
    site = browser.ask("GET", "/state").json["site"]
    for (x_m, y_m), height_m in ((ON_TABLE, TABLE_M[4]), ((3.0, 2.2), 0.0)):
        view = browser.post("/scan-view", site=site, x_m=x_m, y_m=y_m, heading_deg=0)
        assert view.body.startswith(b"\xff\xd8")
        assert float(view.headers["surface-height-m"]) == pytest.approx(height_m, abs=0.02)
    outside = browser.post("/scan-view", site=site, x_m=-30, y_m=0, heading_deg=0)
    assert outside.status == 200
    assert "surface-height-m" not in outside.headers


def test_the_checks_of_the_page_compare_scan_and_survey(browser: Browser) -> None:
    site = browser.ask("GET", "/state").json["site"]
    assert not [f for f in browser.post("/check", site=site).json["findings"] if f["code"].startswith("scan-")]
    site["objects"] = []
    assert "scan-unsurveyed" in {finding["code"] for finding in browser.post("/check", site=site).json["findings"]}


@pytest.mark.browser
@pytest.mark.parametrize("width", [1280, 390])
def test_the_page_shows_the_scan_under_the_pointer(site_file: Path, width: int) -> None:
    with served(site_file) as server, chromium_page(width, 800) as page:
        page.set_default_timeout(PATIENCE_MS)
        page.goto(server.addresses[0])
        page.wait_for_selector("body[data-open=yes]")
        assert page.locator("#plan image").count() == 1
        page.mouse.move(*Drawing(page).pixels(*ON_TABLE))
        page.wait_for_selector("#scan-height:has-text('0.7')")
        page.wait_for_function("() => document.querySelector('#scan-picture').naturalWidth === 384")
        box, plan = page.locator("#scan-view").bounding_box(), page.locator("#plan").bounding_box()
        assert box is not None
        assert plan is not None
        pointer_x = Drawing(page).pixels(*ON_TABLE)[0]
        assert not box["x"] <= pointer_x <= box["x"] + box["width"], "the place itself stays in sight"
        assert plan["x"] <= box["x"]
        assert box["x"] + box["width"] <= plan["x"] + plan["width"]
        assert accessibility_findings(page) == []


def test_edit_makes_a_new_site_from_a_scan(tmp_path: Path) -> None:
    source, site = tmp_path / "room.ply", tmp_path / "new.yaml"
    write_scan(room(table=True, textured=False), source)
    words = [sys.executable, "-m", "vsnbench", "sites", "edit", str(site), "--scan", str(source)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as editor:
        assert editor.stdout is not None
        assert editor.stdout.readline().startswith(f"editing {site}")
        editor.terminate()
        assert editor.wait(60) == 0
    assert (tmp_path / "new.scan.npz").is_file()
    assert json.loads(site.with_suffix(".underlay.json").read_text())["width_m"] == pytest.approx(SIZE_M[0], abs=0.5)
    again = CliRunner().invoke(app, ["edit", str(site), "--scan", str(source)])
    assert isinstance(again.exception, UsageError)
