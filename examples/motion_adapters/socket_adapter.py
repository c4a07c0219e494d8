"""A motion adapter over a socket (docs/motion-adapter.md): `python socket_adapter.py apartment:Apartment`.

Another robot is another class in place of `Apartment`: its members are those of `by_velocity.Base`.
"""

import hmac
import os
import threading

from by_velocity import Movement, robot_of_command_line
from msgpack import packb, unpackb
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

TOKEN, PORT = os.environ.get("VSNBENCH_TOKEN", ""), int(os.environ.get("ADAPTER_PORT", "8770"))
in_use = threading.Lock()


def answer(base, request: dict, movement: Movement) -> dict | None:
    """Return the answer to a request; None where the client expects none."""
    match request["type"]:
        case "state":
            return {"type": "state", **base.state()}
        case "begin":
            return {"type": "ready"}
        case "place":
            return {"type": "placed", "problem": base.place(request["pose"], request["seed"])}
        case "observe":
            return {"type": "observation", **base.state(with_depth=True), "rgb": base.colours()}
        case "drive":  # answered before the robot moves
            movement.begin(request)
        case "go" if movement.runs:  # the client allows another tenth of a second
            movement.go_on(0.1)
        case "stop" if movement.runs:
            movement.stop()
        case _:
            return None
    if movement.runs:
        return {"type": "progress", **base.state(with_depth=movement.request["watch"])}
    return {"type": "done", **movement.ended, **base.state()}


def handle(connection, base) -> None:
    """Serve one client at a time; the robot stops when it leaves, or is silent during a movement."""
    movement, seq, hello = Movement(base), 0, unpackb(connection.recv(timeout=10))
    refused = not hmac.compare_digest(hello["token"], TOKEN)
    if refused or not in_use.acquire(blocking=False):
        return connection.send(packb({"type": "error", "code": "token" if refused else "busy", "message": "refused"}))
    try:
        connection.send(packb({"type": "card", "wire": 1, "card": base.card}))
        while True:
            try:
                request = unpackb(connection.recv(timeout=base.gone_s if movement.runs else None))
            except TimeoutError:
                request = {"type": "stop"}
            seq = request.get("seq", seq)
            if reply := answer(base, request, movement):
                connection.send(packb({**reply, "seq": seq}))
    except ConnectionClosed:
        print("the client has left")
    finally:
        movement.stop()
        in_use.release()


if __name__ == "__main__":
    robot = robot_of_command_line()
    with serve(lambda connection: handle(connection, robot), "127.0.0.1", PORT, compression=None) as server:
        server.serve_forever()
