"""The wheel contains the package data under the names that the code uses."""

import tomllib
from pathlib import Path

from vsnbench.files import package_data

ROOT = Path(__file__).parents[2]


def test_the_wheel_takes_every_directory_that_a_checkout_has() -> None:
    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert wheel["packages"] == ["vsnbench"]
    packaged = {path: f"vsnbench/_data/{name}" for name, path in package_data._IN_CHECKOUT.items()}
    assert wheel["force-include"] == packaged
    for path in wheel["force-include"]:
        assert any((ROOT / path).iterdir()), path
