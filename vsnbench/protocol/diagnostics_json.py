"""A policy's diagnostics as JSON beside its step, and back: so that a rebuilt view shows what the live one showed.

Probabilities have a column of their own. The rest lies in `details` under one key, next to what the policy put there
itself; maps are kept as PNG.
"""

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vsnbench.protocol.decision import Box, Diagnostics, GridMap

SHOWN = "shown"
"""The key in a step's `details`."""


def diagnostics_to_details(diagnostics: Diagnostics) -> dict[str, Any]:
    """Return the `details` of a step: the policy's own, and what the viewer shows; empty parts are left out."""
    grid = diagnostics.map
    shown = {
        "boxes": [[b.left, b.top, b.right, b.bottom, b.label, b.score] for b in diagnostics.boxes],
        "map": None if grid is None else _map_to_json(grid),
        "sub_goal": None if diagnostics.sub_goal is None else list(diagnostics.sub_goal),
        "path": [list(point) for point in diagnostics.path],
        "nodes": [list(point) for point in diagnostics.nodes],
        "scalars": dict(diagnostics.scalars),
        "note": diagnostics.note,
    }
    kept = {name: value for name, value in shown.items() if value}
    return {**diagnostics.details, SHOWN: kept} if kept else dict(diagnostics.details)


def diagnostics_from_record(
    probabilities: Mapping[str, float] | None, details: Mapping[str, Any] | None
) -> Diagnostics:
    """Return the diagnostics of a recorded step."""
    own = dict(details or {})
    shown = own.pop(SHOWN, {})
    return Diagnostics(
        probabilities=dict(probabilities or {}),
        boxes=tuple(Box(*box) for box in shown.get("boxes", ())),
        map=_map_from_json(shown["map"]) if "map" in shown else None,
        sub_goal=_point(shown["sub_goal"]) if "sub_goal" in shown else None,
        path=tuple(_point(point) for point in shown.get("path", ())),
        nodes=tuple(_point(point) for point in shown.get("nodes", ())),
        scalars=shown.get("scalars", {}),
        note=shown.get("note", ""),
        details=own,
    )


def _map_to_json(grid: GridMap) -> dict[str, Any]:
    import cv2

    png = cv2.imencode(".png", np.ascontiguousarray(grid.cells))[1]
    return {
        "png": base64.b64encode(png.tobytes()).decode(),
        "origin_m": [grid.origin_x_m, grid.origin_y_m],
        "resolution_m": grid.resolution_m,
    }


def _map_from_json(kept: Mapping[str, Any]) -> GridMap:
    import cv2

    png = np.frombuffer(base64.b64decode(kept["png"]), np.uint8)
    cells = np.asarray(cv2.imdecode(png, cv2.IMREAD_GRAYSCALE), np.uint8)
    x_m, y_m = _point(kept["origin_m"])
    return GridMap(cells, x_m, y_m, float(kept["resolution_m"]))


def _point(values: Sequence[float]) -> tuple[float, float]:
    x_m, y_m = values
    return (float(x_m), float(y_m))
