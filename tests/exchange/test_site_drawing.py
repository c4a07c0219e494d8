"""Sites as GeoJSON and SVG: the same site comes back, and what cannot be one is refused in a line."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from vsnbench.errors import SiteError, UsageError
from vsnbench.exchange.site_drawing import DrawnSite, read_drawing
from vsnbench.exchange.site_file import site_yaml
from vsnbench.exchange.site_geojson import site_geojson
from vsnbench.exchange.site_svg import site_svg
from vsnbench.protocol.site import Site, load_site, parse_site
from vsnbench.simulator.twins.generate import generate_site

SMALL = """
name: small
survey_error_m: 0.03
rooms: [{name: room, polygon: [[0, 0], [4, 0], [4, 3], [0, 3]], floor: tiles}]
walls: [{start: [-0.05, -0.05], end: [4.05, -0.05], height_m: 1.2, color: "#aabbcc"}]
doors: [{name: "1", start: [1, -0.05], end: [1.9, -0.05], closed: true}]
windows: [{start: [2.5, -0.05], end: [3.5, -0.05], sill_m: 0.5}]
objects:
  - {id: sofa, category: sofa, position: [1, 2], heading_deg: 33.3, size_m: [0.8, 1.7, 0.8], color: "#112233"}
  - {id: rug, category: rug, position: [2, 1], size_m: [1, 1, 0.01], solid: false,
     footprint: [[1.5, 0.5], [2.5, 0.5], [2.5, 1.5], [1.5, 1.5]]}
starts: [{number: 7, position: [2.123456789, 1.5], heading_deg: -90, note: "\\"here\\" <&>", not_for: [sofa]}]
"""


def drawn(folder: Path, text: str, ending: str, metres_per_unit: float | None = None) -> DrawnSite:
    path = folder / f"lab{ending}"
    path.write_text(text, encoding="utf-8")
    return read_drawing(path, "lab", metres_per_unit)


@pytest.mark.parametrize(("ending", "text_of"), [(".geojson", site_geojson), (".svg", site_svg)])
@pytest.mark.parametrize("name", ["apartment", "twin", "small"])
def test_a_site_comes_back_the_same(tmp_path: Path, name: str, ending: str, text_of: Callable[[Site], str]) -> None:
    site = {"twin": lambda: generate_site(3), "small": lambda: parse_site(SMALL, "small")}.get(
        name, lambda: load_site("apartment")
    )()
    back = drawn(tmp_path, text_of(site), ending)
    assert (back.lacks, back.left_out) == ((), 0)
    assert Site.model_validate(back.content).content() == site.content()
    assert Site.model_validate(back.content).sha256 == site.sha256


def test_a_site_that_is_written_as_yaml_comes_back_the_same() -> None:
    site = parse_site(SMALL, "small")
    assert parse_site(site_yaml(site), "copy").sha256 == site.sha256


def changed(change: Callable[[dict[str, Any]], object]) -> str:
    content = json.loads(site_geojson(parse_site(SMALL, "small")))
    change(content)
    return json.dumps(content)


def the(kind: str, content: dict[str, Any]) -> dict[str, Any]:
    return next(feature for feature in content["features"] if feature["properties"]["kind"] == kind)


def test_what_was_moved_in_a_drawing_has_moved(tmp_path: Path) -> None:
    def move(content: dict[str, Any]) -> None:
        (ring,) = the("object", content)["geometry"]["coordinates"]
        ring[:] = [[x + 0.5, y] for x, y in ring]

    sofa = drawn(tmp_path, changed(move), ".geojson").content["objects"][0]
    assert (sofa["position"], sofa["heading_deg"], "footprint" in sofa) == ([1.5, 2.0], 33.3, False)


def test_what_was_turned_and_moved_in_a_drawing_program_has_turned(tmp_path: Path) -> None:
    text = site_svg(parse_site(SMALL, "small"))
    text = text.replace('data-id="sofa"', 'data-id="sofa" transform="rotate(10 1 2) translate(0 0)"')
    text = text.replace('data-number="7"', 'data-number="7" transform="translate(0.5,0)rotate(90,2.123456789,1.5)"')
    content = drawn(tmp_path, text, ".svg").content
    assert content["objects"][0]["heading_deg"] == pytest.approx(43.3, abs=0.01)
    assert content["objects"][0]["position"] == [1, 2]
    assert content["starts"][0]["heading_deg"] == pytest.approx(0, abs=0.01)
    assert content["starts"][0]["position"] == pytest.approx([2.623456789, 1.5])


def test_a_drawing_in_centimetres_with_y_down_becomes_a_draft(tmp_path: Path) -> None:
    text = """<svg xmlns="http://www.w3.org/2000/svg" xmlns:ink="urn:ink">
      <rect width="9" height="9"/>
      <g ink:label="Rooms"><rect x="0" y="-300" width="400" height="300"/></g>
      <g id="walls"><path d="M 0,0 h 400 V -300 l -400,0 z"/><text>no shape</text></g>
    </svg>"""
    with pytest.raises(SiteError, match="a wall is no outline; walls are drawn along their centre line"):
        drawn(tmp_path, text, ".svg", 0.01)
    read = drawn(tmp_path, text.replace("-400,0 z", "-400,0 v 300"), ".svg", 0.01)
    assert (read.lacks, read.left_out) == (("starts",), 1)
    assert read.content["rooms"] == [{"name": "room 1", "polygon": [[0, 3], [4, 3], [4, 0], [0, 0]]}]
    assert [wall["end"] for wall in read.content["walls"]] == [[4, 0], [4, 3], [0, 3], [0, 0]]


BAD_GEOJSON = {
    "is no JSON": "{",
    "is no JSON: NaN is no number": '{"a": NaN}',
    "is no JSON: ": "[" * 100_000,
    "is no GeoJSON FeatureCollection": "[]",
    "does not say that it is in metres": changed(lambda content: content.pop("vsnbench")),
    r"degrees of longitude and latitude \(WGS 84\)": changed(lambda content: content.update(crs="OGC:1.3:CRS84")),
    r"feature 2 \(wall\): thickness: there is no such field; did you mean thickness_m": changed(
        lambda content: the("wall", content)["properties"].update(thickness=1)
    ),
    "feature 1: its property kind is 'zone'; write one of room, wall": changed(
        lambda content: the("room", content)["properties"].update(kind="zone")
    ),
    "feature 2: a MultiPolygon is not read": changed(
        lambda content: the("wall", content)["geometry"].update(type="MultiPolygon")
    ),
    "feature 1: a Polygon has one ring here": changed(
        lambda content: the("room", content)["geometry"]["coordinates"].append([])
    ),
    r"feature 5 \(object sofa\): category: the unknown category 'couch'; write sofa": changed(
        lambda content: the("object", content)["properties"].update(category="couch")
    ),
    "size_m is .depth, width, height. in metres": changed(
        lambda content: the("object", content)["properties"].pop("size_m")
    ),
    "turned by -90° from its heading_deg, 123.3": changed(
        lambda content: the("object", content)["properties"].update(heading_deg=123.3)
    ),
    "heading_deg: ": changed(lambda content: the("start", content)["properties"].pop("heading_deg")),
    "more than 200 m from the origin; these look like": changed(
        lambda content: the("start", content)["geometry"].update(coordinates=[4100, 250])
    ),
    "it has more than 5,000 things": changed(
        lambda content: the("wall", content)["geometry"].update(coordinates=[[0, 0], [1, 1]] * 2501)
    ),
    "is longer than 4,000,000 characters": " " * 4_000_001,
}


@pytest.mark.parametrize("says", BAD_GEOJSON)
def test_geojson_that_is_no_site_is_refused_in_a_line(tmp_path: Path, says: str) -> None:
    with pytest.raises(SiteError, match=says) as refused:
        drawn(tmp_path, BAD_GEOJSON[says], ".geojson")
    assert "\n" not in str(refused.value)


ROOM = '<svg xmlns="http://www.w3.org/2000/svg" data-metres-per-unit="1"><g id="rooms">{}</g></svg>'
BOMB = '<!DOCTYPE svg [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>' + ROOM.format("&b;")
BAD_SVG = {
    "is no SVG that can be read": "<svg",
    "it is no SVG, its outermost element is html": "<html/>",
    "it does not say how many metres one of its units is; say --metres-per-unit": "<svg/>",
    "it declares entities, which are not read": BOMB,
    "nested deeper than 64": "<svg data-metres-per-unit='1'>" + "<g>" * 5000,
    "room a: its path is curved or in parts": ROOM.format('<path id="a" d="M0 0 C 1 1 2 2 3 3"/>'),
    "a use is not read": ROOM.format('<use href="#a"/>'),
    "a ellipse is not read": ROOM.format("<ellipse/>"),
    "width is '10mm', no plain number": ROOM.format('<rect width="10mm" height="3"/>'),
    "transform 'skewX.5.' is not read": ROOM.format('<rect transform="skewX(5)" width="1" height="3"/>'),
    "its coordinates are no numbers": ROOM.format('<rect width="1e999" height="3"/>'),
    "has nothing of a site in it": ROOM.format(""),
    "polygon: the outline crosses itself": ROOM.format('<polygon points="0,0 4,4 4,0 0,4.5"/>'),
}


@pytest.mark.parametrize("says", BAD_SVG)
def test_svg_that_is_no_site_is_refused_in_a_line(tmp_path: Path, says: str) -> None:
    with pytest.raises(SiteError, match=says) as refused:
        drawn(tmp_path, BAD_SVG[says], ".svg")
    assert "\n" not in str(refused.value)


def test_another_kind_of_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"name a \.geojson or \.svg file"):
        drawn(tmp_path, "", ".dxf")
