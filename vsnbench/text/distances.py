"""Distances as text, rounded without crossing the success distance."""

import math

_MAX_DECIMALS = 9


def distance_text(distance_m: float, success_distance_m: float | None, decimals: int = 2) -> str:
    """Return a distance in metres without its unit, as `0.84`.

    Args:
        distance_m: the distance; must be finite.
        success_distance_m: STOP nearer than this succeeds; None if unknown.
        decimals: minimum number of decimals. More are used if the rounded number would be on the wrong side of the
            success distance: with 1 m, 1.001 m is `1.001` and 0.9996 m is `0.9996`.
    """
    if success_distance_m is None or not math.isfinite(distance_m):
        return f"{distance_m:.{decimals}f}"
    # 1.00 reads as exactly 1 m, which is not under 1 m: only a distance of exactly 1 m is printed so.
    is_under, is_exact = distance_m < success_distance_m, distance_m == success_distance_m
    for places in range(decimals, _MAX_DECIMALS + 1):
        text = f"{distance_m:.{places}f}"
        if (float(text) < success_distance_m) == is_under and (float(text) != success_distance_m or is_exact):
            return text
    return repr(distance_m)
