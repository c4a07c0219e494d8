"""Words of a command line before they are parsed."""

import pytest

from vsnbench.cli.support.words import mark_missing_values


@pytest.mark.parametrize(
    ("words", "marked"),
    [
        ("run --console", "run --console="),
        ("run --console --live", "run --console= --live"),
        ("run --console 0.0.0.0:8710 --live", "run --console 0.0.0.0:8710 --live"),
        ("run --console :9000", "run --console :9000"),
        ("run --console 192.168.1.5", "run --console 192.168.1.5"),
        ("run --console [::1]:80", "run --console [::1]:80"),
        ("study run --console study.yaml", "study run --console= study.yaml"),
        ("run --isolate", "run --isolate="),
        ("run --isolate ~/env/bin/python -g bed", "run --isolate ~/env/bin/python -g bed"),
        ("run --isolate --goal bed", "run --isolate= --goal bed"),
        ("run -- --console", "run -- --console"),
    ],
)
def test_options_with_an_optional_value_are_complete(words: str, marked: str) -> None:
    assert mark_missing_values(words.split()) == marked.split()
