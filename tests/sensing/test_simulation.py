"""What a simulator says of itself: read whole, and refused in one line where it cannot be understood."""

import pytest

from vsnbench.errors import RobotError
from vsnbench.protocol.robot_identity import SimulationAccount
from vsnbench.sensing.simulation import read_account
from vsnbench.simulator.noise import NoiseSettings

ACCOUNT = SimulationAccount(
    simulator="1 (mujoco 4)",
    site="apartment",
    site_sha256="a" * 64,
    profile_sha256="b" * 64,
    odometry_rate_hz=50,
    command_lag_s=0.1,
    rate_factor=1,
    noise=NoiseSettings().model_dump(mode="json"),
)


def test_an_account_survives_its_way() -> None:
    assert read_account(ACCOUNT.model_dump_json()) == ACCOUNT


def test_what_results_depend_on_is_in_the_conditions_and_the_site_is_not() -> None:
    assert set(ACCOUNT.conditions) == {"simulator", "odometry_rate_hz", "command_lag_s", "rate_factor", "noise"}
    assert "noise" not in ACCOUNT.model_copy(update={"noise": None}).conditions


@pytest.mark.parametrize("text", ["", "{}", "[1]", "\x00", ACCOUNT.model_dump_json().replace("0.1", "NaN")])
def test_what_is_no_account_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(RobotError, match=r"what the simulator says of itself .*; run the same version") as refused:
        read_account(text)
    assert "\n" not in str(refused.value)
