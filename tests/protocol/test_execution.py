"""Continuous execution as a parameter of the protocol."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from vsnbench.errors import UsageError
from vsnbench.protocol.execution import Execution, execution_of, parse_continuous, text_of_execution
from vsnbench.protocol.judge import EndReason, end_after, judge
from vsnbench.protocol.limits import Spent, budget_left
from vsnbench.protocol.named import NAMED, load_protocol, parameter_rows
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action


def test_the_execution_is_part_of_the_protocol_and_stop_and_go_keeps_its_content() -> None:
    paper = ProtocolParameters()
    driving = paper.executed(parse_continuous("0.3"))
    assert paper.executed(None) is paper
    assert "execution" not in paper.model_dump()
    assert driving.version == 3
    content = driving.model_dump(mode="json")
    assert content["execution"] == {"latency_s": 0.3, "max_rate_hz": 10.0, "max_answer_age_s": 5.0}
    assert ProtocolParameters.from_record(content) == driving
    assert (execution_of(paper.model_dump()), execution_of(content)) == ("stop_and_go", "continuous")
    assert text_of_execution(content) == "continuous, latency 0.3 s"
    assert text_of_execution(paper.executed(parse_continuous("measured")).model_dump()) == (
        "continuous, measured latency"
    )


def test_an_option_changes_the_latency_of_a_protocol_and_keeps_the_rest() -> None:
    lab = ProtocolParameters(execution=Execution(latency_s=0.1, max_answer_age_s=1.0, frames_hz=4.0))
    assert lab.executed(parse_continuous("0.3")).execution == Execution(
        latency_s=0.3, max_answer_age_s=1.0, frames_hz=4.0
    )
    assert lab.executed(parse_continuous("measured")).execution == Execution(max_answer_age_s=1.0, frames_hz=4.0)
    with pytest.raises(UsageError) as refused:
        lab.executed(parse_continuous("2"))
    assert refused.value.code == "invalid-latency"


@pytest.mark.parametrize("text", ["-1", "1e9", "5.1", "nan", "inf", "", "0.3s"])
def test_a_latency_that_lets_no_answer_take_effect_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(UsageError) as refused:
        parse_continuous(text)
    assert refused.value.code == "invalid-latency"
    assert "\n" not in str(refused.value)


def test_a_latency_above_the_age_at_which_answers_are_dropped_is_refused() -> None:
    with pytest.raises(ValidationError, match="never drive"):
        Execution(latency_s=2.0, max_answer_age_s=1.0)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("execution: {latency_s: 0.5}", Execution(latency_s=0.5)),
        ("execution: continuous", Execution()),
        ("execution: stop_and_go", None),
    ],
)
def test_a_protocol_file_states_the_execution(tmp_path: Path, line: str, expected: Execution | None) -> None:
    file = tmp_path / "lab.yaml"
    file.write_text(f"name: lab\n{line}\n")
    assert load_protocol(str(file)).execution == expected
    assert {row.name for row in parameter_rows(load_protocol(str(file)))} >= {"max_actions"}


def test_time_limits_a_continuous_episode_instead_of_the_number_of_answers() -> None:
    driving = ProtocolParameters().executed(Execution(latency_s=0.1))
    assert (driving.action_limit, driving.time_limit_s) == (None, 300.0)
    assert budget_left(Spent(actions=500, driving_s=100.0), driving).actions_left is None
    assert budget_left(Spent(actions=500, driving_s=100.0), driving).time_left_s == 200.0
    done = MotionResult(completed=True)
    assert end_after(Spent(actions=500, driving_s=100.0), Action.WAYPOINT, done, driving) is None
    assert end_after(Spent(actions=500, driving_s=300.0), Action.WAYPOINT, done, driving) is EndReason.TIME_LIMIT
    assert "time limit of 300 s" in judge(EndReason.TIME_LIMIT, 500, None, driving).text
    limited = ProtocolParameters(max_time_s=60.0).executed(Execution())
    assert limited.time_limit_s == 60.0


def test_no_named_protocol_drives_on_by_itself() -> None:
    assert {protocol.parameters.execution for protocol in NAMED.values()} == {None}
