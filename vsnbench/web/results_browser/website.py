"""Writes the page of results as files for a static host or a browser: report, list, episodes, images, videos."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import cv2

from vsnbench import __version__
from vsnbench.errors import RecordError, UsageError, VsnbenchError
from vsnbench.files.atomic import sweep_parts, write_atomic
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.failures import failure_kinds
from vsnbench.report.build import Report
from vsnbench.report.figures.choose import build_and_draw
from vsnbench.report.figures.style import PAGE_FORMATS
from vsnbench.report.formats.html import html_page
from vsnbench.report.formats.json import to_json
from vsnbench.report.measures import COUNT, NUMBER, TEXT, TEXTS, Form, Measure, Measures, objects, values
from vsnbench.report.tables.conditions import CONDITION
from vsnbench.report.tables.headline import headlines
from vsnbench.results.files.confined_paths import read_confined
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.files.film import film_path
from vsnbench.results.files.images import rgb_path
from vsnbench.results.reading.queries import episode_record, episode_steps
from vsnbench.results.schema.migrate import open_record
from vsnbench.values.encoding.images import decode_picture
from vsnbench.viewer.replay import replay_of
from vsnbench.viewer.video.episodes import SIZES, VideoFormat, write_video
from vsnbench.web.results_browser.app import ASSETS
from vsnbench.web.results_browser.data import COLUMNS, SCHEMA, episodes_json, page_of, site_of
from vsnbench.web.site_editor.drawing import plan_svg
from vsnbench.web_server.pages import SHARED_ASSETS

HEADLINE: Final = "headline.json"
EPISODES_PAGE: Final = "episodes.html"
_OWN_DIRECTORIES = ("assets", "data", "images", "plan", "shared", "video")
_IMAGE_WIDTH_PX = 480
_JPEG_QUALITY = 80
_OWN_FILES = "'self' file:"  # the second for a website that is opened as files
_POLICY = (
    '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
    f"script-src {_OWN_FILES}; style-src {_OWN_FILES}; img-src {_OWN_FILES}; base-uri 'none'; form-action 'none'\">"
)
Progress = Callable[[str, int, int], object]


@dataclass(frozen=True, slots=True)
class WrittenWebsite:
    """What was written."""

    episodes: int
    images: int
    videos: int
    problems: tuple[str, ...]
    """Episodes without a video, and why."""


WEBSITE = Measures(
    Measure("directory", TEXT, "directory of the website"),
    Measure("episodes", COUNT, "number of episodes on the website"),
    Measure("images", COUNT, "number of written images"),
    Measure("videos", COUNT, "number of written videos"),
    Measure("problems", TEXTS, "episodes without a video, and why"),
)
"""The JSON object of `report --website`."""
_OF_CONDITION = Measures(*map(CONDITION.named, ("name", "environment", "site")))
_LIMITS = "lower and upper limit of the 95 % interval, each null if unknown"
_HEADLINE = Measures(
    *_OF_CONDITION.within(lambda row: row[0].condition),
    Measure("goals", TEXTS, "goals that the rate covers", lambda row: row[1][0]),
    Measure("episodes", COUNT, "number of counted episodes", lambda row: row[1][1].episodes),
    Measure("successes", COUNT, "number of successes among them", lambda row: row[1][1].successes),
    Measure("success_rate", NUMBER, "share of successes", lambda row: row[1][1].success_rate, null="without episodes"),
    Measure(
        "interval",
        values(Form({"type": ["number", "null"]})),
        _LIMITS,
        lambda row: (row[1][1].interval.low, row[1][1].interval.high),
    ),
)
"""A condition with its goals and group of `headlines`."""
HEADLINES = Measures(
    Measure("schema", COUNT, f"version of these fields, now {SCHEMA}"),
    Measure("vsnbench", TEXT, "version of vsnbench that wrote it"),
    Measure("created_at", TEXT, "time of writing"),
    Measure("conditions", objects(_HEADLINE), "one object per condition"),
    Measure("answers", TEXTS, "the report's answers, one sentence each"),
)
"""The content of headline.json."""


def write_website(
    results: ResultsDirectory,
    selection: Selection,
    directory: Path,
    *,
    with_videos: bool,
    progress: Progress = lambda _what, _done, _of: None,
) -> WrittenWebsite:
    """Write a website; an earlier one in the directory is replaced.

    Args:
        results: the results directory.
        selection: part of the record to show.
        directory: new, empty, or an earlier website.
        with_videos: also write a video of each episode.
        progress: called with a kind of work, what is done of it, and all of it.

    Raises:
        UsageError: the directory has other content, or nothing matches the selection.
        RecordError: the record cannot be read, or a file cannot be written.
    """
    report, drawings = build_and_draw(results.database_url, selection, results.path, formats=PAGE_FORMATS)
    _clear(directory)
    page = html_page(report, report.tables(long=True), drawings, episodes_page=EPISODES_PAGE)
    write_atomic(directory / "index.html", page.encode())
    write_atomic(
        directory / "report.json",
        to_json(report.results, report.questions, report.activity, report.record, raters=report.raters).encode(),
    )
    write_atomic(directory / HEADLINE, _json(_headline(report)))
    front = (ASSETS / "browse.html").read_text(encoding="utf-8").replace("<title>", f"{_POLICY}\n<title>")
    write_atomic(directory / EPISODES_PAGE, front.replace("<html ", "<html data-static ").encode())
    for name, source in (("assets", ASSETS), ("shared", SHARED_ASSETS)):
        for file in sorted(source.iterdir()):
            if file.suffix in (".js", ".css", ".svg"):
                write_atomic(directory / name / file.name, file.read_bytes())
    numbers = {int(number) for number in report.record.episodes["episode"]}
    return _write_episodes(results, report, numbers, directory, with_videos=with_videos, progress=progress)


def _write_episodes(
    results: ResultsDirectory,
    report: Report,
    chosen: set[int],
    directory: Path,
    *,
    with_videos: bool,
    progress: Progress,
) -> WrittenWebsite:
    images = videos = 0
    problems: list[str] = []
    with open_record(results.database_url) as engine:
        listed = episodes_json(engine)
        listed["rows"] = [row for row in listed["rows"] if row[COLUMNS.index("id")] in chosen]
        kinds = {number: kind.value for number, kind in failure_kinds(engine, report.record)}
        _write_answer(directory, "data/failures.json", {"is_complete": True, "kinds": kinds})
        session = {"csrf_token": "", "author": "", "title": "results", "report": "index.html"}
        _write_answer(directory, "data/session.json", session)
        drawn: set[str] = set()
        for done, row in enumerate(listed["rows"]):
            number = int(row[COLUMNS.index("id")])
            progress("episodes", done, len(listed["rows"]))
            recorded = episode_record(engine, number)
            steps = episode_steps(engine, number)
            episode = page_of(recorded, steps)
            _write_answer(directory, f"data/episode-{number}.json", episode)
            site, sha256 = site_of(recorded), recorded.provenance.site_sha256
            if site is not None and sha256 not in drawn:
                drawn.add(sha256)
                _write_answer(directory, f"plan/{sha256}.svg", plan_svg(site))
            written = _write_images(results, recorded.images_directory, episode, directory)
            row[COLUMNS.index("has_images")] = bool(written)
            images += written
            if not (with_videos and written):
                continue
            try:
                file = directory / "video" / f"{number}.mp4"
                write_video([replay_of(results, recorded, steps)], file, VideoFormat(SIZES["web"]))
                videos += 1
            except VsnbenchError as error:
                problems.append(error.statement)
        _write_answer(directory, "data/episodes.json", listed)
    return WrittenWebsite(len(listed["rows"]), images, videos, tuple(problems))


def _write_answer(directory: Path, path: str, content: object) -> None:
    """Write what a server answers to a path, as a script that the page of episodes can also load from a file."""
    write_atomic(directory / f"{path}.js", b"provide(%s,%s);\n" % (_json(path), _json(content)))


def _write_images(results: ResultsDirectory, images: str, episode: dict[str, Any], directory: Path) -> int:
    """Write the colour images of an episode and of its film, smaller than recorded, and return their number."""
    if not images:
        return 0
    folder, target, written = results.episode_directory(images), directory / "images" / str(episode["row"]["id"]), 0
    for step in episode["steps"]:
        number = step["number"]
        files = {f"{number}.jpg": rgb_path(Path(), number)}
        files |= {f"{number}-{k}.jpg": film_path(Path(), number, k) for k in range(1, len(step["film"]) + 1)}
        for name, file in files.items():
            content = read_confined(folder, file)
            if content and (jpeg := _smaller(content)):
                write_atomic(target / name, jpeg)
                written += 1
    return written


def _smaller(content: bytes) -> bytes | None:
    """Return an image as JPEG, not wider than a page needs; None if it cannot be decoded."""
    picture = decode_picture(content, cv2.IMREAD_COLOR)
    if picture is None:
        return None
    if picture.shape[1] > _IMAGE_WIDTH_PX:
        size = _IMAGE_WIDTH_PX, round(picture.shape[0] * _IMAGE_WIDTH_PX / picture.shape[1])
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    made, jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return jpeg.tobytes() if made else None


def _headline(report: Report) -> dict[str, Any]:
    """Return the rate of each condition and the answers, for other programs; documented in docs/json.md."""
    found = {
        "schema": SCHEMA,
        "vsnbench": __version__,
        "created_at": datetime.now(UTC).isoformat(timespec="seconds"),
        "conditions": zip(report.results.conditions, headlines(report.results.conditions).by_condition, strict=True),
        "answers": [answer for question in report.questions for answer in question.answers],
    }
    return HEADLINES.fields(found)


def _clear(directory: Path) -> None:
    """Remove an earlier website.

    Raises:
        UsageError: the directory has other content.
        RecordError: it cannot be written.
    """
    sweep_parts(directory)  # the rest of them is in directories that are removed below
    if directory.exists() and (
        not directory.is_dir() or (any(directory.iterdir()) and not (directory / HEADLINE).is_file())
    ):
        raise UsageError(f"{directory} is not empty and has no {HEADLINE}", advice="choose a new directory")
    try:
        for name in _OWN_DIRECTORIES:
            if (directory / name).is_dir() and not (directory / name).is_symlink():
                shutil.rmtree(directory / name)
    except OSError as error:
        raise RecordError(f"cannot replace {directory}: {error.strerror or error}") from error


def _json(content: object) -> bytes:
    return json.dumps(content, ensure_ascii=False, separators=(",", ":"), default=str).encode()
