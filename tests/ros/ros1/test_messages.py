"""The messages without a package are identical to those that ROS generates."""

import struct
from io import BytesIO

import genmsg
import genmsg.gentools
import genpy
import pytest
from genmsg.msg_loader import MsgContext, load_msg_from_string
from genmsg.srvs import SrvSpec
from hypothesis import given, settings
from hypothesis import strategies as st
from std_msgs.msg import Header

from vsnbench.ros.ros1 import messages

pytestmark = pytest.mark.ros

MESSAGES = [
    messages.DiscreteServerRequest,
    messages.DiscreteServerResponse,
    messages.PlaceRobotRequest,
    messages.PlaceRobotResponse,
    messages.BumperEvent,
    messages.CliffEvent,
    messages.WheelDropEvent,
    messages.SensorState,
]
SERVICES = [messages.DiscreteServer, messages.PlaceRobot]


def context():
    known = MsgContext.create_default()
    load_msg_from_string(known, Header._full_text, "std_msgs/Header")
    return known


def spec_of(message):
    return load_msg_from_string(context(), message._full_text.partition("=" * 80)[0], message._type)


@pytest.mark.parametrize("message", MESSAGES, ids=lambda m: m.__name__)
def test_the_md5_is_the_one_that_ros_computes_from_the_definition(message) -> None:
    assert genmsg.gentools.compute_md5(context(), spec_of(message)) == message._md5sum


@pytest.mark.parametrize("service", SERVICES, ids=lambda s: s.__name__)
def test_the_md5_of_a_service_is_the_one_that_ros_computes(service) -> None:
    request, response = spec_of(service._request_class), spec_of(service._response_class)
    package, name = service._type.split("/")
    spec = SrvSpec(request, response, service._request_class._full_text, service._type, package, name)
    assert genmsg.gentools.compute_md5(context(), spec) == service._md5sum


def test_the_md5s_are_those_of_the_released_packages() -> None:
    assert messages.DiscreteServer._md5sum == "5b48aba823d191d65097ac88447ce907"
    assert messages.BumperEvent._md5sum == "ffe360cd50f14f9251d9844083e72ac5"
    assert messages.CliffEvent._md5sum == "c5b106efbb1427a94f517c5e05f06295"
    assert messages.WheelDropEvent._md5sum == "e102837d89384d67669a0df86b63f33b"
    assert messages.SensorState._md5sum == "92e992cd3c66c18711c1ce707090fcc1"


@pytest.mark.parametrize("message", MESSAGES, ids=lambda m: m.__name__)
def test_fields_and_types_are_those_of_the_definition(message) -> None:
    spec = spec_of(message)
    assert list(message.__slots__) == spec.names
    assert message._slot_types == spec.types
    assert {c.name: c.val for c in spec.constants}.items() <= vars(message).items()


def written(message) -> bytes:
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def test_the_bytes_on_the_wire_are_those_of_ros() -> None:
    assert written(messages.DiscreteServerRequest("Left", 30)) == struct.pack("<I4sq", 4, b"Left", 30)
    assert written(messages.DiscreteServerResponse(True)) == b"\x01"
    assert written(messages.CliffEvent(2, 1, 515)) == b"\x02\x01\x03\x02"


@settings(deadline=None)
@given(st.text(max_size=40), st.integers(-(2**63), 2**63 - 1))
def test_a_request_survives_the_wire(movement: str, angle: int) -> None:
    back = messages.DiscreteServerRequest().deserialize(written(messages.DiscreteServerRequest(movement, angle)))
    assert (back.movement, back.angle) == (movement, angle)


def test_omitted_fields_are_zero_or_empty() -> None:
    request = messages.PlaceRobotRequest(x=1.5)
    assert (request.x, request.y, request.heading, request.seed) == (1.5, 0.0, 0.0, 0)
    assert messages.DiscreteServerRequest().movement == ""


@settings(deadline=None)
@given(st.binary(max_size=12))
def test_truncated_data_is_an_error_and_is_never_read_past_its_end(data: bytes) -> None:
    try:
        request = messages.DiscreteServerRequest().deserialize(data)
    except genpy.DeserializationError:
        return
    assert len(data) >= 12 + len(request.movement)


@pytest.mark.parametrize(("field", "value"), [("angle", 2**63), ("angle", "thirty"), ("movement", 7)])
def test_a_value_out_of_range_is_an_error_that_names_the_field(field, value) -> None:
    request = messages.DiscreteServerRequest()
    setattr(request, field, value)
    with pytest.raises(genpy.SerializationError, match=field):
        written(request)


def test_transforms_are_encoded_as_by_an_independent_encoder() -> None:
    import numpy as np
    from geometry_msgs.msg import TransformStamped
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    from vsnbench.ros.ros1.messages import TFMessage

    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(TFMessage._full_text, "tf2_msgs/msg/TFMessage"))
    assert store.generate_msgdef("tf2_msgs/msg/TFMessage", ros_version=1)[1] == TFMessage._md5sum
    first, second = TransformStamped(), TransformStamped()
    first.header.frame_id, first.child_frame_id, first.transform.rotation.w = "odom", "base_footprint", 1.0
    second.header.stamp, second.header.frame_id, second.child_frame_id = genpy.Time(3, 7), "a", "b"
    second.transform.translation.x = 1.5
    data = written(TFMessage([first, second]))
    theirs = store.deserialize_ros1(data, "tf2_msgs/msg/TFMessage")
    assert [link.child_frame_id for link in theirs.transforms] == ["base_footprint", "b"]
    assert theirs.transforms[1].transform.translation.x == 1.5
    assert np.all(store.serialize_ros1(theirs, "tf2_msgs/msg/TFMessage") == np.frombuffer(data, np.uint8))
    assert TFMessage().deserialize(data).transforms == [first, second]
    for length in range(len(data)):
        with pytest.raises(genpy.DeserializationError):
            TFMessage().deserialize(data[:length])
