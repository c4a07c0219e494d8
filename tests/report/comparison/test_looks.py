"""Looks at comparisons: recorded when the results are new, and never trusted when they are read back."""

import json
from pathlib import Path

import pytest

from tests.report.records import Attempt, Lab
from vsnbench.errors import RecordError
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.summary import summarise
from vsnbench.report.build import read
from vsnbench.report.checklist import checklist
from vsnbench.report.comparison.compare import Comparison, compare
from vsnbench.report.comparison.looks import LOOKS_FILE, looks_at, looks_sentences, with_looks
from vsnbench.report.tables.comparison import COMPARISON, comparison_tables


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    """A record of two models from 15 starting positions."""
    lab = Lab(tmp_path)
    run(lab, seed=0)
    return lab


def run(lab: Lab, seed: int) -> None:
    for model, limit in (("a", 8), ("b", 5)):
        lab.write([Attempt(start=start, success=start <= limit) for start in range(1, 16)], model=model, seed=seed)


def compared(lab: Lab, *names: str) -> Comparison:
    record = read(lab.url, Selection())
    (one,) = compare(record, summarise(record), names or ("a", "b"), with_power=False)
    return one


def looked(lab: Lab, *names: str) -> Comparison:
    """Return a comparison as `vsnbench compare` shows it."""
    (shown,), problem = with_looks([compared(lab, *names)], lab.directory)
    assert problem == ""
    return shown


def test_a_look_is_one_with_new_results_whichever_model_is_named_first(lab: Lab) -> None:
    first = looked(lab)
    assert first.looks == ((15, 15),)
    assert looks_sentences(first.looks) == ()
    assert looked(lab).looks == looked(lab, "b", "a").looks == ((15, 15),)
    run(lab, seed=1)
    second = looked(lab)
    assert second.looks == ((15, 15), (30, 30))
    (words,) = looks_sentences(second.looks)
    assert words.startswith("Look 2 at these two with new results; earlier ones at 15 : 15 episodes.")
    assert words in comparison_tables(second)[0].notes
    assert COMPARISON.fields(second)["looks"] == [[15, 15], [30, 30]]
    assert "looks" not in COMPARISON.fields(compared(lab)), "a report is not counted"


LINES = (
    b"no JSON\n",
    b"[" * 100_000 + b"\n",
    b'{"comparison": 3}\n',
    b"\xff\xfe\n",
    b'{"comparison": "COMPARISON", "outcomes": "x", "episodes": [1, 1]}\n',
    b'{"comparison": "COMPARISON", "outcomes": "%s", "episodes": [1, -1]}\n' % (b"0" * 64),
    b'{"comparison": "COMPARISON", "outcomes": "%s", "episodes": [1, true]}\n' % (b"0" * 64),
    b'{"comparison": "COMPARISON", "outcomes": "%s", "episodes": [1, 1%s]}\n' % (b"0" * 64, b"0" * 400),
    b'{"comparison": "COMPARISON", "outcomes": "%s", "episodes": [1, 2, 3]}\n' % (b"0" * 64),
)
"""Lines of another writer."""


def test_lines_that_are_no_looks_are_ignored(lab: Lab) -> None:
    looked(lab)
    file = lab.directory / LOOKS_FILE
    mine = file.read_bytes()
    known = json.loads(mine)["comparison"].encode()
    for line in LINES:
        file.write_bytes(line.replace(b"COMPARISON", known) + mine)
        assert looks_at(compared(lab), lab.directory) == ((15, 15),), line


def test_a_file_that_is_too_long_or_none_is_refused_in_one_line(lab: Lab) -> None:
    (lab.directory / LOOKS_FILE).write_bytes(b"\n" * 4_000_001)
    with pytest.raises(RecordError) as refused:
        looked(lab)
    assert refused.value.code == "looks-too-long"
    (lab.directory / LOOKS_FILE).unlink()
    (lab.directory / LOOKS_FILE).mkdir()
    with pytest.raises(RecordError):
        looked(lab)


def test_a_look_that_cannot_be_written_is_shown_with_the_reason(lab: Lab, tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    (lab.directory / LOOKS_FILE).symlink_to(outside)
    (shown,), problem = with_looks([compared(lab)], lab.directory)
    assert shown.looks == ((15, 15),)
    assert "this look is not recorded" in problem
    assert not outside.exists()


def test_the_checklist_says_what_the_record_answers_and_what_is_open(lab: Lab) -> None:
    looked(lab)
    run(lab, seed=1)
    looked(lab)
    text = checklist(lab.url, Selection(), lab.directory, as_latex=False)
    assert "- [x] **Criteria of success**" in text
    assert "success is STOP under 1 m from the goal without a collision" in text
    assert "a: 30 of 30 planned trials; goals chair; 15 starting positions" in text
    assert "- [ ] **Number of looks and stopping rule**" in text
    assert "a and b were compared outside of a plan 2 times with new results, at 15 : 15, 30 : 30 episodes." in text
    assert "- [ ] **Order of trials**" in text
    assert "Trials outside of a study: not blind." in text
    assert "goals without a trial: " in text
    assert "arXiv:2409.09491" in text
    written = checklist(lab.url, Selection(), lab.directory, as_latex=True)
    assert written.count(r"\item[{") == 13
    assert r"\begin{enumerate}" in written
    assert "“" not in written
