import math
from pathlib import Path

import pytest

from vsnbench.database.pace import NO_PACE, Pace
from vsnbench.errors import SiteError, UsageError
from vsnbench.record.results import ResultsDirectory
from vsnbench.runner.pool.capacity import WorkersAsked
from vsnbench.runner.request import RunRequest
from vsnbench.runner.selection import named_site
from vsnbench.runner.sweep import NEXT_STARTUP_S, STARTUP_S, UNKNOWN_PACE_S, cost_of, plan_sweep, read_sites

REQUEST = RunRequest("forward", ("chair",), ResultsDirectory.locate(Path("nowhere"), None, {}), workers=WorkersAsked(2))


def test_a_sweep_has_every_model_in_every_site_with_every_seed_and_seeds_outermost() -> None:
    sweep = plan_sweep(REQUEST, "forward, random", "0-1,5", "apartment,twins:3-4,9")
    assert [(one.seed, one.site, one.model) for one in sweep.requests] == [
        (seed, site, model)
        for seed in (0, 1, 5)
        for site in ("apartment", "twin:3", "twin:4", "twin:9")
        for model in ("forward", "random")
    ]
    assert set(sweep.site_names) == {"apartment", "twin-3", "twin-4", "twin-9"}
    assert all(15 <= trials <= 18 for trials in sweep.trials)


def test_sites_are_names_and_generated_flats_in_any_order() -> None:
    assert read_sites("lab.yaml,twins:0-2,7,apartment,twin:9") == (
        "lab.yaml", "twin:0", "twin:1", "twin:2", "twin:7", "apartment", "twin:9",
    )  # fmt: skip


def test_a_generated_flat_is_a_site_of_its_own() -> None:
    assert named_site("twin:3").name == "twin-3"
    assert named_site("apartment").name == "apartment"


@pytest.mark.parametrize(
    ("models", "seeds", "sites", "line"),
    [
        ("forward,typo", None, None, "no model 'typo'"),
        ("forward", "0-x", None, "cannot read '0-x' in --seeds"),
        ("forward", "5-2", None, "the range 5-2 in --seeds 5-2 is empty"),
        ("forward", "0-99999999999", None, "has too many or too large numbers"),
        ("forward", "0-99999", "twins:0-9", "more than 100,000"),
        ("forward", None, "apartment,", "cannot read --sites"),
        ("forward", None, "twins:x", "cannot read 'x' in --sites twins:x: give numbers and ranges, like twins:0-19"),
        ("forward", None, "apartment,twins", "cannot read '' in --sites apartment,twins: give numbers and ranges"),
        ("forward", None, "twins:5-2", "the range 5-2 in --sites twins:5-2 is empty"),
        ("forward", None, "nowhere", "no site 'nowhere'"),
    ],
)
def test_what_cannot_be_swept_is_refused_before_anything_runs(
    models: str, seeds: str | None, sites: str | None, line: str
) -> None:
    with pytest.raises((UsageError, SiteError), match=line):
        plan_sweep(REQUEST, models, seeds, sites)


def test_a_sweep_is_simulated() -> None:
    from dataclasses import replace

    with pytest.raises(UsageError, match="is not simulated"):
        plan_sweep(replace(REQUEST, robot="turtlebot2"), "forward", "0-1", None)
    with pytest.raises(UsageError, match="--weights is for one model"):
        plan_sweep(replace(REQUEST, model_options={"weights": "x"}), "forward,random", None, None)
    with pytest.raises(UsageError, match="no goal category 'zebra'"):
        plan_sweep(replace(REQUEST, goals=("zebra",)), "forward", "0-1", None)


def test_what_it_costs_comes_from_the_records_own_pace_and_leaves_out_what_is_done() -> None:
    sweep = plan_sweep(REQUEST, "forward,random", "0-1", None)
    guessed = cost_of(sweep, NO_PACE)
    assert (guessed.campaigns, guessed.trials, guessed.done, guessed.known_from) == (4, 60, 0, 0)
    assert math.isclose(guessed.seconds, 60 * UNKNOWN_PACE_S / 2 + STARTUP_S + 3 * NEXT_STARTUP_S)
    pace = Pace({"forward": (1.0, 40), "random": (5.0, 9)}, {("forward", "apartment", 0): 15})
    known = cost_of(sweep, pace)
    assert (known.trials, known.done, known.known_from) == (60, 15, 40)
    assert math.isclose(known.seconds, (15 * 1.0 + 30 * 5.0) / 2 + STARTUP_S + 3 * NEXT_STARTUP_S)
