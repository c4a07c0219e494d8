"""The documentation tells what the program does: its example passes, its command reference is today's."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

import vsnbench
from scripts.api_page import api_page
from scripts.command_outputs import filled, pages
from scripts.make_docs import command_reference
from vsnbench.cli.sites import app
from vsnbench.protocol.site import Door, Room, Site, SiteObject, StartingPosition, Wall, Window, parse_site

DOCS = Path(__file__).resolve().parent.parent / "docs"
SITES = (DOCS / "sites.md").read_text(encoding="utf-8")


def example() -> str:
    (text,) = re.findall(r"```yaml\n(.*?)```", SITES, re.DOTALL)
    assert isinstance(text, str)
    return text


def test_the_example_of_a_site_passes_the_check_with_the_warnings_it_names(tmp_path: Path) -> None:
    path = tmp_path / "studio.yaml"
    path.write_text(example(), encoding="utf-8")
    answer = CliRunner().invoke(app, ["check", str(path)])
    assert answer.exit_code == 0, answer.output
    assert answer.output.splitlines() == [
        "warning: site studio has 3 starting positions: the protocol asks for 15, survey 12 more",
        (
            "warning: site studio has no toilet or plant: no trial here searches one; add it to objects if one stands "
            "there, category: toilet, for instance"
        ),
        "studio for turtlebot2: 0 errors, 2 warnings",
    ]


def test_the_example_shows_every_kind_of_entry() -> None:
    site = parse_site(example(), "studio.yaml")
    assert site.doors
    assert site.windows
    assert any(thing.footprint for thing in site.objects)
    assert any(thing.elevation_m for thing in site.objects)


@pytest.mark.parametrize("model", [Site, Room, Wall, Door, Window, SiteObject, StartingPosition])
def test_every_field_of_a_site_is_described(model: type) -> None:
    described = set(re.findall(r"`([a-z_]+)`", "".join(line for line in SITES.splitlines() if line.startswith("|"))))
    assert set(model.model_fields) <= described


def test_the_command_reference_is_that_of_the_program() -> None:
    assert (DOCS / "cli.md").read_text(encoding="utf-8") == command_reference(), "docs/cli.md is old: make docs"


@pytest.mark.parametrize("page", [*sorted(DOCS.glob("*.md")), DOCS.parent / "README.md"], ids=lambda page: page.name)
def test_every_link_to_a_file_leads_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\((?!https?:|#)([^)#]+)", page.read_text(encoding="utf-8"))
    assert [target for target in targets if not (page.parent / target).exists()] == []


def test_the_page_of_the_interface_is_that_of_the_docstrings() -> None:
    assert (DOCS / "api.md").read_text(encoding="utf-8") == api_page(), "docs/api.md is old: make docs"


@pytest.mark.parametrize("page", list(pages()), ids=lambda page: page.name)
def test_what_a_page_shows_of_a_command_is_what_it_prints(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert text == filled(text), f"{page.name} is old: make docs"


@pytest.mark.slow
def test_the_site_is_built_without_a_warning_and_holds_every_page(tmp_path: Path) -> None:
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")],
        cwd=DOCS.parent,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stderr
    assert "WARNING" not in built.stderr
    pages_of_site = {page.stem for page in (tmp_path / "site").glob("*.html")}
    assert {page.stem for page in DOCS.glob("*.md")} < pages_of_site
    start = (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
    assert not re.findall(r"(?:src|href)=\"https?://(?!squidfunk|example)[^\"]*\.(?:css|js|woff2?)", start), (
        "works offline"
    )


def test_who_wants_to_cite_finds_the_version_that_there_is() -> None:
    cited = yaml.safe_load((DOCS.parent / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["version"] == vsnbench.__version__
    assert [one["title"] for one in cited["references"]] == ["Visual Semantic Navigation with Real Robots"]


def test_every_program_beside_the_package_is_listed_and_make_bench_runs_what_the_page_says() -> None:
    root = DOCS.parent
    page = (DOCS / "performance.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"`benchmarks/(\w+)\.py`", page.partition("## What measures what")[2]))
    assert listed == {file.stem for file in (root / "benchmarks").glob("*.py")}
    contributing = (root / "CONTRIBUTING.md").read_text(encoding="utf-8")
    tools = {file.name for file in (root / "scripts").iterdir() if file.suffix in (".py", ".sh")}
    assert set(re.findall(r"`(\w+\.(?:py|sh))`", contributing)) >= tools
    in_bench, _, _ = page.partition("| in `make bench` |")[2].partition("\n\n")
    (runs,) = re.findall(r"^BENCHES \?= (.*)$", (root / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert re.findall(r"`benchmarks/(\w+)\.py`", in_bench) == runs.split()
