"""The description of a simulator survives encoding, and an invalid one is an error."""

import pytest

from vsnbench.errors import RobotError
from vsnbench.sensing.simulation import read_account
from vsnbench.simulator.dynamics.noise import NoiseSettings
from vsnbench.values.robot_identity import SimulationAccount

ACCOUNT = SimulationAccount(
    simulator="1 (mujoco 4)",
    site="apartment",
    site_sha256="a" * 64,
    profile_sha256="b" * 64,
    odometry_rate_hz=50,
    base={"dead_time_s": 0.1},
    rate_factor=1,
    noise=NoiseSettings().model_dump(mode="json"),
)


def test_an_account_survives_encoding() -> None:
    assert read_account(ACCOUNT.model_dump_json()) == ACCOUNT


def test_the_conditions_contain_the_simulator_and_not_the_site() -> None:
    assert set(ACCOUNT.conditions) == {"simulator", "odometry_rate_hz", "base", "rate_factor", "noise"}
    assert "noise" not in ACCOUNT.model_copy(update={"noise": None}).conditions


@pytest.mark.parametrize("text", ["", "{}", "[1]", "\x00", ACCOUNT.model_dump_json().replace("0.1", "NaN")])
def test_an_invalid_account_is_an_error_of_one_line(text: str) -> None:
    with pytest.raises(RobotError) as refused:
        read_account(text)
    assert refused.value.code == "invalid-simulation-account"
    assert "\n" not in str(refused.value)
