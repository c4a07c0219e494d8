"""A site written as YAML reads back to the same content."""

from vsnbench.interop.site_file import site_yaml
from vsnbench.sites.site import parse_site

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


def test_a_site_written_as_yaml_reads_back_the_same() -> None:
    site = parse_site(SMALL, "small")
    assert parse_site(site_yaml(site), "copy").sha256 == site.sha256
