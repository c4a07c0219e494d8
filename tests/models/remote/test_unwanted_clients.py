"""Clients that send nothing, and pages in a browser, do not keep others from a model."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from tests.models.remote.servers import look, stub_server
from tests.processes import wait_until
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.remote.vsnbench_policy import SPARE_CONNECTIONS

SPINNER = """
import __main__

__main__._HANDSHAKE_SECONDS = 100.0  # on a busy machine the test looks later than 5 s

class Model:
    card = {"name": "spinner", "sensors": ["rgb"]}

    def reset(self, goal, seed):
        pass

    def act(self, observation):
        return "TURN_LEFT"
"""
TOKEN = "a token of the lab"


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with stub_server(SPINNER, tmp_path_factory.mktemp("server"), token=TOKEN) as (url, _):
        yield url


def is_closed(client: socket.socket) -> bool:
    client.setblocking(False)
    try:
        return client.recv(1) == b""
    except BlockingIOError:
        return False
    except ConnectionResetError:
        return True


@pytest.mark.parametrize("greets", [False, True], ids=["before the handshake", "after the handshake"])
def test_the_oldest_of_too_many_silent_clients_are_closed(url: str, greets: bool) -> None:
    address = ("127.0.0.1", int(url.rpartition(":")[2]))
    with ExitStack() as stack:
        working = RemotePolicy(url, token=TOKEN)
        stack.callback(working.close)
        working.reset("chair", 1)
        silent = []
        for _ in range(2 * SPARE_CONNECTIONS):
            if greets:
                silent.append(stack.enter_context(connect(url, close_timeout=0.1)).socket)
            else:
                silent.append(stack.enter_context(socket.create_connection(address, 10)))
        closed = silent[:SPARE_CONNECTIONS]
        if not greets:
            wait_until(lambda: all(map(is_closed, closed)), "the oldest are closed")
            assert not any(map(is_closed, silent[SPARE_CONNECTIONS:]))
        assert working.act(look()).action.value == "TURN_LEFT"
        working.close()
        rightful = RemotePolicy(url, token=TOKEN)
        rightful.close()


def test_a_page_in_a_browser_cannot_use_the_model(url: str) -> None:
    page = Origin("http://evil.example")
    with pytest.raises(InvalidStatus) as refused, connect(url, origin=page):
        pass
    assert refused.value.response.status_code == 403
    with connect(url):
        pass
