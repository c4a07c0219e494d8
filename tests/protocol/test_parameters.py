"""The protocol's parameters, and the version of the rules in a record."""

import pytest
from pydantic import ValidationError

from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.writing.campaigns import content_sha256

PAPER_SHA256 = "34ff8d3a3f8010805416982eb1d2e236c30518b614b67a4d43469355cee396fa"
SIX_ACTIONS_SHA256 = "24bbd64dadebead5a1588076b504e543d506821a5ffd2ed2fa15dedb9931066d"
"""Hashes in records of earlier versions, of the paper's protocol and of --max-steps 6."""


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


def test_a_name_or_another_limit_makes_version_3() -> None:
    for new in ({"name": "lab"}, {"max_time_s": 60.0}, {"max_path_m": 9.0}):
        parameters = ProtocolParameters.model_validate(new)
        assert (parameters.version, parameters.in_sight) == (3, True)
        assert parameters.model_dump(mode="json").items() >= {"version": 3, **new}.items()
        assert ProtocolParameters.from_record(parameters.model_dump(mode="json")) == parameters


@pytest.mark.parametrize("content", [{"version": 2, "name": "lab"}, {"version": 1, "max_time_s": 5}, {"version": 3}])
def test_a_version_that_does_not_match_the_fields_is_refused(content: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        ProtocolParameters.model_validate(content)


def test_the_paper_s_protocol_is_recorded_and_hashed_as_before() -> None:
    recorded = ProtocolParameters().model_dump(mode="json")
    assert set(recorded) == {*("version", "max_actions", "success_distance_m", "forward_m", "turn_deg", "depth_guard")}
    assert content_sha256(recorded) == PAPER_SHA256
    assert content_sha256(ProtocolParameters(max_actions=6).model_dump(mode="json")) == SIX_ACTIONS_SHA256
