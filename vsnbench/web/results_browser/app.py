"""The browser of a results directory as an application."""

import contextlib
import json
import threading
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any, Final

from sqlalchemy import Engine
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route

from vsnbench.errors import UsageError, VsnbenchError
from vsnbench.files.temporary import ScratchDirectory
from vsnbench.results.annotations import MAX_NOTE_CHARACTERS, Annotation, read_annotation
from vsnbench.results.files.confined_paths import read_confined
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.files.film import film_path
from vsnbench.results.files.images import rgb_path
from vsnbench.results.reading.queries import images_of
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.writing.journal import Journal
from vsnbench.results.writing.provenance import gather_provenance
from vsnbench.values.camera import CameraRole
from vsnbench.viewer.replay import read_episode
from vsnbench.viewer.video.episodes import write_video
from vsnbench.web.results_browser.data import cards_json, episode_json, episodes_json, recorded_site, version_of
from vsnbench.web.results_browser.failures import FailureKinds
from vsnbench.web.site_editor.drawing import plan_svg
from vsnbench.web_server.pages import ERROR_HANDLERS, csrf_token_for, json_body, page_routes, text_field

ASSETS: Final = Path(__file__).parent / "assets"
_MAX_ANNOTATED = 1000
_MAX_CARDS = 100
_JPEG = "image/jpeg"


class BrowserApp:
    """The routes of the page. Everything but notes, tags and videos is read from the record for each request."""

    def __init__(self, results: ResultsDirectory, engine: Engine) -> None:
        """Serve a record.

        Args:
            results: the results directory; images are read from below it only.
            engine: its database.
        """
        self._results = results
        self._engine = engine
        self._operator = gather_provenance().operator
        self._videos = ScratchDirectory("videos")
        self._listed: tuple[str, bytes] = ("", b"")
        self._listing = threading.Lock()
        self._failures = FailureKinds(engine)

    def routes(self) -> Starlette:
        """Return the application to serve."""
        return Starlette(
            routes=[
                *page_routes(ASSETS, "browse.html"),
                Route("/data/session.json", self._session),
                Route("/data/version.json", self._version),
                Route("/data/episodes.json", self._episodes),
                Route("/data/failures.json", self._failure_kinds),
                Route("/data/episode-{number:int}.json", self._episode),
                Route("/data/cards/{numbers}.json", self._cards),
                Route("/plan/{sha256}.svg", self._plan),
                Route("/images/{number:int}/{step:int}.jpg", self._image),
                Route("/images/{number:int}/{step:int}-{frame:int}.jpg", self._image),
                Route("/images/{number:int}/{step:int}-{role}.jpg", self._image),
                Route("/video/{numbers}.mp4", self._video),
                Route("/annotate", self._annotate, methods=["POST"]),
            ],
            exception_handlers=ERROR_HANDLERS,
        )

    def prepare(self) -> None:
        """Read the list in a thread, while the user opens the address; the page shows an error when it asks again."""

        def read() -> None:
            with contextlib.suppress(VsnbenchError):
                self._list()

        threading.Thread(target=read, name="browse-list", daemon=True).start()

    def close(self) -> None:
        """End the classification of failures, and delete the videos that were made for download."""
        self._failures.close()
        self._videos.remove()

    async def _session(self, request: Request) -> Response:
        fields = {"csrf_token": csrf_token_for(request), "author": self._operator}
        return JSONResponse(fields | {"title": str(self._results.path)})

    async def _version(self, _request: Request) -> Response:
        return JSONResponse({"version": await run_in_threadpool(version_of, self._engine)})

    async def _episodes(self, _request: Request) -> Response:
        return Response(await run_in_threadpool(self._list), media_type="application/json")

    def _list(self) -> bytes:
        """Return the list of episodes as JSON; it is read again only if the record has changed."""
        with self._listing:
            if self._listed[0] != version_of(self._engine):
                listed = episodes_json(self._engine)
                self._listed = (listed["version"], json.dumps(listed, separators=(",", ":")).encode())
                self._failures.update()
            return self._listed[1]

    async def _failure_kinds(self, _request: Request) -> Response:
        return JSONResponse({"is_complete": self._failures.is_complete, "kinds": self._failures.known()})

    async def _episode(self, request: Request) -> Response:
        return JSONResponse(await self._read(partial(episode_json, self._engine, request.path_params["number"])))

    async def _cards(self, request: Request) -> Response:
        numbers = _numbers(request, most=_MAX_CARDS)
        return JSONResponse(await self._read(partial(cards_json, self._engine, numbers)))

    async def _plan(self, request: Request) -> Response:
        site = await run_in_threadpool(recorded_site, self._engine, request.path_params["sha256"])
        if site is None:
            raise HTTPException(404, "this site is unknown")
        return Response(await run_in_threadpool(plan_svg, site), media_type="image/svg+xml")

    async def _image(self, request: Request) -> Response:
        content = await self._read(partial(self._read_image, **request.path_params))
        if content is None:
            raise HTTPException(404, "this step has no image")
        return Response(content, media_type=_JPEG, headers={"cache-control": "private, max-age=3600"})

    def _read_image(self, number: int, step: int, frame: int | None = None, role: str = "") -> bytes | None:
        """Return the image of a step, one of its film, or that of the further camera with a role."""
        if not (images := images_of(self._engine, number, film=frame is not None)) or role not in ("", *CameraRole):
            return None
        file = rgb_path(Path(), step, role) if frame is None else film_path(Path(), step, frame)
        return read_confined(self._results.episode_directory(images), file)

    async def _video(self, request: Request) -> Response:
        numbers = _numbers(request, most=2)
        name = f"episode{'s' if len(numbers) > 1 else ''}-{'-'.join(map(str, numbers))}.mp4"
        file = self._videos.path / name
        await self._read(partial(self._write_video, numbers, file))
        return FileResponse(file, media_type="video/mp4", filename=name)

    def _write_video(self, numbers: list[int], file: Path) -> None:
        write_video([read_episode(self._results, number) for number in numbers], file)

    async def _annotate(self, request: Request) -> Response:
        body = await json_body(request)
        numbers = body.get("episodes")
        if (
            not isinstance(numbers, list)
            or not 1 <= len(numbers) <= _MAX_ANNOTATED
            or not all(isinstance(number, int) and not isinstance(number, bool) for number in numbers)
        ):
            raise HTTPException(400, f"episodes must be 1 to {_MAX_ANNOTATED} numbers")
        annotation = read_annotation(
            text_field(body, "note", MAX_NOTE_CHARACTERS), _words(body, "tags"), _words(body, "removed_tags")
        )
        await self._read(partial(self._write_annotation, numbers, annotation))
        return JSONResponse({"saved": True})

    def _write_annotation(self, numbers: list[int], annotation: Annotation) -> None:
        with open_record(self._results.database_url, reads_copy=False):
            pass  # the page of an older record shows a copy
        with closing(Journal.open(self._results.database_url)) as journal:
            journal.annotate(numbers, annotation, author=self._operator)

    async def _read(self, call: Callable[[], Any]) -> Any:
        """Call a function in a thread; an episode that does not exist is 404."""
        try:
            return await run_in_threadpool(call)
        except UsageError as error:
            raise HTTPException(404 if error.code == "unknown-episode" else 409, str(error)) from error


def _numbers(request: Request, most: int) -> list[int]:
    """Return the numbers of the episodes in a path, such as `1-4`."""
    parts = request.path_params["numbers"].split("-")
    if len(parts) > most or not all(part.isdecimal() and len(part) < 10 for part in parts):
        raise HTTPException(404, f"this is for 1 to {most} episodes")
    return [int(part) for part in parts]


def _words(body: dict[str, Any], name: str) -> list[str]:
    words = body.get(name, [])
    if not isinstance(words, list) or len(words) > 20 or not all(isinstance(word, str) for word in words):
        raise HTTPException(400, f"{name} must be a list of at most 20 texts")
    return words
