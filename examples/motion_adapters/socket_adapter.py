"""A motion adapter over a socket (docs/motion-adapter.md) for a robot that takes velocities.

    python socket_adapter.py apartment:Apartment            # the simulated apartment
    vsnbench run --robot simulated_base.yaml --model oracle --goal chair --starts 1
    vsnbench doctor --robot simulated_base.yaml --move

Another robot is another class in place of `Apartment`: its members are those of `by_velocity.Base`.
"""

import hmac
import importlib
import os
import sys
import threading

import msgpack
from by_velocity import Base, execute
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

WIRE, PROGRESS_S = 1, 0.1
PORT = int(os.environ.get("ADAPTER_PORT", "8770"))
TOKEN = os.environ.get("VSNBENCH_TOKEN", "")
in_use = threading.Lock()


def drive(connection, base: Base, request: dict) -> dict:
    """Execute one movement. The client allows every further tenth of a second with `go`."""
    steps, due_s = execute(base, request["movement"], request["deadline_s"]), base.now_s
    try:
        while True:
            if base.now_s >= due_s:
                due_s += PROGRESS_S
                state = base.state(with_depth=request["watch"])
                connection.send(msgpack.packb({"type": "progress", "seq": request["seq"], **state}))
                if msgpack.unpackb(connection.recv(timeout=base.gone_s))["type"] != "go":
                    return {"completed": False, "refusal": "stopped", "failure": "stopped by the client"}
            next(steps)
    except StopIteration as end:
        return end.value
    except TimeoutError:
        return {"completed": False, "refusal": "stopped", "failure": "the client is gone"}
    finally:
        base.stop()


def answer(connection, base: Base, request: dict) -> None:
    """Answer one request."""
    match request["type"]:
        case "state" | "begin":
            reply = {"type": "ready" if request["type"] == "begin" else "state", **base.state()}
        case "place":
            reply = {"type": "placed", "problem": base.place(request["pose"], request["seed"])}
        case "observe":
            reply = {"type": "observation", **base.state(with_depth=True), "rgb": base.colours()}
        case "drive":
            reply = {"type": "done", **drive(connection, base, request), **base.state()}
        case "stop":
            base.stop()
            return
        case "go":  # for a movement that has just ended
            return
        case other:
            reply = {"type": "error", "code": "protocol", "message": f"no request is called {other}"}
    connection.send(msgpack.packb({**reply, "seq": request["seq"]}))


def handle(connection, base: Base) -> None:
    """Serve one client at a time; the robot stops when it leaves."""
    hello, refusal = msgpack.unpackb(connection.recv(timeout=10)), None
    if hello["wire"] > WIRE:
        refusal = {"code": "version", "message": f"this adapter speaks version {WIRE}"}
    elif not hmac.compare_digest(hello["token"], TOKEN):
        refusal = {"code": "token", "message": "wrong token"}
    elif not in_use.acquire(blocking=False):
        refusal = {"code": "busy", "message": "another client uses the robot"}
    if refusal:
        return connection.send(msgpack.packb({"type": "error", **refusal}))
    try:
        connection.send(msgpack.packb({"type": "card", "wire": WIRE, "card": base.card}))
        while (request := msgpack.unpackb(connection.recv()))["type"] != "bye":
            answer(connection, base, request)
    except ConnectionClosed:
        print("the client has left", file=sys.stderr)
    finally:
        base.stop()
        in_use.release()


if __name__ == "__main__":
    module, _, name = sys.argv[1].partition(":")
    robot = getattr(importlib.import_module(module), name)(*sys.argv[2:])
    options = {"compression": None, "ping_interval": None, "max_size": 2**20, "origins": [None]}
    with serve(lambda connection: handle(connection, robot), "127.0.0.1", PORT, **options) as server:
        server.serve_forever()
