"""The model's side of vsnbench's wire, in one file: put it beside your model and serve it.

It needs Python 3.7 or later, numpy, msgpack (1.0 or later) and websockets (11.0 or later), and nothing of vsnbench:

    from vsnbench_policy import serve

    class Spinner:
        card = {"name": "spinner", "sensors": ["rgb"]}

        def reset(self, goal, seed):
            self.turns = 0

        def act(self, observation):          # observation.rgb: (H, W, 3) uint8
            self.turns += 1
            return "STOP" if self.turns > 12 else "TURN_LEFT"

    serve(Spinner(), port=8765)

and on the robot's side `vsnbench run --model ws://this-machine:8765 --goal chair`. From the shell:

    python vsnbench_policy.py mymodel:Spinner --port 8765
    python vsnbench_policy.py --habitat-agent mymodel:Agent --settings agent.json --port 8765

Everything that crosses the wire is in vsnbench's docs/wire.md. Licence: Apache-2.0.
"""

from __future__ import annotations

import argparse
import hashlib
import hmac
import importlib
import inspect
import ipaddress
import json
import logging
import math
import os
import platform
import random
import signal
import socket
import ssl
import sys
import threading
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import msgpack
import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve as _serve

WIRE_VERSION = 1
"""What docs/wire.md describes; both sides must say the same."""
TOKEN_VARIABLE = "VSNBENCH_TOKEN"  # noqa: S105 - the name of a variable
ACTIONS = ("STOP", "MOVE_FORWARD", "MOVE_BACKWARD", "TURN_LEFT", "TURN_RIGHT")
SENSORS = ("rgb", "depth", "odometry")
MAX_MESSAGE_BYTES = 64 * 2**20
"""Room for RGB and float depth of 4096 x 2048; a larger message ends the connection."""
_HELLO_BYTES = 64 * 2**10
_HELLO_SECONDS = 10.0

logger = logging.getLogger("vsnbench_policy")


class WireError(Exception):
    """The other side said something that is not in the protocol."""


class Pose:
    """Where the robot is relative to the start of the episode: x forward, y left, heading counter-clockwise."""

    def __init__(self, x_m: float, y_m: float, heading_rad: float) -> None:
        self.x_m, self.y_m, self.heading_rad = float(x_m), float(y_m), float(heading_rad)


class Camera:
    """The pinhole camera: `width`, `height` in pixels, `horizontal_fov_deg`, mount and depth range in metres."""

    def __init__(self, values: dict[str, Any]) -> None:
        self.__dict__.update(values)


class Observation:
    """What the robot senses before an action; what is not on the model's card is None.

    rgb: (H, W, 3) uint8. depth_m: (H, W) float32 metres along the optical axis, NaN where invalid. pose: Pose.
    stamp_s: seconds on the robot's clock. camera: Camera.
    """

    def __init__(self, rgb: Any, depth_m: Any, pose: Pose | None, stamp_s: float, camera: Camera) -> None:
        self.rgb, self.depth_m, self.pose, self.stamp_s, self.camera = rgb, depth_m, pose, stamp_s, camera


def serve(
    policy: Any,
    host: str = "127.0.0.1",
    port: int = 8765,
    token: str | None = None,
    certificate: str | None = None,
    key: str | None = None,
    unix_path: str | None = None,
    ready: Callable[[int], None] | None = None,
) -> None:
    """Serve a policy until the process is told to end (Ctrl-C or SIGTERM).

    Args:
        policy: an object with `card`, `reset(goal, seed)` and `act(observation)`. `card` is a dict with `name` and, as
            far as they apply, `goals` (list; absent for any), `sensors` (of "rgb", "depth", "odometry"),
            `weights_sha256`, `weights_label`, `settings`, `deterministic` and `runs_on` (device, threads, ...). `act`
            returns the name of an action, or a dict with `action` and, as far as wanted, `raw_action`,
            `probabilities`, `diagnostics`.
        host: address to listen on; another one than loopback needs a token.
        port: TCP port; 0 chooses a free one.
        token: what a client must say; $VSNBENCH_TOKEN when None.
        certificate: PEM file of a certificate: the model is then at wss://.
        key: PEM file of its key.
        unix_path: listen on this socket file in place of host and port.
        ready: called with the port (0 for a socket file) once clients can connect.

    Raises:
        ValueError: the card is not one, or there is no token where one is needed.
    """
    token = os.environ.get(TOKEN_VARIABLE, "") if token is None else token
    card = checked_card(policy)
    if unix_path is None and not token and not is_loopback(host):
        raise ValueError(f"listening on {host} without a token would let anybody use the model: set {TOKEN_VARIABLE}")
    one_client = threading.Lock()

    def handle(connection: Any) -> None:
        _converse(connection, policy, card, token, one_client)

    options: dict[str, Any] = {"compression": None, "max_size": MAX_MESSAGE_BYTES, "close_timeout": 2.0}
    if certificate:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(certificate, key)
        name = "ssl" if "ssl" in inspect.signature(_serve).parameters else "ssl_context"
        options[name] = context
    if unix_path:
        server = _serve(handle, sock=_listening_at(unix_path), **options)
    else:
        server = _serve(handle, host, port, **options)
    with server:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, lambda *_: threading.Thread(target=server.shutdown, daemon=True).start())
        bound = 0 if unix_path else server.socket.getsockname()[1]
        if ready is not None:
            ready(bound)
        where = unix_path or "{}://{}:{}".format("wss" if certificate else "ws", host, bound)
        logger.warning("%s listens at %s", card["name"], where)
        server.serve_forever()


def _listening_at(path: str) -> socket.socket:
    """Return a listening socket; its file is there only once somebody who connects is heard."""
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(path + ".new")
    listener.listen()
    Path(path + ".new").rename(path)
    return listener


def checked_card(policy: Any) -> dict[str, Any]:
    """Return the policy's card as the wire carries it.

    Raises:
        ValueError: it has no name, or a sensor that does not exist.
    """
    given = getattr(policy, "card", None)
    if not isinstance(given, dict):
        said = [name for name in _CARD_FIELDS if name not in ("code", "files")]
        given = {name: getattr(given, name) for name in said if hasattr(given, name)}
    name = given.get("name")
    if not isinstance(name, str) or not name.strip():
        raise ValueError("the model's card needs a name: card = {'name': 'mymodel', 'sensors': ['rgb']}")
    unknown = sorted(set(given) - set(_CARD_FIELDS))
    if unknown:
        raise ValueError("the card has {}; it can have {}".format(", ".join(unknown), ", ".join(_CARD_FIELDS)))
    sensors = sorted(str(getattr(sensor, "value", sensor)) for sensor in given.get("sensors") or ())
    strange = [sensor for sensor in sensors if sensor not in SENSORS]
    if strange:
        raise ValueError("no sensor {}: there are {}".format(", ".join(strange), ", ".join(SENSORS)))
    goals = given.get("goals")
    return {
        "name": name,
        "goals": None if goals is None else sorted(str(goal) for goal in goals),
        "sensors": sensors,
        "weights_sha256": str(given.get("weights_sha256") or ""),
        "weights_label": str(given.get("weights_label") or ""),
        "settings": plain(dict(given.get("settings") or {})),
        "deterministic": bool(given.get("deterministic", True)),
        "stand_in": bool(given.get("stand_in", False)),
        "code": plain(dict(code_of(policy) if given.get("code") is None else given["code"])),
        "files": plain(dict(given.get("files") or {})),
        "runs_on": dict(_this_process(), **plain(dict(given.get("runs_on") or {}))),
    }


_CARD_FIELDS = (
    *("name", "goals", "sensors", "weights_sha256", "weights_label", "settings", "deterministic", "stand_in"),
    *("code", "files", "runs_on"),
)


def code_of(policy: Any) -> dict[str, str]:
    """Return what tells the policy's source from another: its class, the hash of its modules, its package's version.

    The modules are those of its own package, or beside its own file, that are loaded by now.
    """
    made = type(policy.agent if isinstance(policy, HabitatAgent) else policy)
    own = _file_of(sys.modules.get(made.__module__))
    found = {"class": f"{made.__module__}:{made.__qualname__}"}
    if own is None:
        return found
    if made.__module__ == "__main__":
        return {"class": f"{own.stem}:{made.__qualname__}", "sha256": _hash_of([(own.stem, own)])}
    top = made.__module__.partition(".")[0]
    installed = any(part in ("site-packages", "dist-packages") for part in own.parts)
    alone = not installed and not hasattr(sys.modules.get(top), "__path__")
    files = []
    for name, module in list(sys.modules.items()):
        file = None if name in ("__main__", "vsnbench_policy") else _file_of(module)
        if file is not None and (name.partition(".")[0] == top or (alone and file.parent == own.parent)):
            files.append((name, file))
    found["sha256"] = _hash_of(sorted(files))
    version = _version_of(top)
    return dict(found, version=version) if version else found


def _version_of(package: str) -> str:
    try:
        metadata = importlib.import_module("importlib.metadata")
        names = metadata.packages_distributions().get(package, ())
    except (ImportError, AttributeError):  # an older Python cannot tell
        return ""
    return str(metadata.version(names[0])) if names else ""


def _file_of(module: Any) -> Path | None:
    file = getattr(module, "__file__", None)
    return Path(file) if isinstance(file, str) and Path(file).is_file() else None


def _hash_of(files: list[tuple[str, Path]]) -> str:
    digest = hashlib.sha256()
    for name, file in files:
        digest.update("{}\0{}\n".format(name, hashlib.sha256(file.read_bytes()).hexdigest()).encode())
    return digest.hexdigest()


def _this_process() -> dict[str, Any]:
    return {"host": platform.node(), "python": platform.python_version()}


def plain(value: Any, depth: int = 0) -> Any:
    """Return a value made of what the wire carries: None, bool, int, float, str, bytes, list, dict with str keys.

    Raises:
        WireError: it holds something else, or nests deeper than 32.
    """
    if depth > 32:
        raise WireError("the answer nests deeper than 32")
    if value is None or isinstance(value, (bool, str, bytes)):
        return value
    if isinstance(value, (int, np.integer)):
        number = int(value)
        if not -(2**63) <= number < 2**63:
            raise WireError("the answer holds an integer of more than 64 bits")
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
    raise WireError(f"the answer holds {type(value).__name__!r}, which the wire cannot carry")


def pack(message: Any) -> bytes:
    """Return a message as bytes."""
    content: bytes = msgpack.packb(message, use_bin_type=True)
    return content


def unpack(content: Any) -> dict[str, Any]:
    """Return a message from bytes: a dict with a `type`.

    Raises:
        WireError: it is not one.
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
        raise WireError(f"no msgpack message: {type(error).__name__}") from error
    if not isinstance(message, dict) or not isinstance(message.get("type"), str):
        raise WireError("a message must be a map with a `type`")
    return message


def _no_extension(code: int, _data: bytes) -> Any:
    raise WireError(f"extension type {code} is not in the protocol")


def _converse(connection: Any, policy: Any, card: dict[str, Any], token: str, one_client: Any) -> None:
    """Answer one client until it leaves; whatever it sends, the server goes on."""
    try:
        hello = _first_message(connection)
        problem = _problem_with(hello, token)
        if problem is None and not one_client.acquire(blocking=False):
            problem = ("busy", "another client is using the model")
        if problem is not None:
            connection.send(pack({"type": "error", "code": problem[0], "message": problem[1]}))
            return
        try:
            connection.send(pack({"type": "card", "wire": WIRE_VERSION, "card": card, "jpeg": _can_decode_jpeg()}))
            _answer_until_bye(connection, policy)
        finally:
            one_client.release()
    except ConnectionClosed:
        pass
    except TimeoutError:
        logger.warning("a client said no hello within %.0f s", _HELLO_SECONDS)
    except (WireError, OSError) as error:
        logger.warning("a client was turned away: %s", error)
        try:
            connection.send(pack({"type": "error", "code": "protocol", "message": str(error)}))
        except Exception:
            logger.debug("and had gone by then")


def _first_message(connection: Any) -> dict[str, Any]:
    content = connection.recv(timeout=_HELLO_SECONDS)
    if len(content) > _HELLO_BYTES:
        raise WireError(f"a hello of {len(content)} bytes")
    return unpack(content)


def _problem_with(hello: dict[str, Any], token: str) -> tuple[str, str] | None:
    if hello.get("type") != "hello":
        return ("protocol", "the first message must be hello")
    if hello.get("wire") != WIRE_VERSION:
        return (
            "version",
            "this model speaks version {} of the wire, you {!r:.20}".format(WIRE_VERSION, hello.get("wire")),
        )
    said = hello.get("token", "")
    if token and not (isinstance(said, str) and hmac.compare_digest(said.encode(), token.encode())):
        return ("token", "wrong token")
    return None


def _answer_until_bye(connection: Any, policy: Any) -> None:
    while True:
        message = unpack(connection.recv())
        kind, number = message["type"], message.get("seq")
        if kind == "bye":
            return
        if isinstance(number, bool) or not isinstance(number, int):
            raise WireError(f"{kind!r:.20} without a `seq`")
        began = time.perf_counter()
        try:
            if kind == "reset":
                answer: dict[str, Any] = {"type": "ready"}
                policy.reset(_field(message, "goal", str), _field(message, "seed", int))
            elif kind == "act":
                answer = decision_of(policy.act(observation_of(message)))
                answer["type"] = "decision"
            else:
                raise WireError(f"no message {kind!r:.20} in the protocol")
            answer["seconds"] = time.perf_counter() - began
            answer["seq"] = number
            connection.send(pack(answer))
        except ConnectionClosed:
            raise
        except WireError as error:
            connection.send(pack(_failure(number, "protocol", error)))
        except Exception as error:
            logger.exception("the model failed in %s", kind)
            connection.send(pack(_failure(number, "model", error)))


def _failure(number: int, code: str, error: Exception) -> dict[str, Any]:
    try:
        words = f"{type(error).__name__}: {error}"[:2000]
    except Exception:
        words = type(error).__name__
    lines = traceback.format_exc()[-20000:] if code == "model" else ""
    return {
        "type": "error",
        "seq": number,
        "code": code,
        "message": words.encode("utf-8", "replace").decode(),
        "traceback": lines.encode("utf-8", "replace").decode(),
    }


def _field(message: dict[str, Any], name: str, kind: type) -> Any:
    value = message.get(name)
    if not isinstance(value, kind) or isinstance(value, bool):
        raise WireError("{} needs `{}`, {}".format(message["type"], name, kind.__name__))
    return value


def observation_of(message: dict[str, Any]) -> Observation:
    """Return the observation of an `act` message.

    Raises:
        WireError: it is malformed.
    """
    pose = message.get("pose")
    if pose is not None:
        if not isinstance(pose, list) or len(pose) != 3 or not all(_is_finite(number) for number in pose):
            raise WireError("`pose` must be [x_m, y_m, heading_rad]")
        pose = Pose(*pose)
    camera = message.get("camera")
    if not isinstance(camera, dict):
        raise WireError("`camera` must be a map")
    stamp_s: Any = message.get("stamp_s")
    if not _is_finite(stamp_s):
        raise WireError("`stamp_s` must be a number")
    rgb, depth_m = message.get("rgb"), message.get("depth")
    return Observation(
        rgb=None if rgb is None else _rgb_of(rgb),
        depth_m=None if depth_m is None else _depth_of(depth_m),
        pose=pose,
        stamp_s=float(stamp_s),
        camera=Camera(camera),
    )


def _is_finite(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _image(image: Any, name: str) -> tuple[Any, int, int, bytes]:
    """Return encoding, height, width and bytes of an image on the wire."""
    if not isinstance(image, dict):
        raise WireError(f"`{name}` must be a map")
    size: list[Any] = [image.get("height"), image.get("width")]
    for number in size:
        if isinstance(number, bool) or not isinstance(number, int) or not 0 < number <= 8192:
            raise WireError(f"`{name}` needs `height` and `width` in 1..8192")
    if not isinstance(image.get("data"), bytes):
        raise WireError(f"`{name}` needs `data`, bytes")
    return image.get("encoding"), size[0], size[1], image["data"]


def _array(data: bytes, kind: Any, shape: tuple[int, ...], name: str) -> Any:
    expected = int(np.prod(shape)) * np.dtype(kind).itemsize
    if len(data) != expected:
        raise WireError(f"`{name}` has {len(data)} bytes in place of {expected}")
    return np.frombuffer(data, kind).reshape(shape)


def _rgb_of(image: Any) -> Any:
    encoding, height, width, data = _image(image, "rgb")
    if encoding == "raw":
        return _array(data, np.uint8, (height, width, 3), "rgb")
    if encoding == "jpeg":
        rgb = _decode_jpeg(data)
        if rgb.shape != (height, width, 3):
            raise WireError(f"`rgb` says {height} x {width} and is {rgb.shape}")
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
            raise WireError("`rgb` is no JPEG") from error
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise WireError("`rgb` is no JPEG")
    return np.ascontiguousarray(image[:, :, ::-1])


def decision_of(answer: Any) -> dict[str, Any]:
    """Return what a policy answered as the fields of a `decision` message.

    Raises:
        WireError: it is no decision.
    """
    given: Any = {"action": answer} if isinstance(answer, str) else answer
    if not isinstance(given, dict):
        if not hasattr(given, "action"):
            raise WireError(f"act answered {answer!r:.80}, which names no action")
        given = {name: getattr(given, name) for name in ("action", "raw_action", "diagnostics") if hasattr(given, name)}
    action = str(getattr(given.get("action"), "value", given.get("action"))).upper()
    if action not in ACTIONS:
        raise WireError("act answered {!r:.40}; the actions are {}".format(action, ", ".join(ACTIONS)))
    return {
        "action": action,
        "raw_action": str(given.get("raw_action") or action),
        "probabilities": plain(dict(given.get("probabilities") or {})),
        "diagnostics": plain(dict(given.get("diagnostics") or {})),
    }


class HabitatAgent:
    """Any Habitat `Agent` (`reset()`, `act(observations)`) as a policy.

    The agent gets `rgb` (H, W, 3) uint8, `depth` (H, W, 1) float32 normalised to [0, 1], `gps` (2,) float32,
    `compass` (1,) float32 and `objectgoal` (1,) int64; its answer is a number of `actions`, an action's name, or a dict
    with `action`.
    """

    DEFAULTS: ClassVar[dict[str, Any]] = {
        "name": "",
        "weights_sha256": "",
        "weights_label": "",
        "sensors": ["rgb", "depth", "odometry"],
        "arguments": {},
        "actions": {"0": "STOP", "1": "MOVE_FORWARD", "2": "TURN_LEFT", "3": "TURN_RIGHT"},
        "goals": {"chair": 0, "bed": 1, "plant": 2, "toilet": 3, "monitor": 4, "sofa": 5},
        "gps": "forward-right",
        "depth_min_m": 0.5,
        "depth_max_m": 5.0,
        "normalize_depth": True,
        "deterministic": True,
    }
    """Goal ids and action numbers are those of HM3D ObjectNav in habitat-lab. `gps` is habitat's (forward, right) or
    `forward-left`. `actions` may send LOOK_UP and LOOK_DOWN (4, 5) to whatever the lab's robot should do."""

    def __init__(self, factory: Callable[..., Any], settings: dict[str, Any] | None = None) -> None:
        settings = settings or {}
        unknown = sorted(set(settings) - set(self.DEFAULTS))
        if unknown:
            raise ValueError("no setting {}: there are {}".format(", ".join(unknown), ", ".join(self.DEFAULTS)))
        self.settings = dict(self.DEFAULTS, **settings)
        if self.settings["gps"] not in ("forward-right", "forward-left"):
            raise ValueError("gps must be forward-right or forward-left")
        strange = sorted(set(self.settings["actions"].values()) - set(ACTIONS))
        if strange:
            raise ValueError("no action {}: there are {}".format(", ".join(strange), ", ".join(ACTIONS)))
        self.agent = factory(**self.settings["arguments"])
        self.card = {
            "name": self.settings["name"] or getattr(factory, "__name__", "habitat-agent").lower(),
            "goals": sorted(self.settings["goals"]),
            "sensors": self.settings["sensors"],
            "weights_sha256": self.settings["weights_sha256"],
            "weights_label": self.settings["weights_label"],
            "settings": {name: self.settings[name] for name in self.DEFAULTS if name not in ("name", "sensors")},
            "deterministic": self.settings["deterministic"],
        }
        self._goal = 0

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode; every generator that is loaded is seeded."""
        if goal not in self.settings["goals"]:
            raise ValueError(f"the agent does not know {goal}")
        self._goal = self.settings["goals"][goal]
        random.seed(seed)
        np.random.seed(seed % 2**32)  # noqa: NPY002 - agents draw from the global generator
        torch = sys.modules.get("torch")
        if torch is not None:
            torch.manual_seed(seed)
        self.agent.reset()

    def act(self, observation: Observation) -> dict[str, Any]:
        """Hand the observation over as Habitat would and translate the answer."""
        answer = self.agent.act(self.observations(observation))
        details = answer if isinstance(answer, dict) else {"action": answer}
        raw: Any = details.get("action")
        raw = raw.item() if hasattr(raw, "item") else raw
        action = self.settings["actions"].get(str(raw), str(raw).upper())
        return {"action": action, "raw_action": str(raw)}

    def observations(self, observation: Observation) -> dict[str, Any]:
        """Return Habitat's dict of observations."""
        found: dict[str, Any] = {"objectgoal": np.array([self._goal], np.int64)}
        if observation.rgb is not None:
            found["rgb"] = np.ascontiguousarray(observation.rgb)
        if observation.depth_m is not None:
            found["depth"] = self._depth(observation.depth_m)[:, :, None]
        if observation.pose is not None:
            right = 1.0 if self.settings["gps"] == "forward-left" else -1.0
            found["gps"] = np.array([observation.pose.x_m, right * observation.pose.y_m], np.float32)
            found["compass"] = np.array([observation.pose.heading_rad], np.float32)
        return found

    def _depth(self, depth_m: Any) -> Any:
        """Return depth as Habitat's sensor gives it: clipped, and 0 where it is invalid."""
        low, high = np.float32(self.settings["depth_min_m"]), np.float32(self.settings["depth_max_m"])
        clipped = np.where(np.isnan(depth_m), low, np.clip(depth_m, low, high)).astype(np.float32)
        return (clipped - low) / (high - low) if self.settings["normalize_depth"] else clipped


def _load(where: str) -> Any:
    module_name, _, attribute = where.partition(":")
    if not attribute:
        raise ValueError(f"{where!r}: name the model as module:Class")
    sys.path.insert(0, str(Path.cwd()))
    found: Any = importlib.import_module(module_name)
    for part in attribute.split("."):
        found = getattr(found, part)
    return found


def is_loopback(host: str) -> bool:
    """Return whether a host's name or address means this machine alone."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def main(arguments: list[str] | None = None) -> None:
    """Serve what the command line names."""
    parser = argparse.ArgumentParser(prog="vsnbench_policy.py", description="Serve a model to vsnbench.")
    parser.add_argument("model", nargs="?", help="module:Class with reset(goal, seed) and act(observation)")
    parser.add_argument("--habitat-agent", metavar="module:Class", help="a Habitat Agent in place of a model")
    parser.add_argument("--settings", metavar="FILE", help="JSON: keyword arguments, or the agent's settings")
    parser.add_argument("--host", default="127.0.0.1", help="0.0.0.0 for the lab's network; needs a token")
    parser.add_argument("--port", type=int, default=8765)
    parser.add_argument("--unix-path", help="listen on this socket file in place of a port")
    parser.add_argument("--certificate", help="PEM file: serve wss://")
    parser.add_argument("--key", help="PEM file of the certificate's key")
    chosen = parser.parse_args(arguments)
    if bool(chosen.model) == bool(chosen.habitat_agent):
        parser.error("name a model as module:Class, or an agent with --habitat-agent")
    logging.basicConfig(level=logging.WARNING, format="%(message)s", stream=sys.stderr)
    settings = {}
    if chosen.settings:
        with Path(chosen.settings).open(encoding="utf-8") as file:
            settings = json.load(file)
    try:
        factory = _load(chosen.model or chosen.habitat_agent)
        policy = HabitatAgent(factory, settings) if chosen.habitat_agent else factory(**settings)
        serve(
            policy,
            host=chosen.host,
            port=chosen.port,
            certificate=chosen.certificate,
            key=chosen.key,
            unix_path=chosen.unix_path,
        )
    except (ValueError, OSError, ImportError, AttributeError, TypeError) as error:
        parser.exit(1, f"vsnbench_policy: {type(error).__name__}: {error}\n")


if __name__ == "__main__":
    main()
