"""Studies for tests: a small study and its variations."""

from typing import Any

from vsnbench.settings.yaml_text import dump_yaml
from vsnbench.study.file import StudyFile, parse_study


def study_text(**changes: Any) -> str:
    """Return the text of a small study; None omits a field."""
    content: dict[str, Any] = {
        "title": "Which of two?",
        "question": "Which one succeeds more often?",
        "arms": {"one": {"model": "random"}, "two": {"model": "forward"}},
        "goals": ["bed", "chair"],
        "starting_positions": "1-4",
        "seed": 7,
    }
    return dump_yaml({name: value for name, value in (content | changes).items() if value is not None})


def small_study(**changes: Any) -> StudyFile:
    """Return a small study."""
    return parse_study(study_text(**changes), "study.yaml")
