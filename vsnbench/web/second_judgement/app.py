"""The rater's page as an application. It sends only what `SecondRating` reveals."""

from pathlib import Path
from typing import Any, Final

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from vsnbench.runner.judging.second import BlindEpisode, SecondRating
from vsnbench.runner.operator.answers import MisreadError
from vsnbench.web.operator.app import ASSETS as OPERATOR_ASSETS
from vsnbench.web.operator.app import judging_form
from vsnbench.web.operator.session_json import case_json
from vsnbench.web_server.pages import ERROR_HANDLERS, csrf_token_for, json_body, page_routes, text_field

_ASSETS: Final = Path(__file__).parent / "assets"
_CODE_LENGTH = 64


class SecondJudgementApp:
    """The routes of the page."""

    def __init__(self, rating: SecondRating) -> None:
        self._rating = rating

    def routes(self) -> Starlette:
        """Return the application to serve."""
        return Starlette(
            routes=[
                *page_routes(_ASSETS, "second.html"),
                Mount("/operator", StaticFiles(directory=OPERATOR_ASSETS)),
                Route("/state", self._state),
                Route("/episodes/{code}/frames/{step:int}", self._frame),
                Route("/judge", self._judge, methods=["POST"]),
                Route("/retract", self._retract, methods=["POST"]),
                Route("/skip", self._skip, methods=["POST"]),
            ],
            exception_handlers=ERROR_HANDLERS,
        )

    async def _state(self, request: Request) -> Response:
        return JSONResponse(await run_in_threadpool(self._state_json) | {"csrf_token": csrf_token_for(request)})

    def _state_json(self) -> dict[str, Any]:
        answers, upcoming = self._rating.answers(), self._rating.upcoming()
        place = {code: number for number, code in enumerate(self._rating.codes, start=1)}
        return {
            "rater": self._rating.rater,
            "total": len(place),
            "episode": _episode_json(upcoming) | {"number": place[upcoming.code]} if upcoming else None,
            "answers": [
                {"code": code, "number": place[code], "outcome": answer.outcome, "text": answer.text}
                for code, answer in answers.items()
            ],
        }

    async def _frame(self, request: Request) -> Response:
        code, step = request.path_params["code"], request.path_params["step"]
        frame = await run_in_threadpool(self._rating.frame, code, step)
        if frame is None:
            raise HTTPException(404, "this image is not stored")
        return Response(frame, media_type="image/jpeg", headers={"cache-control": "private, max-age=3600"})

    async def _judge(self, request: Request) -> Response:
        body = await json_body(request)
        code, form = text_field(body, "episode", _CODE_LENGTH), judging_form(body)
        try:
            outcome = await run_in_threadpool(self._rating.judge, code, form.answer)
        except MisreadError as error:
            return JSONResponse({"message": str(error), "code": error.code}, 422)
        return JSONResponse({"outcome": outcome})

    async def _retract(self, request: Request) -> Response:
        code = text_field(await json_body(request), "episode", _CODE_LENGTH)
        await run_in_threadpool(self._rating.retract, code)
        return JSONResponse({})

    async def _skip(self, request: Request) -> Response:
        self._rating.skip(text_field(await json_body(request), "episode", _CODE_LENGTH))
        return JSONResponse({})


def _episode_json(episode: BlindEpisode) -> dict[str, Any]:
    """Return what a rater needs to judge an episode."""
    return case_json(episode.case) | {"episode": episode.code, "goal": episode.goal}
