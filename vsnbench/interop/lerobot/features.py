"""The features of a dataset: names, types and shapes in `info.json`, and the columns of its Parquet files."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.files.mp4 import CODEC_NAME, Mp4Encoding, pixel_format
from vsnbench.interop.lerobot.frames import ACTIONS, EpisodeFrames

FRAMES_PER_S = 1
"""Nominal: a frame per action. The steps of a robot are not equidistant; `robot_time_s` has its time."""
ENCODING = Mp4Encoding(crf=18, keyframe_interval=2)
"""Near the JPEG in quality, with fast access to any frame."""

Feature = dict[str, Any]
Size = tuple[int, int]


def features(colors: Mapping[str, Size], depths: Mapping[str, Size]) -> dict[str, Feature]:
    """Return the features by name; sizes are widths and heights in pixels."""
    found = {name: _image("video", size, 3, _video_info(*size)) for name, size in colors.items()}
    about = {"is_depth_map": True, "depth_unit": "mm"}
    return (
        found
        | {name: _image("image", size, 1, about) for name, size in depths.items()}
        | {
            "observation.state": _vector("float32", ["x_m", "y_m", "heading_rad"]),
            "action": _vector("float32", ["forward_m", "left_m", "turn_rad", "stop"]),
            "discrete_action": {**_number("int64"), "names": {"actions": [action.value for action in ACTIONS]}},
            "blocked": _number("bool"),
            "robot_time_s": _number("float64"),
            "next.success": _number("bool"),
            "next.done": _number("bool"),
            "timestamp": _number("float32"),
            "frame_index": _number("int64"),
            "episode_index": _number("int64"),
            "index": _number("int64"),
            "task_index": _number("int64"),
        }
    )


def columns(
    frames: EpisodeFrames, *, episode_index: int, first_index: int, task_index: int
) -> dict[str, npt.NDArray[Any]]:
    """Return the features of an episode that are numbers, an array of N rows each."""
    count = len(frames)
    numbers = np.arange(count)
    last = numbers == count - 1
    return {
        "observation.state": frames.state,
        "action": frames.action,
        "discrete_action": frames.discrete_action,
        "blocked": frames.blocked,
        "robot_time_s": frames.robot_time_s,
        "next.success": last & bool(frames.episode.success),
        "next.done": last,
        "timestamp": (numbers / FRAMES_PER_S).astype(np.float32),
        "frame_index": numbers,
        "episode_index": np.full(count, episode_index),
        "index": first_index + numbers,
        "task_index": np.full(count, task_index),
    }


def arrow_schema(named: Mapping[str, Feature]) -> Any:
    """Return the schema of the data files, with the types that the library `datasets` expects in its metadata."""
    import pyarrow as pa

    fields, types = [], dict[str, dict[str, Any]]()
    for name, feature in named.items():
        if feature["dtype"] == "video":
            continue
        if feature["dtype"] == "image":
            kind, types[name] = pa.struct({"bytes": pa.binary(), "path": pa.string()}), {"_type": "Image"}
        else:
            kind = pa.bool_() if feature["dtype"] == "bool" else getattr(pa, feature["dtype"])()
            types[name] = {"dtype": feature["dtype"], "_type": "Value"}
            if (length := feature["shape"][0]) > 1:
                kind = pa.list_(pa.field("element", kind), length)
                types[name] = {"feature": types[name], "length": length, "_type": "List"}
        fields.append(pa.field(name, kind))
    return pa.schema(fields, metadata={"huggingface": json.dumps({"info": {"features": types}})})


def _number(dtype: str) -> Feature:
    return {"dtype": dtype, "shape": [1], "names": None}


def _vector(dtype: str, names: list[str]) -> Feature:
    return {"dtype": dtype, "shape": [len(names)], "names": names}


def _image(dtype: str, size: Size, channels: int, info: dict[str, Any]) -> Feature:
    width, height = size
    return {
        "dtype": dtype,
        "shape": [height, width, channels],
        "names": ["height", "width", "channels"],
        "info": info,
    }


def _video_info(width: int, height: int) -> dict[str, Any]:
    return {
        "video.height": height,
        "video.width": width,
        "video.codec": CODEC_NAME,
        "video.pix_fmt": pixel_format(width, height),
        "video.fps": FRAMES_PER_S,
        "video.channels": 3,
        "has_audio": False,
        "is_depth_map": False,
        "video.g": ENCODING.keyframe_interval,
        "video.crf": ENCODING.crf,
        "video.preset": ENCODING.preset,
    }
