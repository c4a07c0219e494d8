"""Building blocks of a page: its assets, the fields of its JSON requests, and errors as JSON responses."""

from pathlib import Path
from typing import Any, Final

from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles

from vsnbench.errors import VsnbenchError
from vsnbench.files.bounded_json import parse_json
from vsnbench.palette import css_variables
from vsnbench.web_server.authentication import Access
from vsnbench.web_server.session_key import Visitor

SHARED_ASSETS: Final = Path(__file__).parent / "assets"
STYLE_SHEET: Final = "style.css"


def style_sheet() -> str:
    """Return the style sheet that all pages share: the colours of models and outcomes, and `STYLE_SHEET`."""
    return css_variables() + (SHARED_ASSETS / STYLE_SHEET).read_text(encoding="utf-8")


def page_routes(assets: Path, page: str) -> list[BaseRoute]:
    """Return the routes of a page: the page at `/`, its assets under `/assets/`, shared ones under `/shared/`.

    Args:
        assets: directory of the page's files.
        page: file name of the page in that directory.
    """

    async def send_page(_request: Request) -> Response:
        return FileResponse(assets / page)

    async def send_style(_request: Request) -> Response:
        return Response(style_sheet(), media_type="text/css")

    return [
        Route("/", send_page),
        Mount("/assets", StaticFiles(directory=assets)),
        Route(f"/shared/{STYLE_SHEET}", send_style),
        Mount("/shared", StaticFiles(directory=SHARED_ASSETS)),
    ]


def visitor_of(connection: HTTPConnection) -> Visitor:
    """Return the visitor who sent a request."""
    visitor: Visitor = connection.scope["visitor"]
    return visitor


def access_of(connection: HTTPConnection) -> Access:
    """Return the access rules of the server that received a request."""
    access: Access = connection.scope["access"]
    return access


def csrf_token_for(connection: HTTPConnection) -> str:
    """Return the CSRF token that the visitor's page must send."""
    return access_of(connection).key.csrf_token(visitor_of(connection))


async def json_body(request: Request) -> dict[str, Any]:
    """Return the JSON object in a request's body.

    Raises:
        HTTPException: 400, the body is not a JSON object.
    """
    try:
        body = parse_json(await request.body())
    except (ValueError, RecursionError):
        body = None
    if not isinstance(body, dict):
        raise HTTPException(400, "a request must be a JSON object")
    return body


def text_field(body: dict[str, Any], name: str, max_length: int = 500) -> str:
    """Return a text field in one line; empty if it is missing.

    Raises:
        HTTPException: 400, the field is not a text or is too long.
    """
    value = body.get(name, "")
    if not isinstance(value, str) or len(value) > max_length:
        raise HTTPException(400, f"{name} must be a text of at most {max_length} characters")
    return " ".join(value.split())


def integer_field(body: dict[str, Any], name: str) -> int:
    """Return a required field with a whole number.

    Raises:
        HTTPException: 400, the field is missing, or is not a number from 0 to 2**31.
    """
    value = body.get(name)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 2**31:
        raise HTTPException(400, f"{name} must be a whole number")
    return value


async def _error_response(_request: Request, error: Exception) -> Response:
    if isinstance(error, HTTPException):
        return JSONResponse({"message": error.detail}, error.status_code)
    if isinstance(error, VsnbenchError):
        return JSONResponse({"message": str(error), "code": error.code}, 409)
    raise error


ERROR_HANDLERS: Final[dict[Any, Any]] = {HTTPException: _error_response, VsnbenchError: _error_response}
"""For `Starlette(exception_handlers=...)`: an error becomes JSON with a `message`."""
