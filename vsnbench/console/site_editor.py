"""The site editor's server: gives the page a site file, checks and saves what comes back, looks into it, reads maps."""

import base64
import binascii
import json
import threading
from pathlib import Path
from typing import Any, Final

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from vsnbench.console.pages import IN_WORDS, door_of, page_routes, said_in, text_in, visitor_of
from vsnbench.console.plan_underlay import Underlay
from vsnbench.console.site_document import SiteDocument, save_document
from vsnbench.console.site_look import SiteLooks
from vsnbench.errors import SiteError
from vsnbench.protocol.categories import CATEGORIES, GOAL_CATEGORIES
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.settings_file import text_faults
from vsnbench.protocol.site import Site, parse_site
from vsnbench.protocol.survey.check import check_site, format_finding

MOST_BODY_BYTES: Final = 48 * 1024 * 1024
"""A map or a photograph of a plan travels in a request."""
_FARTHEST = 1e4


class SiteEditor:
    """One site file being edited; requests of several pages take turns."""

    def __init__(self, path: Path, profile: RobotProfile, underlay: Underlay | None = None) -> None:
        """Read the file, or begin an empty site where there is none.

        Raises:
            SiteError: the file cannot be read, or is no YAML of a site's shape.
            UsageError: what was kept as its underlay cannot be read.
        """
        self._path, self._profile = path, profile
        self._lock = threading.Lock()
        self._underlay = _laid_under(path, underlay)
        self._looks = SiteLooks(profile.camera)
        self._reload()

    def app(self) -> Starlette:
        """Return the application to serve."""
        routes = [
            *page_routes("editor.html"),
            Route("/state", self._state),
            Route("/underlay.png", self._underlay_picture),
            Route("/check", self._check, methods=["POST"]),
            Route("/save", self._save, methods=["POST"]),
            Route("/look", self._look, methods=["POST"]),
            Route("/underlay", self._take_underlay, methods=["POST"]),
        ]
        return Starlette(routes=routes, exception_handlers=IN_WORDS)

    def _reload(self) -> None:
        if self._path.exists():
            try:
                text = self._path.read_text(encoding="utf-8")
            except (OSError, UnicodeDecodeError) as error:
                raise SiteError(f"cannot read site file {self._path}: {error}") from error
            self._document = SiteDocument.of(text, str(self._path))
            self._on_disk: str | None = self._document.sha256
        else:
            name = "".join(each if each.isalnum() and each.isascii() else "-" for each in self._path.stem.lower())
            self._document, self._on_disk = SiteDocument.new(name.strip("-") or "site"), None

    async def _state(self, request: Request) -> Response:
        from vsnbench.simulator.furniture import MODELS

        with self._lock:
            self._reload()
            underlay = None if self._underlay is None else self._underlay.content()
        return JSONResponse(
            {
                "proof": door_of(request.scope).key.request_proof(visitor_of(request.scope)),
                "path": str(self._path),
                "site": self._document.for_page(),
                "goals": list(GOAL_CATEGORIES),
                "categories": sorted(CATEGORIES),
                "models": {category: list(looks) for category, looks in MODELS.items()},
                "robot": {"name": self._profile.name, "radius_m": self._profile.base.radius_m},
                "underlay": underlay,
            }
        )

    async def _check(self, request: Request) -> Response:
        said = await said_in(request)
        return JSONResponse(await run_in_threadpool(self._checked, said))

    def _checked(self, said: dict[str, Any]) -> dict[str, Any]:
        with self._lock:
            document = self._document.with_content(_content_in(said))
        faults = text_faults(document.text, self._path.name, Site, "site")
        if faults:
            findings = [format_finding(fault) for fault in faults]
        else:
            findings = check_site(parse_site(document.text, self._path.name), self._profile.base.radius_m)
        return {"findings": [finding.content() for finding in findings]}

    async def _save(self, request: Request) -> Response:
        said = await said_in(request)

        def save() -> dict[str, Any]:
            with self._lock:
                document = self._document.with_content(_content_in(said))
                save_document(document, self._path, self._on_disk)
                self._document, self._on_disk = document, document.sha256
                self._keep_underlay(said)
                return {"site": document.for_page(), "saved": str(self._path)}

        return JSONResponse(await run_in_threadpool(save))

    def _keep_underlay(self, said: dict[str, Any]) -> None:
        """Keep the underlay beside the file, where the page says it lies; null removes it."""
        place = said.get("underlay")
        if isinstance(place, dict) and self._underlay is not None:
            self._underlay = self._underlay.placed(place)
            self._underlay.keep(self._path)
        elif place is None and "underlay" in said:
            self._underlay = None
            Underlay.forget(self._path)

    async def _look(self, request: Request) -> Response:
        said = await said_in(request)
        given = [said.get(name) for name in ("x_m", "y_m", "heading_deg")]
        numbers = [float(each) for each in given if isinstance(each, int | float) and abs(each) < _FARTHEST]
        if len(numbers) < len(given):
            raise HTTPException(400, "x_m, y_m and heading_deg must be numbers")

        def look() -> bytes:
            with self._lock:
                document = self._document.with_content(_content_in(said))
            return self._looks.jpeg(parse_site(document.text, self._path.name), *numbers)

        return Response(await run_in_threadpool(look), media_type="image/jpeg")

    async def _underlay_picture(self, _request: Request) -> Response:
        if self._underlay is None:
            raise HTTPException(404, "there is no underlay")
        return Response(self._underlay.png, media_type="image/png")

    async def _take_underlay(self, request: Request) -> Response:
        said = await said_in(request)
        image = _bytes_in(said, "image")
        described = said.get("map")
        if described is not None and not isinstance(described, str):
            raise HTTPException(400, "map must be the text of a map.yaml")
        name = text_in(said, "name", 200)
        underlay = await run_in_threadpool(Underlay.of, image, described, name)
        with self._lock:
            self._underlay = underlay
        return JSONResponse(underlay.content())


def _laid_under(path: Path, given: Underlay | None) -> Underlay | None:
    """Return the underlay that is given, at the place where the same one was kept; else what was kept."""
    kept = Underlay.kept(path)
    if given is None or (kept is not None and kept.png == given.png):
        return kept
    return given


def _content_in(said: dict[str, Any]) -> dict[str, Any]:
    site = said.get("site")
    if not isinstance(site, dict):
        raise HTTPException(400, "site must be an object")
    for name, value in site.items():
        if isinstance(value, list) and not all(isinstance(entry, dict) for entry in value):
            raise HTTPException(400, f"{name} must hold objects")
    try:
        json.dumps(site, allow_nan=False)
    except ValueError as error:
        raise HTTPException(400, "numbers must be finite") from error
    return site


def _bytes_in(said: dict[str, Any], name: str) -> bytes:
    try:
        return base64.b64decode(str(said.get(name, "")), validate=True)
    except (binascii.Error, ValueError) as error:
        raise HTTPException(400, f"{name} must be base64") from error
