"""The operator's page: shows the desk to browsers, and hands what is said there to the desk. It holds no rule."""

import asyncio
import contextlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from vsnbench.console.gate import set_cookie
from vsnbench.console.pages import (
    IN_WORDS,
    door_of,
    page_routes,
    said_in,
    text_in,
    visitor_of,
    whole_number_in,
)
from vsnbench.console.phones import Phones
from vsnbench.console.session_key import LONGEST_NAME, SessionKey, Visitor
from vsnbench.console.session_state import episode_shown, session_state
from vsnbench.console.site_drawing import plan_svg
from vsnbench.console.web_server import LOOPBACK, WebServer
from vsnbench.harmless_text import harmless
from vsnbench.runner.answers import MisreadError
from vsnbench.runner.attendance import Occasion
from vsnbench.runner.attendant import Judgement
from vsnbench.runner.case import Case, UnsureError, Word
from vsnbench.runner.corrections import Corrections
from vsnbench.runner.desk import Choice, Desk
from vsnbench.runner.terminal_placing import LOOK, MOVED, TURN

DEFAULT_PORT = 8710
PAGE = "the page"
BUTTON = "the page's STOP button"
_EVERY_S = 0.1
"""States are sent no more often."""
_AT_LEAST_EVERY_S = 1.0


@dataclass(frozen=True, slots=True)
class OperatorPage:
    """Where the page is served, and with what."""

    address: str = LOOPBACK
    port: int = DEFAULT_PORT
    certificate: Path | None = None
    private_key: Path | None = None

    @contextmanager
    def serve(self, desk: Desk, occasion: Occasion) -> Iterator[str]:
        """Serve a desk while the context is entered, and give what the terminal says of it.

        Raises:
            UsageError: the port is taken, or the certificate cannot be used.
        """
        key = SessionKey.kept(f"{occasion.results.path.resolve()} {self.port}")
        pages = _Pages(desk, occasion)
        with WebServer(
            pages.app(),
            key,
            address=self.address,
            port=self.port,
            certificate=self.certificate,
            private_key=self.private_key,
        ) as server:
            desk.told.append(pages.changed)
            try:
                yield told_at_the_terminal(server, to_be_scanned=self.address != LOOPBACK)
            finally:
                desk.told.remove(pages.changed)


def told_at_the_terminal(server: WebServer, *, to_be_scanned: bool) -> str:
    """Return where the page is, with a code for a phone's camera where a phone can reach it."""
    lines = [f"[bold]console[/bold]  {server.addresses[0]}"]
    if to_be_scanned:
        lines.append(code_to_be_scanned(server.addresses[0]))
        if server.scheme == "http":
            lines.append("[dim]anybody on this network can read along: --console-certificate turns TLS on[/dim]")
    return "\n".join(lines)


def code_to_be_scanned(address: str) -> str:
    """Return an address as lines of a terminal that a phone's camera reads: half blocks, what is lit is paper."""
    import io

    import segno

    drawn = io.StringIO()
    segno.make(address, micro=False).terminal(drawn, compact=True)
    return drawn.getvalue()


class _Pages:
    """The routes, with what they share; all but the desk's calls run in the server's loop."""

    def __init__(self, desk: Desk, occasion: Occasion) -> None:
        self._desk = desk
        self._occasion = occasion
        self._phones = Phones()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._news: set[asyncio.Event] = set()
        self._plan = plan_svg(occasion.site)
        self._corrections = Corrections(desk, occasion)

    def app(self) -> Starlette:
        """Return the application."""
        return Starlette(
            routes=[
                *page_routes("operator.html"),
                Route("/state", self._state),
                Route("/plan.svg", self._floor_plan),
                Route("/picture", self._picture),
                Route("/sign-in", self._sign_in, methods=["POST"]),
                Route("/answer", self._answer, methods=["POST"]),
                Route("/judge", self._judge, methods=["POST"]),
                Route("/stop", self._stop, methods=["POST"]),
                Route("/pause", self._pause, methods=["POST"]),
                Route("/wish", self._wish, methods=["POST"]),
                Route("/placing/{what}", self._placing_picture),
                Route("/episodes", self._episodes),
                Route("/episodes/{number:int}/frames/{step:int}", self._frame),
                Route("/summary", self._summary),
                Route("/amend", self._amend, methods=["POST"]),
                Route("/undo", self._undo, methods=["POST"]),
                WebSocketRoute("/live", self._live),
            ],
            exception_handlers=IN_WORDS,
        )

    def changed(self) -> None:
        """Tell every page, from any thread."""
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # the loop has ended with the session
                self._loop.call_soon_threadsafe(self._wake)

    def _wake(self) -> None:
        for event in self._news:
            event.set()

    def _shown(self, visitor: Visitor) -> dict[str, Any]:
        state = session_state(self._desk, self._occasion)
        return state | {"you": visitor.name, "phones": self._phones.shown(visitor.number)}

    async def _state(self, request: Request) -> Response:
        visitor = visitor_of(request.scope)
        proof = door_of(request.scope).key.request_proof(visitor)
        return JSONResponse(self._shown(visitor) | {"proof": proof})

    async def _floor_plan(self, _request: Request) -> Response:
        return Response(self._plan, media_type="image/svg+xml")

    async def _picture(self, _request: Request) -> Response:
        picture, glimpse = self._desk.board.picture, self._occasion.glimpse
        rgb = await run_in_threadpool(glimpse) if glimpse is not None and self._desk.driving else None
        if rgb is None and picture is not None:
            rgb = picture.rgb
        if rgb is None:
            raise HTTPException(404, "the robot has seen nothing yet")
        jpeg = await run_in_threadpool(_jpeg, rgb)
        return Response(jpeg, media_type="image/jpeg")

    async def _sign_in(self, request: Request) -> Response:
        name = harmless(text_in(await said_in(request), "name", LONGEST_NAME))
        if not name:
            raise HTTPException(422, "say your name: it stands beside every verdict that you give")
        old, door = visitor_of(request.scope), door_of(request.scope)
        visitor = Visitor(old.number, name)
        self._phones.heard(visitor)
        self._wake()
        return JSONResponse({"you": name}, headers={"set-cookie": set_cookie(door, visitor)})

    async def _answer(self, request: Request) -> Response:
        said = await said_in(request)
        author = _signed_in(request)
        word = text_in(said, "said", 20)
        if word not in list(Choice):
            raise HTTPException(400, f"{word!r} is no answer")
        self._reply(said, Choice(word), author)
        return JSONResponse({"words": ""})

    async def _judge(self, request: Request) -> Response:
        said = await said_in(request)
        author = _signed_in(request)
        ended, episode = self._desk.board.ended, whole_number_in(said, "episode")
        if ended is None or ended.number != episode:
            raise HTTPException(409, f"#{episode} is not asked about: look at what is asked now")
        try:
            judgement = Case.of_ended(ended).judged_by(word_in(said), text_in(said, "note"))
        except MisreadError as error:
            return JSONResponse({"words": str(error), "unsure": isinstance(error, UnsureError)}, 422)
        self._reply(said, judgement, author)
        await run_in_threadpool(self._corrections.await_judgement, ended.number, author)
        return JSONResponse({"words": judgement.verdict.text})

    def _reply(self, said: dict[str, Any], answer: Choice | Judgement, author: str) -> None:
        try:
            self._desk.reply(whole_number_in(said, "question"), answer, author, PAGE)
        except ValueError as error:
            raise HTTPException(400, str(error)) from error

    async def _wish(self, request: Request) -> Response:
        said = await said_in(request)
        _signed_in(request)
        what = text_in(said, "what", 20)
        if what not in (LOOK, TURN, MOVED):
            raise HTTPException(400, f"{what!r} is nothing that a robot can do at its mark")
        self._desk.wish(whole_number_in(said, "question"), what)
        return JSONResponse({"words": ""})

    async def _placing_picture(self, request: Request) -> Response:
        look = self._desk.board.look
        pictures = {"seen": "picture_jpeg", "ghost": "ghost_png", "photo": "photo_jpeg"}
        name = pictures.get(request.path_params["what"])
        picture = await run_in_threadpool(getattr, look, name) if look is not None and name is not None else None
        if picture is None:
            raise HTTPException(404, "there is no such picture now")
        return Response(picture, media_type="image/png" if name == "ghost_png" else "image/jpeg")

    async def _episodes(self, _request: Request) -> Response:
        shown = await run_in_threadpool(self._corrections.episodes)
        return JSONResponse({"episodes": [episode_shown(one) for one in shown]})

    async def _summary(self, _request: Request) -> Response:
        return JSONResponse({"rows": await run_in_threadpool(self._corrections.summary)})

    async def _frame(self, request: Request) -> Response:
        number, step = request.path_params["number"], request.path_params["step"]
        frame = await run_in_threadpool(self._corrections.frame, number, step)
        if frame is None:
            raise HTTPException(404, "no such picture is kept")
        return Response(frame, media_type="image/jpeg")

    async def _amend(self, request: Request) -> Response:
        said = await said_in(request)
        author = _signed_in(request)
        episode, seen = whole_number_in(said, "episode"), whole_number_in(said, "seen")
        note = text_in(said, "note")
        try:
            words = await run_in_threadpool(self._corrections.amend, episode, word_in(said), note, author, seen)
        except MisreadError as error:
            return JSONResponse({"words": str(error), "unsure": isinstance(error, UnsureError)}, 422)
        return JSONResponse({"words": words})

    async def _undo(self, request: Request) -> Response:
        said = await said_in(request)
        author = _signed_in(request)
        episode, seen = whole_number_in(said, "episode"), whole_number_in(said, "seen")
        return JSONResponse({"words": await run_in_threadpool(self._corrections.undo, episode, author, seen)})

    async def _stop(self, request: Request) -> Response:
        return JSONResponse({"words": await self._stops(visitor_of(request.scope))})

    async def _stops(self, visitor: Visitor) -> str:
        # The movement is told from here, with no other thread to wait for; the halt, which waits until the base stands,
        # has a thread of its own, at once, whatever else is requested.
        ends = self._desk.end_episode(visitor.name, BUTTON)
        await asyncio.to_thread(self._desk.halt)
        return "stopped: the episode ends here" if ends else "the robot is told to stand still"

    async def _pause(self, request: Request) -> Response:
        said = await said_in(request)
        author = _signed_in(request)
        self._desk.pause(author if said.get("pause") is True else "")
        return JSONResponse({"words": ""})

    async def _live(self, socket: WebSocket) -> None:
        visitor = visitor_of(socket.scope)
        await socket.accept()
        self._loop = asyncio.get_running_loop()
        phone = self._phones.heard(visitor)
        phone.sockets += 1
        news = asyncio.Event()
        self._news.add(news)
        telling = asyncio.create_task(self._tell(socket, visitor, news))
        try:
            while True:
                said = await socket.receive_json()
                self._phones.heard(visitor)
                if isinstance(said, dict) and said.get("stop") is True:
                    words = await self._stops(visitor)
                    await socket.send_json({"stopped": words})
                elif isinstance(said, dict) and isinstance(said.get("beat"), int):
                    await socket.send_json({"beat": said["beat"]})
        except (WebSocketDisconnect, ValueError, KeyError, RuntimeError):
            pass  # it has gone, or speaks what no page of ours does
        finally:
            telling.cancel()
            self._news.discard(news)
            self._phones.closed(visitor.number)

    async def _tell(self, socket: WebSocket, visitor: Visitor, news: asyncio.Event) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError):
            while True:
                await socket.send_json(self._shown(visitor))
                for words in self._phones.changes():
                    self._desk.says(words)
                await asyncio.sleep(_EVERY_S)
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(_AT_LEAST_EVERY_S):
                        await news.wait()
                news.clear()


def word_in(said: dict[str, Any]) -> Word:
    """Return what a page says of an episode."""
    return Word(
        touched=text_in(said, "touched"),
        distance=text_in(said, "distance", 100),
        felt=said.get("felt") is True,
        void=text_in(said, "void"),
        sure=said.get("sure") is True,
    )


def _signed_in(request: Request) -> str:
    visitor = visitor_of(request.scope)
    if not visitor.name:
        raise HTTPException(403, "sign in first: your name stands beside what you say")
    return visitor.name


def _jpeg(rgb: Any) -> bytes:
    made, data = cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 80])
    return bytes(data) if made else b""
