"""Writes the page of results as one file to send: gallery, report, notes and images, without films and videos."""

import base64
import hashlib
import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final, TypeVar

from vsnbench.errors import UsageError
from vsnbench.files.atomic import write_atomic
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.episodes_frame import read_report_data
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.schema.migrate import open_record
from vsnbench.web.results_browser.app import ASSETS
from vsnbench.web.results_browser.website import (
    Picture,
    Progress,
    WrittenWebsite,
    contents,
    front_page,
    json_bytes,
    report_and_page,
)
from vsnbench.web_server.pages import style_sheet

MAX_EPISODES: Final = 100
"""Maximum number of episodes in a single file."""
MAX_BYTES: Final = 25_000_000
"""Maximum size of a single file, which mail servers accept; pictures are left out until it fits."""
_FEWEST = 1000
"""Largest n of keeping every nth picture, which leaves the first and the last one of an episode."""
_MARK = '<meta name="generator" content="vsnbench single file">'
_WITHIN: Final[Picture] = (".webp", 320, 60)
_Item = TypeVar("_Item")


def write_single_file(
    results: ResultsDirectory,
    selection: Selection,
    file: Path,
    *,
    progress: Progress = lambda _what, _done, _of: None,
) -> WrittenWebsite:
    """Write report, episodes, notes and images as one page of at most `MAX_BYTES`; an earlier one is replaced.

    If not all images fit, those of further cameras are left out. If the others still do not fit, those of every second
    action are written, or of every third, and so on, and always the last one of each episode. Films and videos are left
    out.

    Args:
        results: the results directory.
        selection: part of the record to show.
        file: new, or an earlier single file.
        progress: called with a kind of work, what is done of it, and all of it.

    Raises:
        UsageError: the file is of others (`exists`), or there are more than `MAX_EPISODES` (`too-many-episodes`).
        RecordError: the record cannot be read, or the file cannot be written.
    """
    if file.exists() and not (file.is_file() and _MARK.encode() in file.read_bytes()[:2000]):
        raise UsageError(f"{file} exists, and vsnbench did not write it", advice="choose a new name", code="exists")
    with open_record(results.database_url) as engine:
        count = len(read_report_data(engine, selection).episodes)
    if count > MAX_EPISODES:
        raise UsageError(
            f"{count:,} episodes: a single file has at most {MAX_EPISODES}",
            advice="choose some by --model, --goal or --campaign, or write all with --website DIR",
            code="too-many-episodes",
        )
    report, report_page = report_and_page(results, selection, "#/")
    data: dict[str, bytes] = {"report.html": json_bytes(report_page)}
    images: dict[int, dict[str, bytes]] = {}
    for path, content in contents(
        results, report, _WITHIN, {"report": "#/report", "videos": False}, progress, with_films=False
    ):
        if path.startswith("images/"):
            _, episode, name = path.split("/")
            images.setdefault(int(episode), {})[name.partition(".")[0]] = content
        else:
            data[path] = content
    size = sum(map(len, data.values())) + sum(len(text) for text in _scripts()) + 50_000
    every = _every(images.values(), MAX_BYTES - size)
    has_further = any(_is_further(name) for pictures in images.values() for name in pictures)
    if is_cut := has_further and every > 1:
        for number, pictures in images.items():
            images[number] = {name: picture for name, picture in pictures.items() if not _is_further(name)}
        every = _every(images.values(), MAX_BYTES - size)
    written = 0
    for number, pictures in images.items():
        kept = {name: pictures[name] for name in _kept(list(pictures), every)}
        written += len(kept)
        data[f"images/{number}"] = json_bytes(
            {name: f"data:image/webp;base64,{base64.b64encode(picture).decode()}" for name, picture in kept.items()}
        )
    write_atomic(file, _single_page(data, every, only_main=is_cut).encode())
    return WrittenWebsite(file, count, written, 0, (), every)


_LINKED = re.compile(r'<script defer src="assets/([\w.]+)"></script>\n|<link rel="(?:stylesheet|icon)"[^>]*>\n')


def _scripts() -> list[str]:
    """Return the page's scripts in their order."""
    page = (ASSETS / "browse.html").read_text(encoding="utf-8")
    return [(ASSETS / name[1]).read_text(encoding="utf-8") for name in _LINKED.finditer(page) if name[1]]


def _is_further(name: str) -> bool:
    """Return whether a picture is one of a further camera: its name has the role after the number of the action."""
    return "-" in name


def _single_page(data: dict[str, bytes], every: int, *, only_main: bool) -> str:
    """Return the page with its style, its scripts, and what a server would answer as blocks of JSON."""
    script = "\n".join(_scripts())
    own = re.search(r"<script>(.*?)</script>", json.loads(data["report.html"]), re.DOTALL)  # also within this page
    hashes = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
        for text in (script, own[1] if own else "")
    )
    page = _LINKED.sub("", front_page(f"script-src {hashes}; style-src 'unsafe-inline'; img-src data:"))
    style = style_sheet() + (ASSETS / "browse.css").read_text(encoding="utf-8")
    cameras = "main" if only_main else "all"
    page = page.replace("<html ", f'<html data-static="single" data-every="{every}" data-cameras="{cameras}" ')
    page = page.replace("<title>", f'{_MARK}\n<link rel="icon" href="data:,">\n<style>{style}</style>\n<title>')
    blocks = "".join(
        f'<script type="application/json" id="{path}">{content.decode()}</script>\n' for path, content in data.items()
    )
    return page.replace("</body>", f"{blocks}<script>{script}</script>\n</body>")


def _every(episodes: Iterable[dict[str, bytes]], most: int) -> int:
    """Return the smallest n for which every nth picture of each episode fits into a number of bytes as base64."""
    embedded = [[(name, len(picture) * 4 // 3 + 60) for name, picture in episode.items()] for episode in episodes]
    for every in range(1, _FEWEST):
        if sum(size for episode in embedded for _, size in _kept(episode, every)) <= most:
            return every
    return _FEWEST


def _kept(items: list[_Item], every: int) -> list[_Item]:
    """Return every nth item, from the first on, and the last one."""
    return [*items[:-1][::every], *items[-1:]]
