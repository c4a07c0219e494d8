"""Requests to the HTTP server of a stack, which is untrusted: bounded in time and size, without redirects."""

import http.client
import json
from collections.abc import Mapping
from typing import Any
from urllib.parse import urlsplit

from vsnbench.errors import ModelError, ModelLostError
from vsnbench.files.bounded_json import parse_json
from vsnbench.runtime.time_limits import TimeLimitError, call_in_thread
from vsnbench.text.sanitize import sanitize

_LONGEST_ANSWER = 65_536
"""Bytes that are read of an answer."""


def post(url: str, content: Mapping[str, Any] | None, timeout_s: float) -> None:
    """Send JSON; any 2xx answer is acceptance, and its body is not read.

    Raises:
        ModelLostError: no server answers in time.
        ModelError: it refuses.
    """
    _answer("POST", url, b"" if content is None else json.dumps(content).encode(), timeout_s)


def get(url: str, timeout_s: float) -> Mapping[str, Any]:
    """Return the JSON object at an address.

    Raises:
        ModelLostError: no server answers in time.
        ModelError: it refuses, or answers with something else.
    """
    body = _answer("GET", url, None, timeout_s)
    if len(body) > _LONGEST_ANSWER:
        raise ModelError(f"the stack's answer at {url} has more than {_LONGEST_ANSWER:,} bytes")
    try:
        content = parse_json(body)
    except (ValueError, RecursionError) as error:
        raise ModelError(f"the stack's answer at {url} is not JSON: {sanitize(str(error))[:120]}") from error
    if not isinstance(content, dict):
        raise ModelError(f"the stack's answer at {url} is not a JSON object")
    return content


def _answer(method: str, url: str, body: bytes | None, timeout_s: float) -> bytes:
    try:
        return call_in_thread(lambda: _request(method, url, body, timeout_s), timeout_s)
    except TimeLimitError as error:
        raise ModelLostError(f"the stack did not answer {method} {url} within {timeout_s:g} s") from error
    except TimeoutError as error:
        raise ModelLostError(f"the stack did not answer {method} {url} within {timeout_s:g} s") from error
    except (OSError, http.client.HTTPException) as error:
        reason = (error.strerror if isinstance(error, OSError) else "") or type(error).__name__
        raise ModelLostError(f"no stack answers {method} {url}: {reason}", advice="start the stack") from error


def _request(method: str, url: str, body: bytes | None, timeout_s: float) -> bytes:
    parts = urlsplit(url)
    connection = http.client.HTTPConnection(parts.hostname or "", parts.port or 80, timeout=timeout_s)
    try:
        headers = {} if body is None else {"Content-Type": "application/json"}
        where = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
        connection.request(method, where, body, headers)
        answer = connection.getresponse()
        if not 200 <= answer.status < 300:
            raise ModelError(f"the stack answered {answer.status} to {method} {url}")
        return b"" if method == "POST" else answer.read(_LONGEST_ANSWER + 1)
    finally:
        connection.close()
