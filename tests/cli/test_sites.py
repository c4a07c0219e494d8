"""`vsnbench sites` from a terminal and from scripts."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from vsnbench.cli.sites import app
from vsnbench.errors import SiteError, UsageError
from vsnbench.settings.yaml_text import dump_yaml
from vsnbench.sites.site import load_site


def call(*words: str) -> tuple[int, str]:
    """Return exit code and stdout; known errors are raised as at the boundary."""
    result = CliRunner().invoke(app, list(words))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout


@pytest.fixture
def flawed_site(tmp_path: Path) -> Path:
    content = load_site("apartment").content()
    content["name"] = "flawed"
    content["starts"][2]["position"] = [3.45, 1.9]
    path = tmp_path / "flawed.yaml"
    path.write_text(dump_yaml(content), encoding="utf-8")
    return path


def test_list_names_the_embedded_sites() -> None:
    code, out = call("list")
    assert code == 0
    assert "apartment" in out
    assert "75.0 m²" in out


def test_list_as_json_can_be_read_by_a_script() -> None:
    (row,) = json.loads(call("list", "--json")[1])
    assert (row["name"], row["area_m2"], row["starts"]) == ("apartment", 75.0, 15)


def test_show_names_goals_doors_and_starts() -> None:
    out = call("show", "apartment")[1]
    assert "bathroom door 0.70 m" in out
    assert "sofa-1" in out
    assert "facing the refrigerator close by" in out


def test_a_title_with_markup_is_shown_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "lab.yaml"
    path.write_text(dump_yaml(load_site("apartment").content() | {"title": "Lab [/b] [m]"}), encoding="utf-8")
    assert "Lab [/b] [m]" in call("show", str(path))[1]


def test_show_as_json_gives_the_whole_site() -> None:
    shown = json.loads(call("show", "apartment", "--json")[1])
    assert shown["sha256"] == load_site("apartment").sha256
    assert len(shown["starts"]) == 15


def test_a_generated_flat_is_shown_checked_and_drawn_by_its_seed(tmp_path: Path) -> None:
    flat = json.loads(call("show", "flat:0", "--json")[1])
    assert flat["name"] == "flat-0"
    code, out = call("check", "flat:0")
    assert (code, out.splitlines()[-1].startswith("flat-0 for turtlebot2: 0 errors")) == (0, True)
    assert call("draw", "flat:0", "-o", str(tmp_path / "plan.svg"))[0] == 0
    with pytest.raises(UsageError):
        call("show", "flat:x")


def test_check_is_content_with_the_apartment() -> None:
    assert call("check", "apartment") == (0, "apartment for turtlebot2: 0 errors, 0 warnings\n")


def test_check_says_what_is_wrong_and_exits_with_1(flawed_site: Path) -> None:
    code, out = call("check", str(flawed_site))
    assert code == 1
    assert "error: start 3 at (3.45, 1.9) is inside sofa-1" in out


def test_check_knows_which_looks_there_are(tmp_path: Path) -> None:
    content = load_site("apartment").content()
    chair = next(thing for thing in content["objects"] if thing["category"] == "chair")
    chair["model"] = "throne"
    path = tmp_path / "palace.yaml"
    path.write_text(dump_yaml(content), encoding="utf-8")
    code, out = call("check", str(path))
    assert code == 1
    assert "unknown model 'throne' of category chair" in out


def test_check_as_json_gives_findings(flawed_site: Path) -> None:
    code, out = call("check", str(flawed_site), "--json")
    findings = json.loads(out)["findings"]
    assert code == 1
    assert findings[0]["severity"] == "error"
    assert "sofa-1" in findings[0]["message"]


def test_draw_writes_the_files_it_names(tmp_path: Path) -> None:
    svg, png = tmp_path / "plan.svg", tmp_path / "plan.png"
    assert call("draw", "apartment", "-o", str(svg), "-o", str(png)) == (0, f"{svg}\n{png}\n")
    assert "<svg" in svg.read_text(encoding="utf-8")
    assert png.read_bytes().startswith(b"\x89PNG")


def test_a_broken_file_is_refused_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "broken.yaml"
    path.write_text("name: broken\nrooms: []\n", encoding="utf-8")
    with pytest.raises(SiteError, match=r"broken\.yaml:2"):
        call("show", str(path))
    code, out = call("check", str(path))
    assert code == 1
    assert "broken.yaml:2: rooms: expected at least" in out
    assert "2 more" not in out
    assert out.count("error: ") == 3


def test_draw_outlines_from_where_stop_succeeds(tmp_path: Path) -> None:
    plain, ringed = tmp_path / "plain.svg", tmp_path / "ringed.svg"
    call("draw", "apartment", "-o", str(plain))
    call("draw", "apartment", "-o", str(ringed), "--goal", "plant")
    assert "#2e7d32" not in plain.read_text(encoding="utf-8")
    assert "#2e7d32" in ringed.read_text(encoding="utf-8")


def test_draw_has_axes_and_a_grid_on_request(tmp_path: Path) -> None:
    plain, ruled = tmp_path / "plain.svg", tmp_path / "ruled.svg"
    call("draw", "apartment", "-o", str(plain))
    call("draw", "apartment", "-o", str(ruled), "--grid")
    assert "x, m" not in plain.read_text(encoding="utf-8")
    assert "x, m" in ruled.read_text(encoding="utf-8")
