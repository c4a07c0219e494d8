"""The documentation matches the program: examples, generated pages, links, lists of programs, the website."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

import vsnbench
from scripts.api_page import api_page
from scripts.command_outputs import filled, pages
from scripts.headings_page import headings_page
from scripts.make_docs import command_reference
from tests.cli.chromium import chromium_page
from vsnbench.cli.sites import app
from vsnbench.models.remote.vsnbench_policy import WIRE_VERSION
from vsnbench.robots.adapter.connection import NEWEST_VERSION
from vsnbench.settings.yaml_text import load_yaml
from vsnbench.simulator.dynamics.physics import simulator_version
from vsnbench.sites.site import Door, Room, Site, SiteObject, StartingPosition, Wall, Window, parse_site

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
SITE_FILE = (DOCS / "site-file.md").read_text(encoding="utf-8")
LINKING = [*sorted(DOCS.glob("*.md")), *sorted(ROOT.glob("*.md")), *sorted((ROOT / "benchmarks").rglob("*.md"))]
RESULTS = sorted((ROOT / "benchmarks" / "results").glob("*.md"))


def relative(path: Path) -> str:
    return str(path.relative_to(ROOT))


def example() -> str:
    text, _goals = re.findall(r"```yaml\n(.*?)```", SITE_FILE, re.DOTALL)
    assert isinstance(text, str)
    return text


def test_the_example_of_a_site_has_two_warnings_and_no_error(tmp_path: Path) -> None:
    path = tmp_path / "studio.yaml"
    path.write_text(example(), encoding="utf-8")
    answer = CliRunner().invoke(app, ["check", str(path), "--json"])
    assert answer.exit_code == 0, answer.output
    findings = json.loads(answer.stdout)["findings"]
    assert [(found["severity"], found["code"]) for found in findings] == [
        ("warning", "few-starts"),
        ("warning", "no-instance"),
    ]


def test_the_example_shows_every_kind_of_entry() -> None:
    site = parse_site(example(), "studio.yaml")
    assert site.doors
    assert site.windows
    assert any(thing.footprint for thing in site.objects)
    assert any(thing.elevation_m for thing in site.objects)


@pytest.mark.parametrize("model", [Site, Room, Wall, Door, Window, SiteObject, StartingPosition])
def test_every_field_of_a_site_is_described(model: type) -> None:
    rows = "".join(line for line in SITE_FILE.splitlines() if line.startswith("|"))
    assert set(model.model_fields) <= set(re.findall(r"`([a-z_]+)`", rows))


def test_the_command_reference_is_current() -> None:
    assert (DOCS / "cli.md").read_text(encoding="utf-8") == command_reference(), "run make docs"


def test_the_page_of_the_python_interface_is_current() -> None:
    assert (DOCS / "api.md").read_text(encoding="utf-8") == api_page(), "run make docs"


def test_the_page_of_table_headings_is_current() -> None:
    assert (DOCS / "headings.md").read_text(encoding="utf-8") == headings_page(), "run make docs"


@pytest.mark.parametrize("page", list(pages()), ids=relative)
def test_outputs_shown_on_a_page_are_current(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert text == filled(text), f"{page.name}: run make docs"


@pytest.mark.parametrize("page", LINKING, ids=relative)
def test_every_link_to_a_file_has_a_target(page: Path) -> None:
    targets = re.findall(r"\]\((?!https?:|#)([^)#]+)", page.read_text(encoding="utf-8"))
    assert [target for target in targets if not (page.parent / target).exists()] == []


@pytest.fixture(scope="module")
def website(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("docs") / "site"
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(directory)],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stderr
    assert "WARNING" not in built.stderr
    return directory


def test_the_website_has_every_page_and_asks_no_other_host(website: Path) -> None:
    pages = {page.stem: page.read_text(encoding="utf-8") for page in website.glob("*.html")}
    assert {page.stem for page in DOCS.glob("*.md")} < set(pages)
    parts = re.compile(r"<(?:script|link|img|iframe)\b[^>]*\b(?:src|href)=[\"']?((?:https?:)?//[^\"' >]*)")
    assert {name: parts.findall(text) for name, text in pages.items() if parts.findall(text)} == {}


@pytest.mark.browser
def test_the_website_has_a_search_when_it_is_opened_as_files(website: Path) -> None:
    with chromium_page(1280, 800) as page:
        requests: list[str] = []
        page.on("request", lambda request: requests.append(request.url))
        page.goto((website / "index.html").as_uri())
        page.locator("input[name=query]").click()
        page.keyboard.type("depth guard")
        page.wait_for_selector(".md-search-result__item a")
        found = page.locator(".md-search-result__item a").evaluate_all("links => links.map(link => link.href)")
        assert any("/protocol.html" in address for address in found)
        assert [url for url in requests if not url.startswith(("file:", "data:", "blob:"))] == []


def test_the_page_on_compatibility_has_the_current_numbers() -> None:
    page = " ".join((DOCS / "compatibility.md").read_text(encoding="utf-8").split())
    assert f"now {WIRE_VERSION} of the wire, {NEWEST_VERSION} of motion adapters" in page
    assert f"now edition {simulator_version().split()[0]}." in page


def test_the_citation_has_the_current_version() -> None:
    cited = load_yaml((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["version"] == vsnbench.__version__
    assert [reference["title"] for reference in cited["references"]] == ["Visual Semantic Navigation with Real Robots"]


def test_every_benchmark_result_and_script_is_listed() -> None:
    page = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    assert set(re.findall(r"`(\w+)\.py`", page)) == {file.stem for file in (ROOT / "benchmarks").glob("*.py")}
    assert set(re.findall(r"\((results/[^)]+)\)", page)) == {f"results/{file.name}" for file in RESULTS}
    contributing = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    scripts = {file.name for file in (ROOT / "scripts").iterdir() if file.suffix in (".py", ".sh")}
    assert set(re.findall(r"`(\w+\.(?:py|sh))`", contributing)) >= scripts


def test_make_bench_runs_the_listed_benchmarks() -> None:
    page = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    listed, _, _ = page.partition("| in `make bench` |")[2].partition("\n\n")
    (runs,) = re.findall(r"^BENCHES \?= (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert re.findall(r"`(\w+)\.py`", listed) == runs.split()


@pytest.mark.parametrize("result", RESULTS, ids=relative)
def test_every_result_has_date_and_machine(result: Path) -> None:
    text = result.read_text(encoding="utf-8")
    assert re.match(r"\d{4}-\d\d-\d\d-", result.name)
    assert "- **Date" in text
    assert "- **Machine" in text
