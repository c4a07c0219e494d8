"""The site editor as an application: loads, checks and saves a site file, renders previews, and reads underlays."""

import base64
import binascii
import json
import math
import threading
from pathlib import Path
from typing import Any, Final

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from vsnbench.errors import SiteError
from vsnbench.settings.yaml_file import text_faults
from vsnbench.simulator.scan.comparison import scan_findings
from vsnbench.site_checks.check import check_site, format_finding
from vsnbench.sites.categories import CATEGORIES, GOAL_CATEGORIES
from vsnbench.sites.site import Site, parse_site
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import RobotProfile
from vsnbench.web.site_editor.document import SiteDocument, save_document
from vsnbench.web.site_editor.goal_images import read_goal_image, store_goal_image
from vsnbench.web.site_editor.preview import camera_image, scan_image
from vsnbench.web.site_editor.underlay import Underlay
from vsnbench.web_server.pages import ERROR_HANDLERS, csrf_token_for, json_body, page_routes, text_field

MAX_BODY_BYTES: Final = 48 * 1024 * 1024
"""Allows a map or a photograph of a plan in a request."""
_MAX_COORDINATE = 1e4
_ASSETS = Path(__file__).parent / "assets"


class SiteEditor:
    """The editor of one site file. A lock serializes the requests of several pages."""

    def __init__(self, path: Path, profile: RobotProfile, underlay: Underlay | None = None) -> None:
        """Read the file, or create an empty site if there is none.

        Raises:
            SiteError: the file cannot be read, or is not a mapping with the lists of a site.
            UsageError: the stored underlay cannot be read.
        """
        self._path, self._profile = path, profile
        self._lock = threading.Lock()
        self._underlay = _initial_underlay(path, underlay)
        self._reload()

    def app(self) -> Starlette:
        """Return the application to serve."""
        routes = [
            *page_routes(_ASSETS, "editor.html"),
            Route("/state", self._state),
            Route("/underlay.png", self._underlay_image),
            Route("/check", self._check, methods=["POST"]),
            Route("/save", self._save, methods=["POST"]),
            Route("/preview", self._render_preview, methods=["POST"]),
            Route("/scan-view", self._render_scan, methods=["POST"]),
            Route("/underlay", self._upload_underlay, methods=["POST"]),
            Route("/goal-image", self._goal_image),
            Route("/goal-image", self._upload_goal_image, methods=["POST"]),
            Route("/goal-photo", self._take_goal_photo, methods=["POST"]),
        ]
        return Starlette(routes=routes, exception_handlers=ERROR_HANDLERS)

    def _reload(self) -> None:
        if self._path.exists():
            try:
                text = self._path.read_text(encoding="utf-8")
            except (OSError, UnicodeDecodeError) as error:
                raise SiteError(f"cannot read site file {self._path}: {error}") from error
            self._document = SiteDocument.of(text, str(self._path))
            self._saved_sha256: str | None = self._document.sha256
        else:
            name = "".join(char if char.isalnum() and char.isascii() else "-" for char in self._path.stem.lower())
            self._document, self._saved_sha256 = SiteDocument.new(name.strip("-") or "site"), None

    async def _state(self, request: Request) -> Response:
        from vsnbench.simulator.furniture import MODELS

        with self._lock:
            self._reload()
            underlay = None if self._underlay is None else self._underlay.content()
        return JSONResponse(
            {
                "csrf_token": csrf_token_for(request),
                "path": str(self._path),
                "site": self._document.as_json(),
                "goals": list(GOAL_CATEGORIES),
                "categories": sorted(CATEGORIES),
                "models": {category: list(models) for category, models in MODELS.items()},
                "robot": {"name": self._profile.name, "radius_m": self._profile.base.radius_m},
                "underlay": underlay,
            }
        )

    async def _check(self, request: Request) -> Response:
        body = await json_body(request)
        return JSONResponse(await run_in_threadpool(self._findings, body))

    def _findings(self, body: dict[str, Any]) -> dict[str, Any]:
        with self._lock:
            document = self._document.with_content(_site_field(body))
        directory = self._path.parent
        faults = text_faults(document.text, self._path.name, Site, "site", directory)
        if faults:
            findings = [format_finding(fault) for fault in faults]
        else:
            site = parse_site(document.text, self._path.name, directory)
            findings = [*check_site(site, self._profile.base.radius_m), *scan_findings(site)]
        return {"findings": [finding.content() for finding in findings]}

    async def _save(self, request: Request) -> Response:
        body = await json_body(request)

        def save() -> dict[str, Any]:
            with self._lock:
                document = self._document.with_content(_site_field(body))
                save_document(document, self._path, self._saved_sha256)
                self._document, self._saved_sha256 = document, document.sha256
                self._save_underlay(body)
                return {"site": document.as_json(), "path": str(self._path)}

        return JSONResponse(await run_in_threadpool(save))

    def _save_underlay(self, body: dict[str, Any]) -> None:
        """Save the underlay next to the site file, at the place that the page gives; null deletes it."""
        place = body.get("underlay")
        if isinstance(place, dict) and self._underlay is not None:
            self._underlay = self._underlay.at_place(place)
            self._underlay.save(self._path)
        elif place is None and "underlay" in body:
            self._underlay = None
            Underlay.delete(self._path)

    async def _render_preview(self, request: Request) -> Response:
        body = await json_body(request)
        image = await run_in_threadpool(self._rendered, body, _pose_field(body), full_size=False)
        return Response(image, media_type="image/jpeg")

    async def _render_scan(self, request: Request) -> Response:
        """Show the scan from above around a point, with the height of its surface there in a header."""
        body = await json_body(request)
        image, height_m = await run_in_threadpool(scan_image, self._site_of(body), _pose_field(body))
        headers = {} if height_m is None else {"Surface-Height-M": f"{height_m:.2f}"}
        return Response(image, media_type="image/jpeg", headers=headers)

    async def _take_goal_photo(self, request: Request) -> Response:
        """Store the image of the simulated camera at a pose as the image of a goal."""
        body = await json_body(request)
        pose, goal = _pose_field(body), text_field(body, "goal", 80)
        image = await run_in_threadpool(self._rendered, body, pose, full_size=True)
        return JSONResponse((await run_in_threadpool(store_goal_image, self._path, goal, image)).model_dump())

    async def _upload_goal_image(self, request: Request) -> Response:
        body = await json_body(request)
        image, goal = _base64_field(body, "image"), text_field(body, "goal", 80)
        return JSONResponse((await run_in_threadpool(store_goal_image, self._path, goal, image)).model_dump())

    async def _goal_image(self, request: Request) -> Response:
        name = request.query_params.get("file", "")
        content, media_type = await run_in_threadpool(read_goal_image, self._path, name)
        return Response(content, media_type=media_type)

    def _rendered(self, body: dict[str, Any], pose: Pose, *, full_size: bool) -> bytes:
        return camera_image(self._site_of(body), self._profile.camera, pose, full_size=full_size)

    def _site_of(self, body: dict[str, Any]) -> Site:
        """Return the page's site without its goals, which may be incomplete."""
        with self._lock:
            document = self._document.with_content(_site_field(body) | {"goals": []})
        return parse_site(document.text, self._path.name, self._path.parent)

    async def _underlay_image(self, _request: Request) -> Response:
        if self._underlay is None:
            raise HTTPException(404, "there is no underlay")
        return Response(self._underlay.png, media_type="image/png")

    async def _upload_underlay(self, request: Request) -> Response:
        body = await json_body(request)
        image = _base64_field(body, "image")
        map_yaml = body.get("map")
        if map_yaml is not None and not isinstance(map_yaml, str):
            raise HTTPException(400, "map must be the text of a map.yaml")
        name = text_field(body, "name", 200)
        underlay = await run_in_threadpool(Underlay.of, image, map_yaml, name)
        with self._lock:
            self._underlay = underlay
        return JSONResponse(underlay.content())


def _initial_underlay(path: Path, given: Underlay | None) -> Underlay | None:
    """Return the given underlay, or the stored one if there is none or it has the same image."""
    stored = Underlay.load(path)
    if given is None or (stored is not None and stored.png == given.png):
        return stored
    return given


def _pose_field(body: dict[str, Any]) -> Pose:
    values = [body.get(name) for name in ("x_m", "y_m", "heading_deg")]
    numbers = [float(value) for value in values if isinstance(value, int | float) and abs(value) < _MAX_COORDINATE]
    if len(numbers) < len(values):
        raise HTTPException(400, "x_m, y_m and heading_deg must be numbers")
    x_m, y_m, heading_deg = numbers
    return Pose(x_m, y_m, math.radians(heading_deg))


def _site_field(body: dict[str, Any]) -> dict[str, Any]:
    site = body.get("site")
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


def _base64_field(body: dict[str, Any], name: str) -> bytes:
    try:
        return base64.b64decode(str(body.get(name, "")), validate=True)
    except (binascii.Error, ValueError) as error:
        raise HTTPException(400, f"{name} must be base64") from error
