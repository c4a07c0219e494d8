"""Serves a model to vsnbench. Copy this file next to the model.

It needs Python 3.7 or later, numpy, msgpack (1.0 or later) and websockets (11.0 or later), but not vsnbench:

    from vsnbench_policy import serve

    class Spinner:
        card = {"name": "spinner", "sensors": ["rgb"]}

        def reset(self, goal, seed):
            self.turns = 0

        def act(self, observation):          # observation.rgb: (H, W, 3) uint8
            self.turns += 1
            return "STOP" if self.turns > 12 else "TURN_LEFT"

    serve(Spinner(), port=8765)

On the robot's side: `vsnbench run --model ws://this-machine:8765 --goal chair`. From the shell:

    python vsnbench_policy.py mymodel:Spinner --port 8765
    python vsnbench_policy.py mymodel:Spinner --sessions 8          # for `vsnbench run --workers 8`
    python vsnbench_policy.py --habitat-agent mymodel:Agent --settings agent.json --port 8765

vsnbench's docs/wire.md describes the protocol. Licence: Apache-2.0.
"""

from __future__ import annotations

import argparse
import hashlib
import hmac
import importlib
import inspect
import ipaddress
import json
import keyword
import logging
import math
import os
import platform
import queue
import random
import re
import signal
import socket
import ssl
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, ClassVar

import msgpack
import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve as _serve
from websockets.sync.server import unix_serve as _unix_serve

WIRE_VERSION = 2
"""Version of the protocol in docs/wire.md. Both sides use the highest version that both know."""
OLDEST_WIRE_VERSION = 2
"""Oldest version that this file knows."""
TOKEN_VARIABLE = "VSNBENCH_TOKEN"  # noqa: S105 - the name of a variable
ACTIONS = ("STOP", "MOVE_FORWARD", "MOVE_BACKWARD", "TURN_LEFT", "TURN_RIGHT", "NOOP")
"""NOOP counts as an action and does not move the robot."""
TILTS = ("LOOK_UP", "LOOK_DOWN")
"""No robot does these: `action_map` on the card, such as {"LOOK_UP": "NOOP"}, states what replaces them."""
ARRAY_TYPES = ("uint8", "uint16", "uint32", "int8", "int16", "int32", "float32", "float64")
MAX_ARRAYS = 16
MAX_DIMENSIONS = 4
GOAL_KINDS = ("category", "text", "image", "instruction", "point", "route", "sequence")
MAX_PHOTOGRAPHS = 100
POINT_GOAL = "pointgoal_with_gps_compass"
"""Habitat's name of a point in the robot's frame."""
_GOAL_TEXTS = ("id", "kind", "text", "category")
CAMERA_ROLES = ("front", "left", "right", "rear")
MAX_HISTORY = 50
_BUDGET = ("actions_left", "time_left_s", "path_left_m")
MAX_MESSAGE_BYTES = 64 * 2**20
"""Enough for RGB and float depth of 4096 x 2048. A larger message ends the connection."""
_ATTRIBUTE = re.compile(r"[a-z][a-z0-9_]{0,39}")
_HELLO_BYTES = 64 * 2**10
_HELLO_SECONDS = 10.0
_TEXT_SECONDS = 2.0
_COMPASS_LIMIT = 3.1415925
"""Largest float32 below pi; float32(pi) itself is greater than pi."""
_HANDSHAKE_SECONDS = 5.0
SPARE_CONNECTIONS = 15
"""TCP connections without a session, which are about to close or have not sent a valid hello. Beyond this number the
oldest is closed, so that clients that say nothing do not keep others out."""
MAX_SESSIONS = 256
_OPEN = 1
"""websockets' `State.OPEN`."""

logger = logging.getLogger("vsnbench_policy")
_transport_logger = logging.getLogger("vsnbench_policy.transport")
_transport_logger.setLevel(logging.CRITICAL)  # websockets logs a traceback for each client that leaves in its handshake


class WireError(Exception):
    """A message breaks the protocol."""


class Pose:
    """Pose of the robot relative to the start of the episode: x forward, y left, heading counter-clockwise."""

    def __init__(self, x_m: float, y_m: float, heading_rad: float) -> None:
        self.x_m, self.y_m, self.heading_rad = float(x_m), float(y_m), float(heading_rad)


class Facts:
    """Numbers and names of a protocol or a robot, as attributes."""

    def __init__(self, values: dict[str, Any]) -> None:
        self.__dict__.update(values)


class Camera(Facts):
    """The pinhole camera: `width`, `height` in pixels, `horizontal_fov_deg`, mount and depth range in metres."""


class Goal(str):
    """The goal as a string, with `id`, `kind`, `text`, `category`, `image`, `images` and `point`.

    kind: category, text, image, instruction, point or route. The string is the category, or the words of a text or
    instruction goal, or the id of another one. image: (H, W, 3) uint8 RGB of an image goal, else None. images: those of
    a route, in order, else empty. point: (x, y) in metres in the frame of the start, of a point goal, else None.
    """

    id: str
    kind: str
    text: str
    category: str
    image: Any
    images: Any
    point: Any

    @staticmethod
    def of(message: dict[str, Any]) -> "Goal":
        """Return the goal of a `reset` or `next_goal` message.

        Raises:
            WireError: the message is invalid.
        """
        goal = Goal(_field(message, "goal", str))
        fields = message.get("goal_fields") or {}
        if not isinstance(fields, dict) or not all(isinstance(fields.get(name, ""), str) for name in _GOAL_TEXTS):
            raise WireError("`goal_fields` must be a mapping with texts")
        goal.id, goal.kind = fields.get("id") or str(goal), fields.get("kind") or "category"
        goal.text, goal.category = fields.get("text") or "", fields.get("category") or ""
        if goal.kind not in GOAL_KINDS or goal.kind == "sequence":
            raise WireError(f"no goal is of kind {goal.kind!r:.20}")
        if goal.kind == "category":
            goal.category = goal.category or str(goal)
        goal.image = None if fields.get("image") is None else _rgb_of(fields["image"])
        images, goal.point = fields.get("images") or [], fields.get("point")
        if not isinstance(images, list) or len(images) > MAX_PHOTOGRAPHS:
            raise WireError(f"`goal_fields.images` must be an array of at most {MAX_PHOTOGRAPHS} photographs")
        goal.images = tuple(_rgb_of(image) for image in images)
        if goal.point is not None:
            if not isinstance(goal.point, list) or len(goal.point) != 2 or not all(map(_is_finite, goal.point)):
                raise WireError("`goal_fields.point` must be [x, y] in metres")
            goal.point = tuple(map(float, goal.point))
        if (goal.kind == "point") != (goal.point is not None) or (goal.kind == "route") != bool(goal.images):
            raise WireError("a point needs `point`, and a route `images`; no other goal has them")
        return goal


class Task:
    """What `begin(task)` receives: `goal` (Goal), `seed`, `protocol` and `robot`.

    protocol: `name`, `forward_m`, `turn_deg`, `success_distance_m`, `max_actions`, `max_time_s`, `max_path_m` (None for
    no limit). robot: `name`, `radius_m`, `height_m`, `max_linear_m_s`, `max_angular_rad_s`, `max_lateral_m_s`,
    `camera` (Camera).
    """

    def __init__(self, goal: Goal, seed: int, protocol: Facts, robot: Facts) -> None:
        self.goal, self.seed, self.protocol, self.robot = goal, seed, protocol, robot

    @staticmethod
    def of(goal: Goal, seed: int, given: Any) -> "Task | None":
        """Return the task of a `reset` message; None if it has none.

        Raises:
            WireError: the message is invalid.
        """
        if given is None:
            return None
        protocol: Any = given.get("protocol") if isinstance(given, dict) else None
        robot: Any = given.get("robot") if isinstance(given, dict) else None
        if not isinstance(protocol, dict) or not isinstance(robot, dict):
            raise WireError("`task` must be a mapping with `protocol` and `robot`")
        if not isinstance(robot.get("camera"), dict):
            raise WireError("`task.robot` needs `camera`, a mapping")
        return Task(goal, seed, Facts(protocol), Facts(dict(robot, camera=Camera(robot["camera"]))))


class Observation:
    """Measurements before an action. Sensors that are not on the model's card are None.

    rgb: (H, W, 3) uint8. depth_m: (H, W) float32 metres along the optical axis, NaN where invalid. pose: Pose.
    stamp_s: seconds on the robot's clock. camera: Camera. beyond_range: (H, W) bool: depth is invalid because the
    surface is farther than the camera's range; None if there is no such pixel, or if that is unknown. budget: the
    remaining limits of the episode, `actions_left`, `time_left_s` and `path_left_m`, None where there is no limit.
    history: observations since the last `act`, oldest first, for a model whose card has `history`.
    cameras: observations of further cameras by role, `left`, `right` or `rear`, for a model whose card has `cameras`.
    arrays: arrays of other sensors, by name. Each is also an attribute: `arrays["scan_m"]` is `observation.scan_m`.
    """

    def __init__(  # noqa: PLR0913 - its fields
        self,
        rgb: Any,
        depth_m: Any,
        pose: Pose | None,
        stamp_s: float,
        camera: Camera,
        beyond_range: Any = None,
        budget: dict[str, Any] | None = None,
        history: tuple[Observation, ...] = (),
        cameras: dict[str, Observation] | None = None,
        arrays: dict[str, Any] | None = None,
    ) -> None:
        self.rgb, self.depth_m, self.pose, self.stamp_s, self.camera = rgb, depth_m, pose, stamp_s, camera
        self.beyond_range, self.budget, self.history, self.cameras = beyond_range, budget, history, cameras or {}
        self.arrays = arrays or {}
        for name, array in self.arrays.items():
            if hasattr(self, name):
                raise WireError(f"`arrays` has {name!r:.40}, which every observation has")
            setattr(self, name, array)


def serve(  # noqa: PLR0913 - what its command line has
    policy: Any,
    host: str = "127.0.0.1",
    port: int = 8765,
    token: str | None = None,
    certificate: str | None = None,
    key: str | None = None,
    unix_path: str | None = None,
    ready: Callable[[int], None] | None = None,
    sessions: int = 1,
    batch: int = 1,
) -> None:
    """Serve a policy until Ctrl-C or SIGTERM.

    The policy is called in one thread, once at a time, in the order in which requests arrive.

    Args:
        policy: an object with `card`, `reset(goal, seed)` and `act(observation)`. `card` is a dict with `name` and
            optionally `goals` (list; absent for any), `sensors` ("rgb", "depth", "odometry", ...), `weights_sha256`,
            `weights_label`, `settings`, `action_map`, `anchor`, `history`, `cameras`, `deterministic` and `runs_on`
            (device, threads, ...).
            `act` returns the name of an action, or a dict with `action`, `movement` or `parts`, and optionally
            `raw_action`, `probabilities`, `diagnostics`. A method `begin(task)` is called instead of `reset`, with a
            `Task`.
            Or a class (any function without arguments) that creates such an object: it is called once for each session.
            Or an object with `card`, `new_state(goal, seed)` and `act_batch(observations, states)`, which all sessions
            share: `new_state` returns the state of a new episode, and `act_batch` changes the states and returns a list
            with an answer for each observation. It must keep everything about an episode in its state.
        host: address to listen on; an address other than loopback needs a token.
        port: TCP port; 0 for any free port.
        token: token that clients must send; None for $VSNBENCH_TOKEN.
        certificate: PEM file of a certificate; the address is then wss://.
        key: PEM file of the certificate's key.
        unix_path: socket file to listen on instead of host and port.
        ready: called with the port (0 for a socket file) as soon as clients can connect.
        sessions: number of clients at a time.
        batch: largest number of observations in a call of `act_batch`. Observations that wait at the same time, with
            images of the same size, are answered together. The last bits of answers then depend on which robots ask at
            the same time, so the card states `deterministic: False`.

    Raises:
        ValueError: the card is invalid, a token is missing, or the policy cannot serve this number of sessions.
    """
    token = os.environ.get(TOKEN_VARIABLE, "") if token is None else token
    model, waiting = _Model(policy, sessions, batch), _WaitingClients()
    if unix_path is None and not token and not is_loopback(host):
        raise ValueError(f"listening on {host} without a token would let everyone use the model: set {TOKEN_VARIABLE}")

    def handle(connection: Any) -> None:
        try:
            _handle_client(connection, model, token, waiting)
        except Exception:
            logger.exception("the connection to a client failed")

    options: dict[str, Any] = {
        "compression": None,
        "max_size": MAX_MESSAGE_BYTES,
        "open_timeout": _HANDSHAKE_SECONDS,
        "close_timeout": 2.0,
        "logger": _transport_logger,
        "origins": [None],  # pages in a browser state their origin, and none of them may use the model
    }
    if certificate:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(certificate, key)
        name = "ssl" if "ssl" in inspect.signature(_serve).parameters else "ssl_context"
        options[name] = context
    if unix_path:
        server = _unix_serve(handle, sock=_listening_at(unix_path), **options)
    else:
        server = _serve(handle, host, port, **options)
        server.handler = waiting.bounding(server.handler)
    with server, model:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, lambda *_: threading.Thread(target=server.shutdown, daemon=True).start())
        bound = 0 if unix_path else server.socket.getsockname()[1]
        if ready is not None:
            ready(bound)
        address = unix_path or "{}://{}:{}".format("wss" if certificate else "ws", host, bound)
        several = f" for {sessions} sessions" if sessions > 1 else ""
        logger.warning("%s listens at %s%s", model.card["name"], address, several)
        server.serve_forever()


class _WaitingClients:
    """The TCP connections without a session; beyond SPARE_CONNECTIONS the oldest is closed."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._sockets: dict[int, socket.socket] = {}
        """Thread -> duplicate of its socket, oldest first: TLS takes the original over."""

    def bounding(self, handle_client: Callable[[Any, Any], None]) -> Callable[[Any, Any], None]:
        """Return a handler of TCP connections, each of which is called in a thread of its own."""

        def handle(client: socket.socket, address: Any) -> None:
            with self._lock:
                while len(self._sockets) >= SPARE_CONNECTIONS:
                    _close(self._sockets.pop(next(iter(self._sockets))))
                self._sockets[threading.get_ident()] = client.dup()
            try:
                handle_client(client, address)
            finally:
                self.remove()

        return handle

    def remove(self) -> None:
        """Stop counting the connection of this thread: it has a session, or has ended."""
        with self._lock:
            duplicate = self._sockets.pop(threading.get_ident(), None)
        if duplicate is not None:
            duplicate.close()


def _close(client: socket.socket) -> None:
    """End a connection that another thread is reading."""
    try:
        client.shutdown(socket.SHUT_RDWR)
    except OSError:
        logger.debug("the client had disconnected")
    client.close()


def _listening_at(path: str) -> socket.socket:
    """Return a listening socket. Its file appears only when clients can connect."""
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(path + ".new")
    listener.listen()
    Path(path + ".new").rename(path)
    return listener


class _Session:
    """What the model remembers of a client: an object of its own, or the state of its episode."""

    def __init__(self, policy: Any) -> None:
        self.policy = policy
        self.state: Any = None
        self.random: Any = None


class _Request:
    """A `reset` or `act` of a session that waits for the model."""

    def __init__(self, session: _Session, call: Callable[[], Any] | None, observation: Any, connection: Any) -> None:
        self.session, self.call, self.observation, self.connection = session, call, observation, connection
        self.answer: Any = None
        self.error: BaseException | None = None
        self.seconds = self.waited = 0.0
        self.together = 1
        self.arrived_s = time.perf_counter()
        self.done = threading.Event()

    @property
    def is_wanted(self) -> bool:
        """Whether the client still waits for the answer."""
        return int(self.connection.protocol.state) == _OPEN

    def fits(self, other: "_Request") -> bool:
        """Whether the other observation can be answered in the same call: its images and arrays have the same shape."""
        if other.call is not None or not other.is_wanted:
            return False
        mine, theirs = self.observation, other.observation
        pairs = [(mine.rgb, theirs.rgb), (mine.depth_m, theirs.depth_m)]
        pairs += [(mine.arrays.get(name), theirs.arrays.get(name)) for name in {**mine.arrays, **theirs.arrays}]
        return all(np.shape(one) == np.shape(another) for one, another in pairs)


class _Model:
    """Calls the policy for all sessions, in one thread; a context manager that ends the thread."""

    def __init__(self, policy: Any, sessions: int, batch: int) -> None:
        """Create the policy's objects. Raises ValueError if it cannot serve this number."""
        if not 1 <= sessions <= MAX_SESSIONS or batch < 1:
            raise ValueError(f"sessions must be 1 to {MAX_SESSIONS}, and batch at least 1")
        creates = not any(hasattr(policy, name) for name in ("act", "act_batch")) or inspect.isclass(policy)
        first = policy() if creates else policy
        self.batches = callable(getattr(first, "act_batch", None))
        if self.batches and not callable(getattr(first, "new_state", None)):
            raise ValueError("a policy with act_batch(observations, states) needs new_state(goal, seed)")
        if batch > 1 and not self.batches:
            raise ValueError(f"batch {batch} needs a policy with act_batch(observations, states)")
        if sessions > 1 and not creates and not self.batches:
            raise ValueError(
                f"{sessions} sessions need a class, which is created once for each, or act_batch(observations, states)"
            )
        self.batch, self.sessions = batch, sessions
        self.card = checked_card(first)
        if self.batches and "sequence" in self.card["goal_kinds"]:
            raise ValueError("a policy with act_batch begins again at each goal: leave sequence out of goal_kinds")
        if batch > 1:
            self.card["deterministic"] = False
            self.card["runs_on"]["batch"] = batch
        others = [first if self.batches else policy() for _ in range(sessions - 1)]
        self._free = [_Session(created) for created in (first, *others)]
        self._lock = threading.Lock()
        self._waiting: queue.Queue[_Request | None] = queue.Queue()
        self._thread = threading.Thread(target=self._run, name="model", daemon=True)

    def __enter__(self) -> "_Model":  # noqa: PYI034 - Self needs Python 3.11
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._waiting.put(None)

    def take_session(self) -> _Session | None:
        """Return a free session, or None."""
        with self._lock:
            return self._free.pop() if self._free else None

    def give_back(self, session: _Session) -> None:
        """Make a session free for another client."""
        session.state = None
        with self._lock:
            self._free.append(session)

    def begin(self, session: _Session, message: dict[str, Any], connection: Any) -> _Request:
        """Start an episode: `begin(task)` if the client sent a task and the policy takes it, otherwise `reset`."""
        goal, seed = Goal.of(message), _field(message, "seed", int)
        task, policy = Task.of(goal, seed, message.get("task")), session.policy

        def call() -> None:
            if self.batches:
                session.state = policy.new_state(goal, seed)
            elif task is not None and callable(getattr(policy, "begin", None)):
                policy.begin(task)
            else:
                policy.reset(goal, seed)

        return self._asked(_Request(session, call, None, connection))

    def next_goal(self, session: _Session, message: dict[str, Any], connection: Any) -> _Request:
        """Give the next goal of a sequence to a policy that keeps its memory."""
        goal = Goal.of(message)
        return self._asked(_Request(session, lambda: session.policy.next_goal(goal), None, connection))

    def act(self, session: _Session, message: dict[str, Any], connection: Any) -> _Request:
        """Return the request with the policy's answer to an observation."""
        observation = observation_of(message)
        call = None if self.batches else lambda: session.policy.act(observation)
        return self._asked(_Request(session, call, observation, connection))

    def _asked(self, request: _Request) -> _Request:
        self._waiting.put(request)
        while not request.done.wait(1.0):
            if not self._thread.is_alive():  # the server ends
                raise ConnectionClosed(None, None)
        return request

    def _run(self) -> None:
        """Answer requests in the order of their arrival until the server ends."""
        later: list[_Request | None] = []
        while True:
            request = later.pop(0) if later else self._waiting.get()
            if request is None:
                return
            together = [request]
            if request.call is None and self.batch > 1:
                while not self._waiting.empty():
                    later.append(self._waiting.get())
                fitting = [other for other in later if other and request.fits(other)]
                together += fitting[: self.batch - 1]
                later = [other for other in later if other not in together]
            self._answer(together)

    def _answer(self, requests: list[_Request]) -> None:
        start_s = time.perf_counter()
        first = requests[0]
        try:
            if not first.is_wanted:
                raise ConnectionClosed(None, None)
            if first.call is None:
                self._act_together(requests)
            elif self.sessions == 1 or self.batches:
                first.answer = first.call()
            else:
                _restore_random(first.session.random)
                try:
                    first.answer = first.call()
                finally:
                    first.session.random = _random_states()
        except BaseException as error:  # SystemExit too: the server continues
            for request in requests:
                request.error = error
        for request in requests:
            request.seconds, request.together = time.perf_counter() - start_s, len(requests)
            request.waited = start_s - request.arrived_s
            request.done.set()

    def _act_together(self, requests: list[_Request]) -> None:
        states = [request.session.state for request in requests]
        answers = requests[0].session.policy.act_batch([request.observation for request in requests], states)
        if not isinstance(answers, (list, tuple)) or len(answers) != len(requests):
            found = f"{len(answers)} answers" if isinstance(answers, (list, tuple)) else type(answers).__name__
            raise WireError(f"act_batch returned {found} to {len(requests)} observations")
        for number, request in enumerate(requests):
            request.answer = answers[number]
            if isinstance(request.answer, Exception):
                request.error = request.answer


def _random_states() -> list[Any]:
    """Return the states of the global random number generators."""
    found: list[Any] = [random.getstate(), np.random.get_state()]  # noqa: NPY002 - models draw from the global one
    torch: Any = sys.modules.get("torch")
    if hasattr(torch, "get_rng_state"):
        found.append(torch.get_rng_state())
        if torch.cuda.is_initialized():
            found.append(torch.cuda.get_rng_state_all())
    return found


def _restore_random(states: list[Any] | None) -> None:
    """Restore the global generators as a session left them, so that sessions do not change each other's draws."""
    setters: list[Any] = [random.setstate, np.random.set_state]
    torch: Any = sys.modules.get("torch")
    if hasattr(torch, "set_rng_state"):
        setters += [torch.set_rng_state, torch.cuda.set_rng_state_all]
    for number, state in enumerate(states or ()):
        setters[number](state)


def checked_card(policy: Any) -> dict[str, Any]:
    """Return the policy's card as a message.

    Raises:
        ValueError: the card has no name, or an unknown sensor or field.
    """
    given = getattr(policy, "card", None)
    if not isinstance(given, dict):
        names = [name for name in _CARD_FIELDS if name not in ("code", "files")]
        given = {name: getattr(given, name) for name in names if hasattr(given, name)}
    name = given.get("name")
    if not isinstance(name, str) or not name.strip():
        raise ValueError("the model's card needs a name: card = {'name': 'mymodel', 'sensors': ['rgb']}")
    _known(given, _CARD_FIELDS, "fields on the card")
    if "sequence" in map(_value, given.get("goal_kinds") or ()) and not callable(getattr(policy, "next_goal", None)):
        raise ValueError("goal_kinds has sequence, so the model keeps its memory: it needs a method next_goal(goal)")
    goals = given.get("goals")
    own_process = {"host": platform.node(), "python": platform.python_version()}
    return {
        "name": name,
        "goals": None if goals is None else sorted(str(goal) for goal in goals),
        "sensors": sorted(map(_value, given.get("sensors") or ())),  # vsnbench checks the names
        "weights_sha256": str(given.get("weights_sha256") or ""),
        "weights_label": str(given.get("weights_label") or ""),
        "settings": plain(dict(given.get("settings") or {})),
        "deterministic": bool(given.get("deterministic", True)),
        "stand_in": bool(given.get("stand_in", False)),
        "code": plain(dict(code_of(policy) if given.get("code") is None else given["code"])),
        "files": plain(dict(given.get("files") or {})),
        "runs_on": dict(own_process, **plain(dict(given.get("runs_on") or {}))),
        "action_kinds": sorted(map(_value, given.get("action_kinds") or ("discrete",))),  # vsnbench checks the names
        "goal_kinds": _known(given.get("goal_kinds") or ("category",), GOAL_KINDS, "goal kinds"),
        "action_map": _action_map(given.get("action_map")),
        **{name: float(given[name]) for name in ("forward_m", "turn_deg") if given.get(name) is not None},
        **({} if given.get("camera") is None else {"camera": plain(_camera(given["camera"]))}),
        **_anchor(given.get("anchor")),
        **_history(given.get("history") or 0),
        **({"cameras": _known(given["cameras"], CAMERA_ROLES, "cameras")} if given.get("cameras") else {}),
    }


_CARD_FIELDS = (
    *("name", "goals", "sensors", "weights_sha256", "weights_label", "settings", "deterministic", "stand_in"),
    *("code", "files", "runs_on", "action_kinds", "goal_kinds", "action_map", "forward_m", "turn_deg", "camera"),
    *("anchor", "history", "cameras"),
)


def _anchor(given: Any) -> dict[str, str]:
    """Return the anchor of a card where it is not the default."""
    anchor = _known([given or "capture"], ("capture", "arrival"), "anchors")[0]
    return {} if anchor == "capture" else {"anchor": anchor}


def _history(given: Any) -> dict[str, int]:
    """Return the length of the history of a card that asks for one."""
    if isinstance(given, bool) or not isinstance(given, int) or not 0 <= given <= MAX_HISTORY:
        raise ValueError(f"history must be a number of observations from 0 to {MAX_HISTORY}")
    return {"history": given} if given else {}


def _camera(given: Any) -> Any:
    """Return the camera of a card: a mapping, or an object of vsnbench."""
    return given if isinstance(given, dict) else given.model_dump(mode="json", exclude_none=True)


def _known(given: Iterable[Any], known: Iterable[str], what: str) -> list[str]:
    """Return sorted names. Raises ValueError if one of them is not known."""
    names = sorted(map(_value, given))
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError("unknown {}: {}; known: {}".format(what, ", ".join(unknown), ", ".join(known)))
    return names


def _value(item: Any) -> str:
    return str(getattr(item, "value", item))


def _action_map(given: Any) -> dict[str, str]:
    mapped = {str(action): str(replaced) for action, replaced in dict(given or {}).items()}
    if not set(mapped) <= set(TILTS) or not set(mapped.values()) <= set(ACTIONS) - {"STOP"}:
        raise ValueError("action_map must map LOOK_UP and LOOK_DOWN to other actions: {'LOOK_UP': 'NOOP'}")
    return mapped


def code_of(policy: Any) -> dict[str, str]:
    """Return the identity of the policy's source: its class, the hash of its modules, its package's version.

    The modules are the loaded ones of the class's package, or for a single module those in its directory.
    """
    kind = type(policy.agent if isinstance(policy, HabitatAgent) else policy)
    own = _file_of(sys.modules.get(kind.__module__))
    found = {"class": f"{kind.__module__}:{kind.__qualname__}"}
    if own is None:
        return found
    if kind.__module__ == "__main__":
        return {"class": f"{own.stem}:{kind.__qualname__}", "sha256": _hash_of([(own.stem, own)])}
    top = kind.__module__.partition(".")[0]
    installed = any(part in ("site-packages", "dist-packages") for part in own.parts)
    single = not installed and not hasattr(sys.modules.get(top), "__path__")
    files = []
    for name, module in list(sys.modules.items()):
        file = None if name in ("__main__", "vsnbench_policy") else _file_of(module)
        if file is not None and (name.partition(".")[0] == top or (single and file.parent == own.parent)):
            files.append((name, file))
    found["sha256"] = _hash_of(sorted(files))
    version = _version_of(top)
    return dict(found, version=version) if version else found


def _version_of(package: str) -> str:
    """Return the version of the installed distribution that has this top-level package, or an empty string.

    A tenth of the time of `importlib.metadata.packages_distributions`, which splits every path of every distribution.
    """
    try:
        metadata = importlib.import_module("importlib.metadata")
    except ImportError:  # older Python
        return ""
    listed = re.compile(r"^{}(/[^,\n]*)?\.py,".format(re.escape(package)), re.MULTILINE)
    for distribution in metadata.distributions():
        declared = distribution.read_text("top_level.txt")
        if package in declared.split() if declared else listed.search(distribution.read_text("RECORD") or ""):
            return str(distribution.version)
    return ""


def _file_of(module: Any) -> Path | None:
    file = getattr(module, "__file__", None)
    return Path(file) if isinstance(file, str) and Path(file).is_file() else None


def _hash_of(files: list[tuple[str, Path]]) -> str:
    digest = hashlib.sha256()
    for name, file in files:
        digest.update("{}\0{}\n".format(name, hashlib.sha256(file.read_bytes()).hexdigest()).encode())
    return digest.hexdigest()


def plain(value: Any, depth: int = 0) -> Any:
    """Convert a value to None, bool, int, float, str, bytes, list and dict with str keys.

    Raises:
        WireError: the value contains another type, or is nested deeper than 32 levels.
    """
    if depth > 32:
        raise WireError("the answer is nested deeper than 32 levels")
    if value is None or isinstance(value, (bool, str, bytes)):
        return value
    if isinstance(value, (int, np.integer)):
        number = int(value)
        if not -(2**63) <= number < 2**63:
            raise WireError("the answer contains an integer of more than 64 bits")
        return number
    if isinstance(value, (float, np.floating)):
        return float(value)
    if isinstance(value, dict):
        return {str(key): plain(item, depth + 1) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item, depth + 1) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist(), depth + 1)
    if hasattr(value, "tolist"):
        return plain(value.tolist(), depth + 1)
    raise WireError(f"the answer contains {type(value).__name__!r}, which cannot be sent")


def pack(message: Any) -> bytes:
    """Return a message as bytes."""
    content: bytes = msgpack.packb(message, use_bin_type=True)
    return content


def unpack(content: Any) -> dict[str, Any]:
    """Decode a message: a dict with a `type`.

    Raises:
        WireError: the content is not a message.
    """
    if not isinstance(content, (bytes, bytearray)):
        raise WireError("a text message; every message is binary")
    size = len(content)
    try:
        message = msgpack.unpackb(
            content,
            raw=False,
            strict_map_key=True,
            ext_hook=_no_extension,
            max_str_len=size,
            max_bin_len=size,
            max_array_len=min(size, 2**20),
            max_map_len=min(size, 2**16),
            max_ext_len=0,
        )
    except WireError:
        raise
    except Exception as error:
        raise WireError(f"invalid msgpack: {type(error).__name__}") from error
    if not isinstance(message, dict) or not isinstance(message.get("type"), str):
        raise WireError("a message must be a mapping with a `type`")
    return message


def _no_extension(code: int, _data: bytes) -> Any:
    raise WireError(f"extension type {code} is not in the protocol")


def _handle_client(connection: Any, model: _Model, token: str, waiting: _WaitingClients) -> None:
    """Answer a client until it disconnects. Invalid messages do not stop the server."""
    try:
        hello = _first_message(connection)
        version = _common_version(hello)
        problem, session = _problem_with(hello, token, version), None
        if problem is None:
            session = model.take_session()
        if session is None:
            several = f"all {model.sessions} sessions of the model are in use"
            busy = "another client is using the model" if model.sessions == 1 else several
            code, text = problem or ("busy", busy)
            connection.send(pack({"type": "error", "code": code, "message": text}))
            return
        waiting.remove()
        try:
            greeting = {"type": "card", "wire": version, "card": model.card, "jpeg": _can_decode_jpeg()}
            connection.send(pack(dict(greeting, sessions=model.sessions)))
            _answer_until_bye(connection, model, session)
        finally:
            model.give_back(session)
    except ConnectionClosed:
        pass
    except TimeoutError:
        logger.warning("a client sent no hello within %.0f s", _HELLO_SECONDS)
    except (WireError, OSError) as error:
        logger.warning("a client was refused: %s", error)
        try:
            connection.send(pack({"type": "error", "code": "protocol", "message": str(error)}))
        except Exception:
            logger.debug("the client had disconnected")


def _first_message(connection: Any) -> dict[str, Any]:
    content = connection.recv(timeout=_HELLO_SECONDS)
    if len(content) > _HELLO_BYTES:
        raise WireError(f"a hello of {len(content)} bytes")
    return unpack(content)


def _common_version(hello: dict[str, Any]) -> int:
    """Return the highest version that both sides know, or 0. Without `newest_wire` the client knows `wire` alone."""
    oldest: Any = hello.get("wire")
    newest: Any = hello.get("newest_wire", oldest)
    if any(isinstance(version, bool) or not isinstance(version, int) for version in (oldest, newest)):
        return 0
    version = int(min(newest, WIRE_VERSION))
    return version if version >= max(oldest, OLDEST_WIRE_VERSION) else 0


def _problem_with(hello: dict[str, Any], token: str, version: int) -> tuple[str, str] | None:
    if hello.get("type") != "hello":
        return ("protocol", "the first message must be hello")
    if not version:
        return (
            "version",
            "this model uses versions {} to {} of the protocol, the client {!r:.20}".format(
                OLDEST_WIRE_VERSION, WIRE_VERSION, hello.get("wire")
            ),
        )
    given = hello.get("token", "")
    if token and not (isinstance(given, str) and hmac.compare_digest(given.encode(), token.encode())):
        return ("token", "wrong token")
    return None


def _answer_until_bye(connection: Any, model: _Model, session: _Session) -> None:
    while True:
        message = unpack(connection.recv())
        kind, number = message["type"], message.get("seq")
        if kind == "bye":
            return
        if isinstance(number, bool) or not isinstance(number, int):
            raise WireError(f"{kind!r:.20} without a `seq`")
        try:
            calls = {"reset": model.begin, "next_goal": model.next_goal, "act": model.act}
            if kind not in calls:
                raise WireError(f"no message {kind!r:.20} in the protocol")
            request = calls[kind](session, message, connection)
            if request.error is not None:
                raise request.error
            answer: dict[str, Any] = decision_of(request.answer) if kind == "act" else {}
            answer["type"] = "decision" if kind == "act" else "ready"
            answer.update(seq=number, seconds=request.seconds, queued=request.waited, batch=request.together)
            connection.send(pack(answer))
        except ConnectionClosed:
            raise
        except WireError as error:
            connection.send(pack(_failure(number, "protocol", error)))
        except BaseException as error:  # SystemExit too: the server continues
            failure = _failure(number, "model", error)
            logger.error("the model failed in %s\n%s", kind, failure["traceback"])
            connection.send(pack(failure))


def _failure(number: int, code: str, error: BaseException) -> dict[str, Any]:
    name = type(error).__name__
    text = _text_of(lambda: f"{name}: {error}"[:2000]) or f"{name} (its message cannot be read)"
    lines = _text_of(lambda: "".join(traceback.format_exception(type(error), error, error.__traceback__))[-20000:])
    lines = lines if code == "model" else ""
    return {
        "type": "error",
        "seq": number,
        "code": code,
        "message": text.encode("utf-8", "replace").decode(),
        "traceback": lines.encode("utf-8", "replace").decode(),
    }


def _text_of(make: Callable[[], str]) -> str:
    """Return a text that model code creates, or an empty string if that fails or takes too long."""
    texts: list[str] = []

    def call() -> None:
        try:
            texts.append(make())
        except BaseException:
            texts.append("")

    thread = threading.Thread(target=call, daemon=True)
    try:
        thread.start()
    except (RuntimeError, MemoryError):  # no memory for a thread
        call()
    else:
        thread.join(_TEXT_SECONDS)
    return texts[0] if texts else ""


def _field(message: dict[str, Any], name: str, kind: type) -> Any:
    value = message.get(name)
    if not isinstance(value, kind) or isinstance(value, bool):
        raise WireError("{} needs `{}`, {}".format(message["type"], name, kind.__name__))
    return value


def observation_of(message: dict[str, Any]) -> Observation:
    """Return the observation of an `act` message.

    Raises:
        WireError: the message is invalid.
    """
    pose = message.get("pose")
    if pose is not None:
        if not isinstance(pose, list) or len(pose) != 3 or not all(_is_finite(number) for number in pose):
            raise WireError("`pose` must be [x_m, y_m, heading_rad]")
        pose = Pose(*pose)
    camera = message.get("camera")
    if not isinstance(camera, dict):
        raise WireError("`camera` must be a mapping")
    stamp_s: Any = message.get("stamp_s")
    if not _is_finite(stamp_s):
        raise WireError("`stamp_s` must be a number")
    rgb, depth, history = message.get("rgb"), message.get("depth"), message.get("history") or []
    further = message.get("cameras") or {}
    if not isinstance(further, dict) or not all(
        role in CAMERA_ROLES and isinstance(view, dict) for role, view in further.items()
    ):
        raise WireError("`cameras` must be a mapping of {} to observations".format(", ".join(CAMERA_ROLES)))
    if (
        not isinstance(history, list)
        or len(history) > MAX_HISTORY
        or not all(isinstance(earlier, dict) for earlier in history)
    ):
        raise WireError(f"`history` must be an array of at most {MAX_HISTORY} mappings")
    budget = message.get("budget")
    if budget is not None and (not isinstance(budget, dict) or set(budget) != set(_BUDGET)):
        raise WireError("`budget` must be a mapping with {}".format(", ".join(_BUDGET)))
    return Observation(
        rgb=None if rgb is None else _rgb_of(rgb),
        depth_m=None if depth is None else _depth_of(depth),
        pose=pose,
        stamp_s=float(stamp_s),
        camera=Camera(camera),
        beyond_range=None if depth is None else _beyond_range_of(depth),
        budget=budget,
        history=tuple(observation_of(dict(earlier, camera=camera, history=None)) for earlier in history),
        cameras={role: observation_of(dict(view, cameras=None, history=None)) for role, view in further.items()},
        arrays=_arrays_of(message.get("arrays") or {}),
    )


def _is_finite(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _image(image: Any, name: str) -> tuple[Any, int, int, bytes]:
    """Return encoding, height, width and bytes of an image in a message."""
    if not isinstance(image, dict):
        raise WireError(f"`{name}` must be a mapping")
    size: list[Any] = [image.get("height"), image.get("width")]
    for number in size:
        if isinstance(number, bool) or not isinstance(number, int) or not 0 < number <= 8192:
            raise WireError(f"`{name}` needs `height` and `width` in 1..8192")
    if not isinstance(image.get("data"), bytes):
        raise WireError(f"`{name}` needs `data`, bytes")
    return image.get("encoding"), size[0], size[1], image["data"]


def _array(data: bytes, kind: Any, shape: tuple[int, ...], name: str) -> Any:
    expected = np.dtype(kind).itemsize
    for length in shape:
        expected *= length
    if len(data) != expected:
        raise WireError(f"`{name}` has {len(data)} bytes instead of {expected}")
    return np.frombuffer(data, kind).reshape(shape)


def _arrays_of(arrays: Any) -> dict[str, Any]:
    """Return the arrays of sensors by attribute; each message names type and shape."""
    if not isinstance(arrays, dict) or len(arrays) > MAX_ARRAYS:
        raise WireError(f"`arrays` must be a mapping of at most {MAX_ARRAYS} arrays")
    found = {}
    for name, array in arrays.items():
        if not isinstance(name, str) or not _ATTRIBUTE.fullmatch(name) or keyword.iskeyword(name):
            raise WireError(f"`arrays` has {name!r:.40}, which cannot be the name of an attribute")
        if not isinstance(array, dict) or array.get("dtype") not in ARRAY_TYPES:
            raise WireError("`arrays.{}` needs `dtype`, one of {}".format(name, ", ".join(ARRAY_TYPES)))
        shape, data = array.get("shape"), array.get("data")
        if not isinstance(shape, list) or not 1 <= len(shape) <= MAX_DIMENSIONS or not all(map(_is_length, shape)):
            raise WireError(f"`arrays.{name}` needs `shape`, 1 to {MAX_DIMENSIONS} lengths")
        if not isinstance(data, bytes):
            raise WireError(f"`arrays.{name}` needs `data`, bytes")
        kind = np.dtype(array["dtype"])
        found[name] = _array(data, kind.newbyteorder("<"), tuple(shape), f"arrays.{name}").astype(kind, copy=False)
    return found


def _is_length(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 < value <= MAX_MESSAGE_BYTES


def _rgb_of(image: Any) -> Any:
    encoding, height, width, data = _image(image, "rgb")
    if encoding == "raw":
        return _array(data, np.uint8, (height, width, 3), "rgb")
    if encoding == "jpeg":
        rgb = _decode_jpeg(data)
        if rgb.shape != (height, width, 3):
            raise WireError(f"`rgb` is declared as {height} x {width} but has shape {rgb.shape}")
        return rgb
    raise WireError(f"`rgb` must be raw or jpeg, not {encoding!r:.20}")


def _depth_of(image: Any) -> Any:
    encoding, height, width, data = _image(image, "depth")
    if encoding == "f32":
        return _array(data, np.dtype("<f4"), (height, width), "depth").astype(np.float32, copy=False)
    if encoding == "mm16":
        millimetres = _array(data, np.dtype("<u2"), (height, width), "depth")
        depth_m = millimetres.astype(np.float32) / np.float32(1000)
        depth_m[millimetres == 0] = np.nan
        return depth_m
    raise WireError(f"`depth` must be f32 or mm16, not {encoding!r:.20}")


def _beyond_range_of(image: Any) -> Any:
    packed = image.get("beyond_range")
    if packed is None:
        return None
    _, height, width, _ = _image(image, "depth")
    if not isinstance(packed, bytes) or len(packed) != (height * width + 7) // 8:
        raise WireError("`beyond_range` must have one bit for each pixel of `depth`")
    bits = np.unpackbits(np.frombuffer(packed, np.uint8))[: height * width]
    return bits.reshape(height, width).astype(bool)


def _can_decode_jpeg() -> bool:
    for name in ("cv2", "PIL.Image"):
        try:
            importlib.import_module(name)
        except ImportError:
            continue
        return True
    return False


def _decode_jpeg(data: bytes) -> Any:
    try:
        import cv2
    except ImportError:
        import io

        from PIL import Image

        try:
            return np.asarray(Image.open(io.BytesIO(data), formats=["JPEG"]).convert("RGB"))
        except Exception as error:
            raise WireError("`rgb` is not a JPEG") from error
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise WireError("`rgb` is not a JPEG")
    return np.ascontiguousarray(image[:, :, ::-1])


def decision_of(answer: Any) -> dict[str, Any]:
    """Return a policy's answer as the fields of a `decision` message.

    Raises:
        WireError: the answer is not a decision.
    """
    given: Any = {"action": answer} if isinstance(answer, str) else answer
    if not isinstance(given, dict):
        if not hasattr(given, "action"):
            raise WireError(f"act returned {answer!r:.80}, which is not an action")
        given = {name: getattr(given, name) for name in ("action", "raw_action", "diagnostics") if hasattr(given, name)}
    action = str(getattr(given.get("action"), "value", given.get("action"))).upper()
    moves = {name: plain(given[name]) for name in ("movement", "parts") if given.get(name) is not None}
    if action not in ACTIONS + TILTS and not moves:
        raise WireError("act returned {!r:.40}; the actions are {}".format(action, ", ".join(ACTIONS)))
    return {
        **moves,
        "action": action,
        "raw_action": str(given.get("raw_action") or action),
        "probabilities": plain(dict(given.get("probabilities") or {})),
        "diagnostics": plain(dict(given.get("diagnostics") or {})),
    }


class HabitatAgent:
    """Any Habitat `Agent` (`reset()`, `act(observations)`) as a policy.

    The agent gets `rgb` (H, W, 3) uint8, `depth` (H, W, 1) float32 normalised to [0, 1], `gps` (2,) float32,
    `compass` (1,) float32 in [-pi, pi], and its goal: `objectgoal` (1,) int64, `imagegoal` (H, W, 3) uint8,
    `instruction`, a dict with `text`, or `pointgoal_with_gps_compass` (2,) float32, the distance in metres and the
    angle to the left in radians. It returns a number of `actions`, the name of an action, or a dict with `action`;
    `action_args` are ignored, because no action here has any.
    """

    DEFAULTS: ClassVar[dict[str, Any]] = {
        "name": "",
        "weights_sha256": "",
        "weights_label": "",
        "sensors": ["rgb", "depth", "odometry"],
        "arguments": {},
        "actions": {"0": "STOP", "1": "MOVE_FORWARD", "2": "TURN_LEFT", "3": "TURN_RIGHT"},
        "goals": {"chair": 0, "bed": 1, "plant": 2, "toilet": 3, "monitor": 4, "sofa": 5},
        "goal": "objectgoal",
        "resize": None,
        "crop": None,
        "intrinsics": False,
        "gps": "forward-right",
        "depth_min_m": 0.5,
        "depth_max_m": 5.0,
        "normalize_depth": True,
        "deterministic": True,
    }
    """Goal ids and action numbers are those of HM3D ObjectNav in habitat-lab. `gps` is habitat's (forward, right) or
    `forward-left`. `actions` can map LOOK_UP and LOOK_DOWN (4, 5) to NOOP or to a movement of the robot. `goal` is
    `objectgoal`, `imagegoal`, `instruction` or `pointgoal_with_gps_compass`. `resize` is the length of the shorter edge
    in pixels or [height, width], by the mean of areas; `crop` is [height, width] of the middle, after that.
    `intrinsics` adds (3, 3) float32 of the resulting images."""
    GOALS: ClassVar[dict[str, list[str]]] = {
        "objectgoal": ["category"],
        "imagegoal": ["image"],
        "instruction": ["instruction", "text"],
        POINT_GOAL: ["point"],
    }
    """Kinds of goals by the name of the agent's observation."""

    def __init__(self, factory: Callable[..., Any], settings: dict[str, Any] | None = None) -> None:
        _known(settings or (), self.DEFAULTS, "settings")
        self.settings = dict(self.DEFAULTS, **(settings or {}))
        if self.settings["gps"] not in ("forward-right", "forward-left"):
            raise ValueError("gps must be forward-right or forward-left")
        if self.settings["goal"] not in self.GOALS:
            raise ValueError("goal must be one of {}".format(", ".join(self.GOALS)))
        _known({str(name).upper() for name in self.settings["actions"].values()}, ACTIONS, "actions")
        self.agent = factory(**self.settings["arguments"])
        self.card = {
            "name": self.settings["name"] or getattr(factory, "__name__", "habitat-agent").lower(),
            "goals": sorted(self.settings["goals"]) if self.settings["goal"] == "objectgoal" else None,
            "goal_kinds": self.GOALS[self.settings["goal"]],
            "sensors": self.settings["sensors"],
            "weights_sha256": self.settings["weights_sha256"],
            "weights_label": self.settings["weights_label"],
            "settings": {name: self.settings[name] for name in self.DEFAULTS if name not in ("name", "sensors")},
            "deterministic": self.settings["deterministic"],
        }
        self._goal: Any = None

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode, and seed the random number generators."""
        if self.settings["goal"] == "imagegoal":
            self._goal, _ = self._framed(goal.image)  # type: ignore[attr-defined]
        elif self.settings["goal"] == POINT_GOAL:
            self._goal = goal.point  # type: ignore[attr-defined]
        elif self.settings["goal"] == "instruction":
            self._goal = {"text": getattr(goal, "text", "") or str(goal)}
        elif goal in self.settings["goals"]:
            self._goal = np.array([self.settings["goals"][goal]], np.int64)
        else:
            raise ValueError(f"the agent does not know {goal}")
        random.seed(seed)
        np.random.seed(seed % 2**32)  # noqa: NPY002 - agents draw from the global generator
        torch = sys.modules.get("torch")
        if torch is not None:
            torch.manual_seed(seed)
        self.agent.reset()

    def act(self, observation: Observation) -> dict[str, Any]:
        """Pass the observation on in Habitat's form and convert the answer."""
        answer = self.agent.act(self.observations(observation))
        details = answer if isinstance(answer, dict) else {"action": answer}
        raw: Any = details.get("action")
        raw = raw.item() if hasattr(raw, "item") else raw
        action = str(self.settings["actions"].get(str(raw), raw)).upper()
        if action not in ACTIONS:
            raise WireError(
                "the agent returned {!r:.40}, which the setting `actions` does not map; to ignore it, write "
                '"actions": {{…, "{:.40}": "NOOP"}}'.format(raw, str(raw))
            )
        return {"action": action, "raw_action": str(raw)}

    def observations(self, observation: Observation) -> dict[str, Any]:
        """Return the observations in Habitat's form."""
        found: dict[str, Any] = {self.settings["goal"]: self._goal}
        corner = np.zeros(2)
        scale = np.ones(2)
        if observation.rgb is not None:
            found["rgb"], (scale, corner) = self._framed(observation.rgb)
        if observation.depth_m is not None:
            depth = self._depth(observation.depth_m, observation.beyond_range)[:, :, None]
            found["depth"], (scale, corner) = self._framed(depth)
        if self.settings["intrinsics"]:
            found["intrinsics"] = _intrinsics(observation.camera, scale, corner)
        if observation.pose is not None:
            right = 1.0 if self.settings["gps"] == "forward-left" else -1.0
            found["gps"] = np.array([observation.pose.x_m, right * observation.pose.y_m], np.float32)
            compass = np.float32(math.remainder(observation.pose.heading_rad, math.tau))
            if self.settings["goal"] == POINT_GOAL:
                found[POINT_GOAL] = _polar(self._goal, observation.pose)
            found["compass"] = np.clip(np.array([compass], np.float32), -_COMPASS_LIMIT, _COMPASS_LIMIT)
        return found

    def _framed(self, image: Any) -> tuple[Any, tuple[Any, Any]]:
        """Return an image resized and cropped as set, and its scale and corner as (rows, columns)."""
        size, resize, crop = np.array(image.shape[:2]), self.settings["resize"], self.settings["crop"]
        target = size
        if resize is not None:
            target = np.array(resize) if isinstance(resize, (list, tuple)) else (size * resize / size.min()).astype(int)
            kind = image.dtype
            for axis in (0, 1):
                image = _area_mean(image, int(target[axis]), axis)
            image = image.astype(kind)
        corner = np.zeros(2, int) if crop is None else target // 2 - np.array(crop) // 2
        if crop is not None:
            if (np.array(crop) > target).any():
                raise ValueError(f"crop {crop} is larger than the image, {target.tolist()}")
            image = image[corner[0] : corner[0] + crop[0], corner[1] : corner[1] + crop[1]]
        return np.ascontiguousarray(image), (target / size, corner)

    def _depth(self, depth_m: Any, beyond_range: Any) -> Any:
        """Return depth in Habitat's form: clipped, the minimum where invalid, the maximum beyond the range."""
        low, high = np.float32(self.settings["depth_min_m"]), np.float32(self.settings["depth_max_m"])
        clipped = np.where(np.isnan(depth_m), low, np.clip(depth_m, low, high)).astype(np.float32)
        if beyond_range is not None:
            clipped[beyond_range] = high
        return (clipped - low) / (high - low) if self.settings["normalize_depth"] else clipped


def _area_mean(image: Any, count: int, axis: int) -> Any:
    """Return an image with another number of pixels along an axis, each the mean of those that it covers.

    As PyTorch's `interpolate(mode="area")`, which habitat-baselines uses; integers are cut off as there.
    """
    length = image.shape[axis]
    if count == length:
        return image
    begin = np.arange(count) * length // count
    end = -(-(np.arange(count) + 1) * length // count)
    rows = np.moveaxis(image, axis, 0).astype(np.float64)
    sums = np.concatenate([np.zeros_like(rows[:1]), np.cumsum(rows, axis=0)])
    widths = (end - begin).reshape(-1, *[1] * (rows.ndim - 1))
    return np.moveaxis((sums[end] - sums[begin]) / widths, 0, axis)


def _polar(point: Any, pose: Pose) -> Any:
    """Return the distance of a point in metres, and its angle to the left of where the robot faces in radians."""
    ahead_m, left_m = point[0] - pose.x_m, point[1] - pose.y_m
    angle_rad = math.remainder(math.atan2(left_m, ahead_m) - pose.heading_rad, math.tau)
    return np.array([math.hypot(ahead_m, left_m), angle_rad], np.float32)


def _intrinsics(camera: Camera, scale: Any, corner: Any) -> Any:
    """Return the matrix of a pinhole camera after resizing and cropping."""
    width, height, fov_deg = camera.width, camera.height, camera.horizontal_fov_deg  # type: ignore[attr-defined]
    focal = width / 2 / math.tan(math.radians(fov_deg) / 2)
    row, column = (height / 2, width / 2) * scale - corner
    return np.array([[focal * scale[1], 0, column], [0, focal * scale[0], row], [0, 0, 1]], np.float32)


def _load(name: str) -> Any:
    module_name, _, attribute = name.partition(":")
    if not attribute:
        raise ValueError(f"{name!r}: write module:Class")
    sys.path.insert(0, str(Path.cwd()))
    found: Any = importlib.import_module(module_name)
    for part in attribute.split("."):
        found = getattr(found, part)
    return found


def _settings_of(text: str) -> dict[str, Any]:
    """Return the settings of a JSON object, or of the file with one."""
    try:
        found = json.loads(text if text.lstrip().startswith("{") else Path(text).read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"--settings {text}: not valid JSON: {error}") from error
    if not isinstance(found, dict):
        raise TypeError(f"--settings {text}: not a JSON object")
    return found


def is_loopback(host: str) -> bool:
    """Return whether a host name or address is a loopback address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def main(arguments: list[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="vsnbench_policy.py", description="Serve a model to vsnbench.")
    parser.add_argument("model", nargs="?", help="module:Class with reset(goal, seed) and act(observation)")
    parser.add_argument("--habitat-agent", metavar="module:Class", help="a Habitat agent instead of a model")
    parser.add_argument(
        "--settings", metavar="JSON", help="keyword arguments or the agent's settings: a JSON object or its file"
    )
    parser.add_argument(
        "--host", default="127.0.0.1", help="address to listen on; one other than loopback needs a token"
    )
    parser.add_argument("--port", type=int, default=8765)
    parser.add_argument(
        "--sessions", type=int, default=1, help="clients at a time; the model is created once for each (default 1)"
    )
    parser.add_argument(
        "--batch", type=int, default=1, help="observations in a call of act_batch; over 1 the last bits may differ"
    )
    parser.add_argument("--unix-path", help="socket file to listen on instead of a port")
    parser.add_argument("--certificate", help="PEM file of a certificate, for wss://")
    parser.add_argument("--key", help="PEM file of the certificate's key")
    chosen = parser.parse_args(arguments)
    if bool(chosen.model) == bool(chosen.habitat_agent):
        parser.error("name a model as module:Class, or an agent with --habitat-agent")
    logging.basicConfig(level=logging.WARNING, format="%(message)s", stream=sys.stderr)
    try:
        settings = _settings_of(chosen.settings) if chosen.settings else {}
        factory = _load(chosen.model or chosen.habitat_agent)
        serve(
            (lambda: HabitatAgent(factory, settings)) if chosen.habitat_agent else (lambda: factory(**settings)),
            host=chosen.host,
            port=chosen.port,
            certificate=chosen.certificate,
            key=chosen.key,
            unix_path=chosen.unix_path,
            sessions=chosen.sessions,
            batch=chosen.batch,
        )
    except (ValueError, OSError, ImportError, AttributeError, TypeError) as error:
        parser.exit(1, f"vsnbench_policy: {type(error).__name__}: {error}\n")


if __name__ == "__main__":
    main()
