"""Table of the sensors that a policy can have, from their declarations in `vsnbench.values.observation`."""

from vsnbench.values.observation import Sensor


def table() -> str:
    """Return the table of the sensors that are sent to a served policy."""
    heading = "| sensor | field | form | meaning |\n| --- | --- | --- | --- |\n"
    sent = [sensor for sensor in Sensor if sensor.is_sent]
    return heading + "".join(f"| `{s}` | `{s.field}` | {_form(s)} | {s.meaning} |\n" for s in sent)


def _form(sensor: Sensor) -> str:
    if sensor.array is None:
        return ""
    nan = f"NaN: {sensor.array.nan}" if sensor.array.nan else ""
    return ", ".join(filter(None, (str(sensor.array), sensor.array.unit, nan)))
