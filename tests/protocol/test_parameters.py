"""The protocol's numbers, and by which version of its rules a record was judged."""

import pytest
from pydantic import ValidationError

from vsnbench.protocol.parameters import ProtocolParameters


def test_new_campaigns_are_judged_in_sight() -> None:
    assert ProtocolParameters().version == 2
    assert ProtocolParameters().in_sight


def test_a_record_without_a_version_keeps_the_first_rule() -> None:
    before = {"max_actions": 40, "success_distance_m": 1.0, "starting_positions": 15}
    kept = ProtocolParameters.from_record(before)
    assert (kept.version, kept.in_sight, kept.max_actions) == (1, False, 40)


def test_what_was_recorded_comes_back_as_it_was() -> None:
    for version in (1, 2):
        parameters = ProtocolParameters(version=version, max_actions=12)
        assert ProtocolParameters.from_record(parameters.model_dump(mode="json")) == parameters


def test_a_version_from_the_future_is_refused() -> None:
    with pytest.raises(ValidationError):
        ProtocolParameters.from_record({"version": 3})
