"""The operator's page as an application: shows the session to browsers and passes answers to the runner.

It holds no rule of a trial: the runner checks and records every answer.
"""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import cv2
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from vsnbench.runner.judging.case import Case
from vsnbench.runner.judging.corrections import Corrections
from vsnbench.runner.judging.decision import JudgingForm, UnconfirmedAnswerError, decide
from vsnbench.runner.loop.contract import Session
from vsnbench.runner.operator.answers import MisreadError
from vsnbench.runner.operator.contract import Judgement
from vsnbench.runner.operator.placing import PlacementLook
from vsnbench.runner.operator.prompts import Choice, OperatorPrompts
from vsnbench.runner.operator.terminal_placing import LOOK, MOVED, TURN
from vsnbench.text.sanitize import sanitize
from vsnbench.web.operator.clients import Clients
from vsnbench.web.operator.session_json import episode_json, session_json
from vsnbench.web.site_editor.drawing import plan_svg
from vsnbench.web_server.live_pages import INTERVAL_S, LivePages
from vsnbench.web_server.pages import (
    ERROR_HANDLERS,
    access_of,
    csrf_token_for,
    integer_field,
    json_body,
    page_routes,
    text_field,
    visitor_of,
)
from vsnbench.web_server.session_key import MAX_NAME_LENGTH, Visitor

ANSWER_SOURCE: Final = "the page"
STOP_SOURCE: Final = "the page's STOP button"
ASSETS: Final = Path(__file__).parent / "assets"
_MIN_INTERVAL_S = 0.1
"""Time between two states sent to a page, at least."""
_PLACING_IMAGES: Final[dict[str, tuple[Callable[[PlacementLook], bytes | None], str]]] = {
    "camera": (lambda look: look.picture_jpeg, "image/jpeg"),
    "expected": (lambda look: look.ghost_png, "image/png"),
    "photo": (lambda look: look.photo_jpeg, "image/jpeg"),
}


class OperatorApp:
    """The routes of the page and their shared state."""

    def __init__(self, prompts: OperatorPrompts, session: Session) -> None:
        self._prompts = prompts
        self._session = session
        self._clients = Clients()
        self._pages = LivePages(_MIN_INTERVAL_S)
        self._watching: asyncio.Task[None] | None = None
        self._plan = plan_svg(session.site)
        self._corrections = Corrections(prompts, session)

    def routes(self) -> Starlette:
        """Return the application to serve."""
        return Starlette(
            routes=[
                *page_routes(ASSETS, "operator.html"),
                Route("/state", self._state),
                Route("/plan.svg", self._floor_plan),
                Route("/picture", self._camera_image),
                Route("/sign-in", self._sign_in, methods=["POST"]),
                Route("/answer", self._answer, methods=["POST"]),
                Route("/judge", self._judge, methods=["POST"]),
                Route("/stop", self._stop, methods=["POST"]),
                Route("/pause", self._pause, methods=["POST"]),
                Route("/where", self._where, methods=["POST"]),
                Route("/arrived", self._declare_arrival, methods=["POST"]),
                Route("/placing", self._request_placing, methods=["POST"]),
                Route("/placing/{image}", self._placing_image),
                Route("/episodes", self._episodes),
                Route("/episodes/{number:int}/frames/{step:int}", self._frame),
                Route("/summary", self._summary),
                Route("/amend", self._amend, methods=["POST"]),
                Route("/undo", self._undo, methods=["POST"]),
                WebSocketRoute("/live", self._live),
            ],
            exception_handlers=ERROR_HANDLERS,
        )

    def notify(self) -> None:
        """Send the new state to every page. Callable from any thread."""
        self._pages.notify()

    def _state_for(self, visitor: Visitor) -> dict[str, Any]:
        state = session_json(self._prompts, self._session)
        return state | {"you": visitor.name, "clients": self._clients.as_json(visitor.id)}

    async def _state(self, request: Request) -> Response:
        return JSONResponse(self._state_for(visitor_of(request)) | {"csrf_token": csrf_token_for(request)})

    async def _floor_plan(self, _request: Request) -> Response:
        return Response(self._plan, media_type="image/svg+xml")

    async def _camera_image(self, _request: Request) -> Response:
        last, glimpse = self._prompts.state.picture, self._session.robots.preview
        rgb = await run_in_threadpool(glimpse) if glimpse is not None and self._prompts.driving else None
        rgb = last if rgb is None else rgb
        if rgb is None:
            raise HTTPException(404, "there is no camera image yet")
        return Response(await run_in_threadpool(_jpeg, rgb), media_type="image/jpeg")

    async def _sign_in(self, request: Request) -> Response:
        name = sanitize(text_field(await json_body(request), "name", MAX_NAME_LENGTH))
        if not name:
            raise HTTPException(422, "enter your name: it is recorded with every verdict that you give")
        visitor = Visitor(visitor_of(request).id, name)
        self._clients.record_message(visitor)
        self._pages.notify()
        return JSONResponse({"you": name}, headers={"set-cookie": access_of(request).set_cookie_header(visitor)})

    async def _answer(self, request: Request) -> Response:
        body, author = await _signed_body(request)
        answer = text_field(body, "answer", 20)
        if answer not in list(Choice):
            raise HTTPException(400, f"{answer!r} is not an answer")
        self._reply(body, Choice(answer), author)
        return JSONResponse({})

    async def _judge(self, request: Request) -> Response:
        body, author = await _signed_body(request)
        ended, episode = self._prompts.state.ended, integer_field(body, "episode")
        if ended is None or ended.number != episode:
            raise HTTPException(409, f"#{episode} is not the current question")
        try:
            case = Case.of_ended(ended)
            judgement = decide(case, judging_form(body).answer(case))
        except MisreadError as error:
            return _unusable_answer(error)
        self._reply(body, judgement, author)
        await run_in_threadpool(self._corrections.await_judgement, ended.number, author)
        return JSONResponse({"verdict": judgement.verdict.text})

    def _reply(self, body: dict[str, Any], answer: Choice | Judgement, author: str) -> None:
        try:
            self._prompts.reply(integer_field(body, "question"), answer, author, ANSWER_SOURCE)
        except ValueError as error:
            raise HTTPException(400, str(error)) from error

    async def _request_placing(self, request: Request) -> Response:
        body, _ = await _signed_body(request)
        action = text_field(body, "action", 20)
        if action not in (LOOK, TURN, MOVED):
            raise HTTPException(400, f"{action!r} is not an action of the placing")
        self._prompts.request_action(integer_field(body, "question"), action)
        return JSONResponse({})

    async def _placing_image(self, request: Request) -> Response:
        look = self._prompts.state.look
        encode, media_type = _PLACING_IMAGES.get(request.path_params["image"], (lambda _look: None, ""))
        image = await run_in_threadpool(encode, look) if look is not None else None
        if image is None:
            raise HTTPException(404, "there is no such image now")
        return Response(image, media_type=media_type)

    async def _episodes(self, _request: Request) -> Response:
        episodes = await run_in_threadpool(self._corrections.episodes)
        return JSONResponse({"episodes": [episode_json(episode) for episode in episodes]})

    async def _summary(self, _request: Request) -> Response:
        return JSONResponse({"rows": await run_in_threadpool(self._corrections.summary)})

    async def _frame(self, request: Request) -> Response:
        number, step = request.path_params["number"], request.path_params["step"]
        frame = await run_in_threadpool(self._corrections.frame, number, step)
        if frame is None:
            raise HTTPException(404, "this image is not stored")
        return Response(frame, media_type="image/jpeg")

    async def _amend(self, request: Request) -> Response:
        body, author = await _signed_body(request)
        episode, seen = integer_field(body, "episode"), integer_field(body, "seen")
        try:
            verdict = await run_in_threadpool(self._corrections.amend, episode, judging_form(body), author, seen)
        except MisreadError as error:
            return _unusable_answer(error)
        return JSONResponse({"verdict": verdict})

    async def _undo(self, request: Request) -> Response:
        body, author = await _signed_body(request)
        episode, seen = integer_field(body, "episode"), integer_field(body, "seen")
        return JSONResponse({"verdict": await run_in_threadpool(self._corrections.undo, episode, author, seen)})

    async def _stop(self, request: Request) -> Response:
        return JSONResponse({"message": await self._stop_robot(visitor_of(request))})

    async def _stop_robot(self, visitor: Visitor) -> str:
        # The request to stop needs no other thread. The halt waits until the base is at rest, so it gets its own
        # thread at once, whatever else is in progress.
        episode_ends = self._prompts.end_episode(visitor.name, STOP_SOURCE)
        await asyncio.to_thread(self._prompts.halt)
        return "Stopped. The episode ends here." if episode_ends else "Stop command sent to the robot."

    async def _pause(self, request: Request) -> Response:
        body, author = await _signed_body(request)
        self._prompts.pause(author if body.get("pause") is True else "")
        return JSONResponse({})

    async def _where(self, request: Request) -> Response:
        await _signed_body(request)
        self._prompts.ask_where()
        return JSONResponse({})

    async def _declare_arrival(self, request: Request) -> Response:
        await _signed_body(request)
        self._prompts.declare_arrival()
        return JSONResponse({})

    async def _live(self, socket: WebSocket) -> None:
        visitor = visitor_of(socket)
        self._clients.record_message(visitor)
        if self._watching is None:
            self._watching = asyncio.create_task(self._watch_clients())

        async def take(message: dict[str, Any]) -> dict[str, Any] | None:
            self._clients.record_message(visitor)
            return {"stopped": await self._stop_robot(visitor)} if message.get("stop") is True else None

        await self._pages.serve(socket, lambda: self._state_for(visitor), take)

    async def _watch_clients(self) -> None:
        """Tell the terminal which pages are silent, also if no page is left; ends with the event loop."""
        while True:
            for message in self._clients.status_changes(may_drive=self._prompts.may_drive):
                self._prompts.show_message(message)
            await asyncio.sleep(INTERVAL_S)


def judging_form(body: dict[str, Any]) -> JudgingForm:
    """Return the judging form in a request."""
    return JudgingForm(
        touched=text_field(body, "touched"),
        distance=text_field(body, "distance", 100),
        felt=body.get("felt") is True,
        void=text_field(body, "void"),
        note=text_field(body, "note"),
        is_confirmed=body.get("confirmed") is True,
    )


def _unusable_answer(error: MisreadError) -> JSONResponse:
    needs_confirmation = isinstance(error, UnconfirmedAnswerError)
    return JSONResponse({"message": str(error), "code": error.code, "needs_confirmation": needs_confirmation}, 422)


async def _signed_body(request: Request) -> tuple[dict[str, Any], str]:
    """Return the JSON object of a request, and the name of the operator who sent it.

    Raises:
        HTTPException: 400, the body is not a JSON object; 403, the operator has not signed in.
    """
    body, name = await json_body(request), visitor_of(request).name
    if not name:
        raise HTTPException(403, "sign in first: your name is recorded with your answers")
    return body, name


def _jpeg(rgb: Any) -> bytes:
    done, data = cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 80])
    return bytes(data) if done else b""
