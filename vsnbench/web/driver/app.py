"""The driver's page as an application: shows the camera and what the trial leaves, and passes actions to the controls.

It knows the controls only, so it can send nothing of the site, the plan, the robot's pose or the judge.
"""

import asyncio
import contextlib
from pathlib import Path
from typing import Any, Final

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from vsnbench.models.human.controls import CHOICES, Controls
from vsnbench.values.action import Action
from vsnbench.web.operator.app import ASSETS as OPERATOR_ASSETS
from vsnbench.web_server.pages import (
    ERROR_HANDLERS,
    csrf_token_for,
    integer_field,
    json_body,
    page_routes,
    text_field,
    visitor_of,
)

ASSETS: Final = Path(__file__).parent / "assets"
_INTERVAL_S = 1.0
"""Time between two states sent to a page, at most."""


class DriverApp:
    """The routes of the page."""

    def __init__(self, controls: Controls) -> None:
        self._controls = controls
        self._loop: asyncio.AbstractEventLoop | None = None
        self._changes: set[asyncio.Event] = set()
        """One event per connected page, set when the view has changed."""

    def routes(self) -> Starlette:
        """Return the application to serve."""
        return Starlette(
            routes=[
                *page_routes(ASSETS, "driver.html"),
                Mount("/operator", StaticFiles(directory=OPERATOR_ASSETS)),
                Route("/state", self._state),
                Route("/picture", self._picture),
                Route("/goal-photo", self._goal_photo),
                Route("/take", self._take, methods=["POST"]),
                Route("/choose", self._choose, methods=["POST"]),
                WebSocketRoute("/live", self._live),
            ],
            exception_handlers=ERROR_HANDLERS,
        )

    def notify(self) -> None:
        """Send the new view to every page. Callable from any thread."""
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # the event loop ends with the session
                self._loop.call_soon_threadsafe(self._set_changed)

    def _set_changed(self) -> None:
        for changed in self._changes:
            changed.set()

    async def _state(self, request: Request) -> Response:
        state = driver_json(self._controls, visitor_of(request).id)
        return JSONResponse(state | {"csrf_token": csrf_token_for(request)})

    async def _picture(self, request: Request) -> Response:
        return self._image(request, self._controls.picture_jpeg)

    async def _goal_photo(self, request: Request) -> Response:
        return self._image(request, self._controls.view.photo)

    def _image(self, request: Request, jpeg: bytes | None) -> Response:
        if not self._controls.is_held_by(visitor_of(request).id):
            raise HTTPException(403, "only the driver sees the camera")
        if not jpeg:
            raise HTTPException(404, "there is no image yet")
        return Response(jpeg, media_type="image/jpeg")

    async def _take(self, request: Request) -> Response:
        await json_body(request)
        self._controls.take(visitor_of(request).id)
        return JSONResponse({})

    async def _choose(self, request: Request) -> Response:
        body = await json_body(request)
        name = text_field(body, "action", 20)
        if name not in CHOICES:
            raise HTTPException(400, f"{name!r} is not an action")
        self._controls.choose(visitor_of(request).id, integer_field(body, "picture"), Action(name))
        return JSONResponse({})

    async def _live(self, socket: WebSocket) -> None:
        visitor = visitor_of(socket).id
        await socket.accept()
        self._loop = asyncio.get_running_loop()
        changed = asyncio.Event()
        self._changes.add(changed)
        sending = asyncio.create_task(self._send_states(socket, visitor, changed))
        try:
            while True:
                message = await socket.receive_json()
                self._controls.hear(visitor)
                if isinstance(message, dict) and isinstance(number := message.get("heartbeat"), int):
                    await socket.send_json({"heartbeat": number})
                elif isinstance(message, dict) and isinstance(number := message.get("shown"), int):
                    self._controls.shown(visitor, number)
        except (WebSocketDisconnect, ValueError, KeyError, RuntimeError):
            pass  # the client has gone, or sends what our page does not
        finally:
            sending.cancel()
            self._changes.discard(changed)

    async def _send_states(self, socket: WebSocket, visitor: str, changed: asyncio.Event) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError):
            while True:
                changed.clear()
                await socket.send_json(driver_json(self._controls, visitor))
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(_INTERVAL_S):
                        await changed.wait()


def driver_json(controls: Controls, visitor: str) -> dict[str, Any]:
    """Return what a page is told. It is complete, so that a reloaded page loses nothing."""
    view, budget = controls.view, controls.view.budget
    return {
        "driver": controls.driver,
        "controls": "yours" if controls.is_held_by(visitor) else "free" if controls.is_free else "taken",
        "practice": controls.practice,
        "phase": view.phase.value,
        "trial": view.trial,
        "goal": view.goal,
        "has_photo": view.photo is not None,
        "success_distance_m": view.success_distance_m,
        "picture": view.picture,
        "actions_left": budget.actions_left,
        "time_left_s": None if budget.time_left_s is None else round(budget.time_left_s, 1),
        "path_left_m": None if budget.path_left_m is None else round(budget.path_left_m, 2),
    }
