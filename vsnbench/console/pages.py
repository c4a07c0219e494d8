"""What every page is made of: its files, which travel in the package, and answers as JSON with words for people."""

import json
from pathlib import Path
from typing import Any, Final

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import BaseRoute, Route

from vsnbench.console.gate import Door
from vsnbench.console.session_key import Visitor
from vsnbench.errors import VsnbenchError

ASSETS: Final = Path(__file__).parent / "assets"
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}


def page_routes(page: str, path: str = "/") -> list[BaseRoute]:
    """Return the routes of a page: itself at `path`, and every asset under `/assets/`.

    Args:
        page: the file of the page among the assets, `operator.html`.
        path: where it is.
    """

    async def whole(_request: Request) -> Response:
        return FileResponse(ASSETS / page, media_type=_TYPES[".html"])

    async def asset(request: Request) -> Response:
        file = _ASSETS.get(request.path_params["name"])
        if file is None:
            raise HTTPException(404)
        return FileResponse(file, media_type=_TYPES[file.suffix])

    return [Route(path, whole), Route("/assets/{name}", asset)]


_ASSETS: Final = {file.name: file for file in sorted(ASSETS.iterdir()) if file.suffix in _TYPES}


def visitor_of(scope: Any) -> Visitor:
    """Return whose request it is."""
    visitor: Visitor = scope["visitor"]
    return visitor


def door_of(scope: Any) -> Door:
    """Return the door that it came through."""
    door: Door = scope["door"]
    return door


async def said_in(request: Request) -> dict[str, Any]:
    """Return the JSON object of a request.

    Raises:
        HTTPException: it is none.
    """
    try:
        said = json.loads(await request.body())
    except (ValueError, RecursionError):
        said = None
    if not isinstance(said, dict):
        raise HTTPException(400, "a request must be a JSON object")
    return said


def text_in(said: dict[str, Any], name: str, most: int = 500) -> str:
    """Return a text that a request says, in one line; empty where it does not.

    Raises:
        HTTPException: it is no text, or too long.
    """
    given = said.get(name, "")
    if not isinstance(given, str) or len(given) > most:
        raise HTTPException(400, f"{name} must be a text of at most {most} characters")
    return " ".join(given.split())


def whole_number_in(said: dict[str, Any], name: str) -> int:
    """Return a whole number that a request says.

    Raises:
        HTTPException: it does not, or says one that no record has.
    """
    given = said.get(name)
    if not isinstance(given, int) or isinstance(given, bool) or not 0 <= given < 2**31:
        raise HTTPException(400, f"{name} must be a whole number")
    return given


async def in_words(_request: Request, error: Exception) -> Response:
    """Answer what went wrong as words, for `Starlette(exception_handlers=...)`."""
    if isinstance(error, HTTPException):
        return JSONResponse({"words": error.detail}, error.status_code)
    if isinstance(error, VsnbenchError):
        return JSONResponse({"words": str(error)}, 409)
    raise error


IN_WORDS: Final[dict[Any, Any]] = {HTTPException: in_words, VsnbenchError: in_words}
