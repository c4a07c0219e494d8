"""Step sizes that a model assumes: compared with the protocol, sent over the wire, and not part of the identity."""

import pytest

from vsnbench.errors import ModelError
from vsnbench.models.contract import ModelCard
from vsnbench.models.remote.card import card_of
from vsnbench.models.step_sizes import wrong_assumptions
from vsnbench.protocol.parameters import ProtocolParameters

CARD = ModelCard("fixed", forward_m=0.25, turn_deg=30)


@pytest.mark.parametrize(
    ("protocol", "count"),
    [({}, 0), ({"turn_deg": 15}, 1), ({"forward_m": 0.3}, 1), ({"forward_m": 0.3, "turn_deg": 15}, 2)],
)
def test_each_step_size_that_the_protocol_does_not_have_is_reported(protocol: dict[str, float], count: int) -> None:
    parameters = ProtocolParameters.model_validate(protocol)
    assert len(wrong_assumptions(CARD, parameters)) == count
    assert wrong_assumptions(ModelCard("free"), parameters) == []


def test_the_report_has_both_numbers() -> None:
    (line,) = wrong_assumptions(CARD, ProtocolParameters(name="lab", turn_deg=15))
    assert "30°" in line
    assert "15°" in line


def test_assumptions_are_not_part_of_the_identity() -> None:
    assert ModelCard("fixed") == CARD
    assert ModelCard("fixed").difference(CARD) == ""


def test_a_server_s_card_may_state_them() -> None:
    card = card_of({"card": {"name": "fixed", "goals": None, "forward_m": 0.25, "turn_deg": 30}}, {})
    assert (card.forward_m, card.turn_deg) == (0.25, 30.0)
    for wrong in ("0.25", -1, 1e9, True, float("nan")):
        with pytest.raises(ModelError):
            card_of({"card": {"name": "fixed", "goals": None, "forward_m": wrong}}, {})
