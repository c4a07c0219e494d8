"""Accessibility of a page by axe-core, at phone and desktop size, light and dark."""

from importlib.resources import files

from playwright.sync_api import Page

LOOKS = ((390, "light"), (1280, "dark"))
"""Width in pixels and colour scheme of each check: a phone and a desktop. A check takes seconds."""
_AXE = files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8")
_SCHEME = """scheme => {
  const theme = document.documentElement.dataset.theme;
  if (theme && theme !== scheme) document.getElementById("theme").click();
}"""
_RUN = """async () => (await axe.run({ resultTypes: ["violations"] })).violations
  .filter(each => each.impact !== "minor")
  .map(each => `${each.impact} ${each.id}: ${each.nodes.slice(0, 3).map(node => node.target.join(" ")).join(", ")}`)"""


def accessibility_findings(page: Page) -> list[str]:
    """Return axe-core's findings on the current page above minor impact, each with its element."""
    page.evaluate(_AXE)
    found = []
    for width, scheme in LOOKS:
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
        page.evaluate(_SCHEME, scheme)
        found += [f"{width} px {scheme}: {finding}" for finding in page.evaluate(_RUN)]
    return found
