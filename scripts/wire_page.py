"""Fills the table of sensors in docs/wire.md from their declarations in `vsnbench/values/observation.py`."""

import re

from vsnbench.values.observation import Sensor

_TABLE = re.compile(r"(<!-- table of sensors, by `make docs` -->\n)(?:\|.*\n)+")
_HEADING = "| sensor | field | form | meaning |\n| --- | --- | --- | --- |\n"


def wire_page(page: str) -> str:
    """Return docs/wire.md with the table of the sensors that are sent."""
    rows = "".join(_row(sensor) for sensor in Sensor if sensor.is_sent)
    return _TABLE.sub(lambda found: found[1] + _HEADING + rows, page)


def _row(sensor: Sensor) -> str:
    form = [] if sensor.array is None else [str(sensor.array), sensor.array.unit]
    nan = f"NaN: {sensor.array.nan}" if sensor.array is not None and sensor.array.nan else ""
    return f"| `{sensor}` | `{sensor.field}` | {', '.join(filter(None, (*form, nan)))} | {sensor.meaning} |\n"
