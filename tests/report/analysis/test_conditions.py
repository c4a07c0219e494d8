"""Names of conditions are short and unambiguous."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.report.records import Attempt, Lab
from tests.results.records_of_a_lab import plan, run, stopped
from vsnbench.errors import UsageError
from vsnbench.protocol.named import NAMED
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.report.analysis.conditions import Condition, Selection, footnotes, name_apart
from vsnbench.report.analysis.summary import summarise
from vsnbench.report.build import build, read
from vsnbench.report.comparison.compare import find_condition
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.writing.journal import Journal


def condition(number: int = 1, **facts: Any) -> Condition:
    given_facts: dict[str, Any] = {
        "model": "vlv",
        "weights_label": "",
        "weights_sha256": "",
        "surveyed": False,
        "robot": "turtlebot2",
        "robot_title": "TurtleBot 2",
        "kind": "simulated",
        "simulated": True,
        "site": "apartment",
        "site_sha256": "5" * 64,
        "campaigns": (number,),
        "protocol": {"max_actions": 150, "success_distance_m": 1.0, "depth_guard": {"enabled": True}},
    }
    return Condition(number, **(given_facts | facts))


def names(*facts: Mapping[str, Any]) -> list[str]:
    return [one.name for one in name_apart([condition(number, **each) for number, each in enumerate(facts, start=1)])]


@pytest.mark.parametrize(
    ("facts", "expected"),
    [
        ([{}], ["vlv"]),
        ([{}, {"model": "oracle"}], ["vlv", "oracle"]),
        ([{}, {"simulated": False, "robot": "lola2", "kind": "ros1"}], ["vlv simulated", "vlv real"]),
        ([{}, {"conditions": {"noise": {"depth": 1.0}}}], ["vlv without noise", "vlv with noise"]),
        ([{}, {"conditions": {"pretends_to_be_real": True}}], ["vlv not in rehearsal", "vlv in rehearsal"]),
        (
            [{"settings": {"a": 1, "recall": 0.85}}, {"settings": {"a": 1, "recall": 0.4}}],
            ["vlv recall=0.85", "vlv recall=0.4"],
        ),
        (
            [{"weights_sha256": "a" * 64}, {"weights_sha256": "b" * 64}],
            ["vlv weights aaaaaaaa", "vlv weights bbbbbbbb"],
        ),
        (
            [{"weights_sha256": "a" * 64}, {}, {"weights_sha256": "a" * 64, "simulated": False}],
            ["vlv simulated, weights aaaaaaaa", "vlv simulated, no weights", "vlv real, weights aaaaaaaa"],
        ),
        (
            [{}, {"protocol": {"max_actions": 150, "success_distance_m": 1.0, "depth_guard": {"enabled": False}}}],
            ["vlv depth_guard.enabled=True", "vlv depth_guard.enabled=False"],
        ),
        ([{}, {}], ["vlv #1", "vlv #2"]),
        (
            [{"model": "human", "settings": {"driver": name}} for name in ("ada", "bo")] + [{}],
            ["human ada", "human bo", "vlv"],
        ),
        (
            [{"model": "human", "settings": {"driver": "ada"}, "simulated": simulated} for simulated in (True, False)],
            ["human ada simulated", "human ada real"],
        ),
    ],
)
def test_a_name_says_as_little_as_tells_apart(facts: Sequence[Mapping[str, Any]], expected: list[str]) -> None:
    assert names(*facts) == expected


SETTINGS = st.fixed_dictionaries(
    {"recall": st.sampled_from([0.4, 0.85]), "deep": st.fixed_dictionaries({"n": st.integers(0, 2)})}
)
FACTS = st.fixed_dictionaries(
    {
        "model": st.sampled_from(["vlv", "vlv real", "oracle"]),
        "simulated": st.booleans(),
        "robot": st.sampled_from(["a", "b"]),
        "conditions": st.sampled_from([{}, {"noise": {"depth": 1}}, {"noise": {"depth": 2}}]),
        "settings": SETTINGS,
    }
)


@settings(deadline=None)
@given(st.lists(FACTS, min_size=1, max_size=8))
def test_no_two_conditions_share_a_name_and_a_bare_model_means_one(facts: list[dict[str, Any]]) -> None:
    found = names(*facts)
    assert len(set(found)) == len(found)
    for name, own in zip(found, facts, strict=True):
        alone = sum(other["model"] == own["model"] for other in facts) == 1
        assert (name == own["model"]) <= alone


def test_a_long_setting_is_cut_but_stays_apart() -> None:
    first, second = names({"settings": {"path": "x" * 300 + "1"}}, {"settings": {"path": "x" * 300 + "2"}})
    assert first != second
    assert max(len(first), len(second)) < 40


def test_the_footnote_says_weights_and_every_setting_that_differs() -> None:
    pair = name_apart(
        [
            condition(
                1, weights_label="trained here", weights_sha256="a" * 64, settings={"recall": 0.85, "n": 2, "same": 1}
            ),
            condition(
                2, weights_label="trained here", weights_sha256="a" * 64, settings={"recall": 0.4, "n": 3, "same": 1}
            ),
        ]
    )
    first, second = footnotes(pair)
    assert first.startswith("vlv recall=0.85: TurtleBot 2, simulated; site apartment; at most 150 actions;")
    assert "weights: trained here (aaaaaaaa)" in first
    assert "recall=0.85, n=2" in first
    assert "recall=0.4, n=3" in second
    assert "same" not in first


def test_footnotes_name_the_simulator_if_other_models_had_another_version() -> None:
    old, new = ({"simulator": f"{edition} (mujoco 4.0.1)"} for edition in (1, 2))
    first, second, real = footnotes(
        name_apart(
            [condition(1, conditions=old), condition(2, model="oracle", conditions=new), condition(3, model="a")]
        )
    )
    assert "simulator=1 (mujoco 4.0.1)" in first
    assert "simulator=2 (mujoco 4.0.1)" in second
    assert "simulator=" not in real
    alike = name_apart([condition(1, conditions=new), condition(2, model="oracle", conditions=new)])
    assert not any("simulator=" in footnote for footnote in footnotes(alike))


def test_a_setting_handed_on_under_its_own_name_is_said_once() -> None:
    settings = [{"recall": one, "detector": {"recall": one, "range_m": far}} for one, far in ((0.85, 5), (0.4, 3))]
    first, _ = footnotes(name_apart([condition(n, settings=each) for n, each in enumerate(settings, start=1)]))
    assert first.count("recall=0.85,") == 1
    assert "detector.recall" not in first
    assert "detector.range_m=5" in first


def test_a_model_run_twice_is_asked_for_by_its_full_name(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.write([Attempt()], protocol=ProtocolParameters(max_actions=100))
    lab.write([Attempt()], protocol=ProtocolParameters(max_actions=200))
    results = build(lab.url, Selection(), activity=False).results
    with pytest.raises(UsageError, match="'vlv within 100 actions', 'vlv within 200 actions'"):
        find_condition("vlv", results, None)
    assert find_condition("vlv within 200 actions", results, None).condition.max_actions == 200


@pytest.mark.parametrize("database", ["sqlite", "postgresql"])
def test_settings_have_one_order_in_every_database(
    tmp_path: Path, database: str, request: pytest.FixtureRequest
) -> None:
    url = sqlite_url(tmp_path / "vsnbench.db") if database == "sqlite" else str(request.getfixturevalue("postgresql"))
    chosen = {"temperature": 1.0, "b": {"zz": 1, "a": 2, "long": 3}, "aa": 2}
    with Journal.open(url) as journal:
        trial = journal.find_or_create_campaign(plan(settings=chosen)).trials[0]
        run(journal, trial, stopped(success=True))
    (condition,) = read(url, Selection()).conditions
    assert json.dumps(condition.settings) == json.dumps(chosen, sort_keys=True)
    for without_empty_columns in (condition.protocol, condition.conditions):
        assert list(without_empty_columns) == sorted(without_empty_columns)


def test_protocols_are_never_pooled_and_conditions_are_named_by_them(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    habitat = NAMED["habitat-objectnav"].parameters
    protocols = (ProtocolParameters(), habitat, ProtocolParameters(name="lab", max_time_s=60), habitat)
    for seed, protocol in enumerate(protocols):
        lab.write([Attempt()], protocol=protocol, seed=seed)
    conditions = [one.condition for one in summarise(read(lab.url, Selection())).conditions]
    assert [one.name for one in conditions] == ["vlv under ros4vsn", "vlv under habitat-objectnav", "vlv under lab"]
    assert [len(one.campaigns) for one in conditions] == [1, 2, 1]
    assert "protocol lab; at most 150 actions; at most 60 s" in conditions[2].description
    assert "protocol" not in conditions[0].description
