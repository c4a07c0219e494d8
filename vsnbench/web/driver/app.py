"""The driver's page as an application: shows the camera and what the trial leaves, and passes actions to the controls.

It knows the controls only, so it can send nothing of the site, the plan, the robot's pose or the judge.
"""

from pathlib import Path
from typing import Any, Final

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from vsnbench.models.human.controls import CHOICES, Controls
from vsnbench.values.movement import Action
from vsnbench.web.operator.app import ASSETS as OPERATOR_ASSETS
from vsnbench.web_server.live_pages import LivePages
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


class DriverApp:
    """The routes of the page."""

    def __init__(self, controls: Controls) -> None:
        self._controls = controls
        self._pages = LivePages()

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
        self._pages.notify()

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
            raise HTTPException(404, "no camera image has arrived yet")
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

        async def take(message: dict[str, Any]) -> None:
            self._controls.hear(visitor)
            if isinstance(number := message.get("shown"), int):
                self._controls.shown(visitor, number)

        await self._pages.serve(socket, lambda: driver_json(self._controls, visitor), take)


def driver_json(controls: Controls, visitor: str) -> dict[str, Any]:
    """Return what a page is told. It is complete, so that a reloaded page loses nothing."""
    view, budget = controls.view, controls.view.budget
    return {
        "driver": controls.driver,
        "controls": "yours" if controls.is_held_by(visitor) else "free" if controls.is_free else "taken",
        "practice": controls.practice,
        "phase": view.phase.value,
        "trial": view.trial,
        "leg": view.leg,
        "goal": view.goal,
        "has_photo": view.photo is not None,
        "success_distance_m": view.success_distance_m,
        "picture": view.picture,
        "refused": view.refused,
        "actions_left": budget.actions_left,
        "time_left_s": None if budget.time_left_s is None else round(budget.time_left_s, 1),
        "path_left_m": None if budget.path_left_m is None else round(budget.path_left_m, 2),
    }
