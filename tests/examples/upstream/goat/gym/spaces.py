"""Stand-in for the spaces of gym: what they were made with."""


def Box(low, high, shape, dtype):  # noqa: N802 - as gym spells it
    return shape


Dict, Discrete = dict, int
