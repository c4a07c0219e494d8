"""A lab's defaults: flag, environment, file; and a file that says what it may not."""

from pathlib import Path

import pytest

from vsnbench.errors import UsageError
from vsnbench.lab_file import FILE_NAME, lab_defaults, read_lab_file, take_lab_defaults


def by_name(directory: Path, environment: dict[str, str]) -> dict[str, tuple[str, str]]:
    return {each.name: (each.value, each.source) for each in lab_defaults(directory, environment)}


def test_the_environment_comes_before_the_file_and_the_nearest_file_counts(tmp_path: Path) -> None:
    file = tmp_path / FILE_NAME
    file.write_text('site = "lab.yaml"\nrobot = "lola2"\nresults = "kept"\n')
    below = tmp_path / "a" / "b"
    below.mkdir(parents=True)
    found = by_name(below, {"VSNBENCH_ROBOT": "turtlebot2"})
    assert found["robot"] == ("turtlebot2", "VSNBENCH_ROBOT")
    assert found["site"] == (str(tmp_path / "lab.yaml"), str(file))
    assert found["results"] == (str(tmp_path / "kept"), str(file))
    assert found["operator"] == ("", "")


def test_an_embedded_site_stays_a_name(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_text('site = "apartment"\n')
    assert read_lab_file(tmp_path / FILE_NAME) == {"site": "apartment"}


def test_what_the_file_says_is_handed_on_to_processes_and_what_the_environment_says_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / FILE_NAME).write_text('site = "lab.yaml"\nrobot = "lola2"\n')
    monkeypatch.chdir(tmp_path)
    environment = {"VSNBENCH_ROBOT": "turtlebot2"}
    assert [(each.name, each.value) for each in take_lab_defaults(environment)] == [("site", "lab.yaml")]
    assert environment == {"VSNBENCH_ROBOT": "turtlebot2", "VSNBENCH_SITE": "lab.yaml"}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('robots = "lola2"', "'robots' is no default; it may say site, robot, results, operator, weights"),
        ("robot = 3", 'robot must be text in quotes: robot = "..."'),
        ('robot = ""', "robot must be text in quotes"),
        ('site = "a\\nb"', "site must be text in quotes"),
        ("robot = lola2", "line 1, column"),
        ("[" * 5000, "line 1"),
    ],
)
def test_a_file_that_cannot_be_meant_is_refused_with_its_name(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / FILE_NAME).write_text(text)
    with pytest.raises(UsageError) as refused:
        read_lab_file(tmp_path / FILE_NAME)
    assert FILE_NAME in str(refused.value)
    assert said in str(refused.value) or "[" in text
