"""A battery over ROS 1: the message of a Kobuki, identical to that of ROS, and its values."""

import struct
from io import BytesIO

import genpy
import pytest
from genpy.dynamic import generate_dynamic
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Header

from vsnbench.ros.ros1.messages import SensorState, battery_in, battery_message
from vsnbench.values.battery import Battery

pytestmark = pytest.mark.ros


def written(message) -> bytes:
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def test_its_bytes_are_those_that_ros_s_own_generator_reads_and_writes() -> None:
    theirs = generate_dynamic(SensorState._type, SensorState._full_text)[SensorState._type]
    header = Header(seq=3, stamp=genpy.Time(5, 7), frame_id="base")
    fields = {"header": header, "time_stamp": 515, "left_pwm": -3, "charger": 22, "battery": 158, "digital_input": 9}
    lists = {"bottom": (1000, 2000, 3000), "current": (4, 5), "analog_input": (4095,)}
    data = written(SensorState(**fields, **lists))
    assert data == written(theirs(**fields, **(lists | {"current": bytes([4, 5])})))
    back = SensorState().deserialize(data)
    assert (back.battery, back.left_pwm, back.bottom, back.digital_input) == (158, -3, [1000, 2000, 3000], 9)
    assert written(SensorState()) == written(theirs())
    for length in range(len(data)):
        with pytest.raises(genpy.DeserializationError):
            SensorState().deserialize(data[:length])
    with pytest.raises(genpy.DeserializationError, match="bottom"):
        SensorState().deserialize(data[:34] + struct.pack("<I", 2**32 - 1) + data[38:])


@pytest.mark.parametrize(
    ("tenths", "said"),
    [
        (0, None),
        (165, Battery(1.0, 16.5)),
        (170, Battery(1.0, 17.0)),
        (132, Battery(0.05, 13.2)),
        (90, Battery(0, 9.0)),
    ],
)
def test_the_voltage_of_a_kobuki_is_read_as_by_its_driver(tenths: int, said: Battery | None) -> None:
    read = battery_in(SensorState(battery=tenths))
    assert read == (said and Battery(pytest.approx(said.share), said.voltage_v))


@pytest.mark.parametrize("kind", ["kobuki_msgs/SensorState", "sensor_msgs/BatteryState"])
def test_the_message_of_a_simulated_base_is_read_back(kind: str) -> None:
    for share in (0.1, 0.5, 0.9):
        said = battery_in(battery_message(kind, share, genpy.Time(1, 2)))
        assert said is not None
        assert said.share == pytest.approx(share, abs=0.015)


def test_a_base_that_measures_only_the_voltage_reports_it() -> None:
    said = battery_in(BatteryState(percentage=float("nan"), voltage=12.6))
    assert said is not None
    assert said.text == "12.6 V"
