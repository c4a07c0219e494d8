"""Writes the page of results as files for a static host or a browser: report, episodes, images, videos."""

import json
import shutil
from collections.abc import Callable, Iterator
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
from vsnbench.viewer.replay import read_episode
from vsnbench.viewer.video.episodes import SIZES, VideoFormat, write_video
from vsnbench.web.results_browser.app import ASSETS
from vsnbench.web.results_browser.data import COLUMNS, SCHEMA, cards_json, episodes_json, page_of, site_of
from vsnbench.web.site_editor.drawing import plan_svg
from vsnbench.web_server.pages import SHARED_ASSETS, STYLE_SHEET, style_sheet

HEADLINE: Final = "headline.json"
GALLERY_PAGE: Final = "index.html"
REPORT_PAGE: Final = "report.html"
_OWN_DIRECTORIES = ("assets", "data", "images", "plan", "shared", "video")
_FORMERLY: Final = "episodes.html"
"""A page that earlier versions wrote."""
_OWN_FILES = "'self' file:"  # the second for a website that is opened as files
Progress = Callable[[str, int, int], object]
Picture = tuple[str, int, int]
"""Format for `cv2.imencode`, maximum width in pixels, and quality."""
_BESIDE: Final[Picture] = (".jpg", 480, 80)


@dataclass(frozen=True, slots=True)
class WrittenWebsite:
    """What was written."""

    path: Path
    """The page to open."""
    episodes: int
    images: int
    videos: int
    problems: tuple[str, ...]
    """Episodes without a video, and why."""
    every: int = 1
    """Each how manyth image of an episode was written."""


WEBSITE = Measures(
    Measure("path", TEXT, "page to open: index.html of the website, or the single file"),
    Measure("episodes", COUNT, "number of episodes on the website"),
    Measure("images", COUNT, "number of written images"),
    Measure("videos", COUNT, "number of written videos"),
    Measure("problems", TEXTS, "episodes without a video, and why"),
    Measure("every", COUNT, "1 if all images were written, 2 if every second one was, and so on"),
)
"""The JSON object of `report --website` and `--single-file`."""
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
    _check(directory)
    report, report_page = report_and_page(results, selection, f"{GALLERY_PAGE}#/")
    _clear(directory)
    write_atomic(directory / REPORT_PAGE, report_page.encode())
    write_atomic(
        directory / "report.json",
        to_json(report.results, report.questions, report.activity, report.record, raters=report.raters).encode(),
    )
    write_atomic(directory / HEADLINE, json_bytes(_headline(report)))
    policy = f"script-src {_OWN_FILES}; style-src {_OWN_FILES}; img-src {_OWN_FILES}"
    front = front_page(policy).replace("<html ", '<html data-static="files" ')
    write_atomic(directory / GALLERY_PAGE, front.encode())
    for name, source in (("assets", ASSETS), ("shared", SHARED_ASSETS)):
        for file in sorted(source.iterdir()):
            if file.suffix in (".js", ".css", ".svg"):
                write_atomic(directory / name / file.name, file.read_bytes())
    write_atomic(directory / "shared" / STYLE_SHEET, style_sheet().encode())
    images: dict[int, int] = {}
    for path, content in contents(results, report, _BESIDE, {"report": REPORT_PAGE, "videos": with_videos}, progress):
        if path.startswith("images/"):
            number = int(path.split("/")[1])
            images[number] = images.get(number, 0) + 1
            write_atomic(directory / path, content)
        else:  # what a server answers, as a script that the page can also load from a file
            write_atomic(directory / f"{path}.js", b"provide(%s,%s);\n" % (json_bytes(path), content))
    problems = _write_videos(results, directory, sorted(images), progress) if with_videos else []
    episodes = len(report.record.episodes)
    videos = len(images) - len(problems) if with_videos else 0
    return WrittenWebsite(directory / GALLERY_PAGE, episodes, sum(images.values()), videos, tuple(problems))


def report_and_page(results: ResultsDirectory, selection: Selection, gallery: str) -> tuple[Report, str]:
    """Return the report and its page, which links to the gallery of episodes at an address."""
    report, drawings = build_and_draw(results.database_url, selection, results.path, formats=PAGE_FORMATS)
    return report, html_page(report, report.tables(long=True), drawings, gallery=gallery)


def front_page(policy: str) -> str:
    """Return the page of episodes with what it may load."""
    policy = f"default-src 'none'; {policy}; base-uri 'none'; form-action 'none'"
    meta = f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n<title>'
    return (ASSETS / "browse.html").read_text(encoding="utf-8").replace("<title>", meta)


def contents(
    results: ResultsDirectory,
    report: Report,
    picture: Picture,
    session: dict[str, Any],
    progress: Progress,
    *,
    with_films: bool = True,
) -> Iterator[tuple[str, bytes]]:
    """Yield what a server answers to each path: JSON, and the pictures of episodes."""
    chosen = {int(number) for number in report.record.episodes["episode"]}
    with open_record(results.database_url) as engine:
        listed = episodes_json(engine)
        listed["rows"] = [row for row in listed["rows"] if row[COLUMNS.index("id")] in chosen]
        listed["notes"] = {number: notes for number, notes in listed["notes"].items() if number in chosen}
        kinds = {number: kind.value for number, kind in failure_kinds(engine, report.record)}
        yield "data/failures.json", json_bytes({"is_complete": True, "kinds": kinds})
        yield "data/session.json", json_bytes({"csrf_token": "", "author": "", "title": "results"} | session)
        drawn: set[str] = set()
        for done, row in enumerate(listed["rows"]):
            number = int(row[COLUMNS.index("id")])
            progress("episodes", done, len(listed["rows"]))
            recorded = episode_record(engine, number)
            episode = page_of(recorded, episode_steps(engine, number))
            site, sha256 = site_of(recorded), recorded.provenance.site_sha256
            if site is not None and sha256 not in drawn:
                drawn.add(sha256)
                yield f"plan/{sha256}.svg", json_bytes(plan_svg(site))
            if not with_films:
                for step in episode["steps"]:
                    step["film"] = []
            has_images = False
            for name, content in _pictures(results, recorded.images_directory, episode, picture):
                has_images = True
                yield f"images/{number}/{name}", content
            row[COLUMNS.index("has_images")] = episode["row"]["has_images"] = has_images
            yield f"data/episode-{number}.json", json_bytes(episode)
            yield f"data/cards/{number}.json", json_bytes(cards_json(engine, [number]))
        yield "data/episodes.json", json_bytes(listed)


def _pictures(
    results: ResultsDirectory, images: str, episode: dict[str, Any], picture: Picture
) -> Iterator[tuple[str, bytes]]:
    """Yield names and contents of the colour images of an episode: of all cameras, and of its film; made smaller."""
    if not images:
        return
    folder = results.episode_directory(images)
    for step in episode["steps"]:
        number = step["number"]
        files = {str(number): rgb_path(Path(), number)}
        files |= {f"{number}-{role}": rgb_path(Path(), number, role) for role in step.get("cameras", ())}
        files |= {f"{number}-{k}": film_path(Path(), number, k) for k in range(1, len(step["film"]) + 1)}
        for name, file in files.items():
            content = read_confined(folder, file)
            if content and (smaller := _smaller(content, picture)):
                yield f"{name}{picture[0]}", smaller


def _write_videos(results: ResultsDirectory, directory: Path, numbers: list[int], progress: Progress) -> list[str]:
    """Write the videos of some episodes, and return why some have none."""
    problems = []
    for done, number in enumerate(numbers):
        progress("videos", done, len(numbers))
        try:
            file = directory / "video" / f"{number}.mp4"
            write_video([read_episode(results, number)], file, VideoFormat(SIZES["web"]))
        except VsnbenchError as error:
            problems.append(error.statement)
    return problems


def _smaller(content: bytes, form: Picture) -> bytes | None:
    """Return an image in a format, not wider than a page needs; None if it cannot be decoded."""
    suffix, width_px, quality = form
    picture = decode_picture(content, cv2.IMREAD_COLOR)
    if picture is None:
        return None
    if picture.shape[1] > width_px:
        size = width_px, round(picture.shape[0] * width_px / picture.shape[1])
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    option = cv2.IMWRITE_JPEG_QUALITY if suffix == ".jpg" else cv2.IMWRITE_WEBP_QUALITY
    made, encoded = cv2.imencode(suffix, picture, [option, quality])
    return encoded.tobytes() if made else None


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


def _check(directory: Path) -> None:
    """Refuse a directory with other content than an earlier website.

    Raises:
        UsageError: the directory has other content.
    """
    if directory.exists() and (
        not directory.is_dir() or (any(directory.iterdir()) and not (directory / HEADLINE).is_file())
    ):
        raise UsageError(f"{directory} is not empty and has no {HEADLINE}", advice="choose a new directory")


def _clear(directory: Path) -> None:
    """Remove an earlier website.

    Raises:
        RecordError: it cannot be written.
    """
    sweep_parts(directory)  # the rest of them is in directories that are removed below
    try:
        (directory / _FORMERLY).unlink(missing_ok=True)
        for name in _OWN_DIRECTORIES:
            if (directory / name).is_dir() and not (directory / name).is_symlink():
                shutil.rmtree(directory / name)
    except OSError as error:
        raise RecordError(f"cannot replace {directory}: {error.strerror or error}") from error


def json_bytes(content: object) -> bytes:
    """Return JSON that can stand within a script of a page."""
    text = json.dumps(content, ensure_ascii=False, separators=(",", ":"), default=str)
    return text.replace("<", "\\u003c").encode()
