"""Every command's --json output is as docs/schemas describes it, with no key that is not described."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from typer.main import get_command

from scripts.json_schemas import read_schemas, schemas
from tests.cli.console import vsnbench_process
from tests.docs.json_coverage import parts_without_a_value
from tests.docs.json_outputs import COMMANDS, QUICK, SCHEMAS, collect, faults, name_of
from tests.golden.__main__ import frozen
from vsnbench.cli.main import VERBS, build_app

ELSEWHERE = {"robots calibrate": "tests/robots/calibrating.py, with ROS"}
"""Command -> where its output is compared with its schema."""
WITHOUT_A_VALUE = {
    "$movement#0.holds_heading": "a motion adapter receives it",
    "$summary.interventions": "a stack that drives itself",
    "$summary.oracle_success": "a stack that drives itself",
    "doctor.machine.browser": "depends on the machine",
    "doctor.machine.gpus[]": "depends on the machine",
    "doctor.machine.ros[]": "depends on the machine",
    "doctor.machine.torch_uses_gpu": "depends on the machine",
    "episodes show.events[].step_number": "an intervention in a drive",
    "judge#3": "test_the_page_of_a_second_rater_is_as_its_schema_says",
    "models check#1.camera_differences[].actual#1": "a robot with another resolution",
    "models check#1.camera_differences[].trained#1": "a robot with another resolution",
    "models check#1.warning": "an engine that differs from the reference",
    "models fetch.licence": "the network",
    "models list[]#1": "a broken plug-in",
    "place.moved[]": "a room that differs from its site file",
    "place.undetermined[]": "a room with too few walls",
    "protocol list[].max_path_m": "no named protocol has this limit",
    "report#2.problems[]": "a video that cannot be written",
    "stress.models[].disturbances[].effects[].ci_high": "known paths of several starting positions",
    "stress.models[].disturbances[].effects[].ci_low": "known paths of several starting positions",
    "study report#0.primary.answers[].means": "a study on progress",
    "study report#0.primary.dropped{}": "a long study with three arms",
    "study report#0.primary.looked[]": "a study that is analysed at looks",
    "study report#0.primary.looks[]": "a study that is analysed at looks",
    "study run.suspended[]": "a model that stops working",
    "study status.looked[]": "a study that is analysed at looks",
    "study status.looks[]": "a study that is analysed at looks",
    "try.trials[].blocked_at": "a model that drives at furniture",
    "try.trials[].same_action": "a model that turns for ever",
}
"""Part of a schema that the commands have no value of -> what it needs."""
NAMES = sorted({name_of(line) for line in COMMANDS.splitlines() if line})


def commands_with_json() -> Iterator[str]:
    for verb in VERBS:
        command: Any = get_command(build_app(verb)).commands[verb]  # type: ignore[attr-defined]
        for name, own in getattr(command, "commands", {"": command}).items():
            if any("--json" in parameter.opts for parameter in own.params):
                yield f"{verb} {name}".strip()


def file_of(command: str) -> str:
    return command.replace(" ", "-")


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("lab")


@pytest.fixture(scope="module")
def outputs(lab: Path) -> dict[str, list[Any]]:
    return collect(lab)


def test_every_command_with_json_has_a_schema_and_every_schema_a_command() -> None:
    commands = set(commands_with_json())
    assert {path.stem for path in SCHEMAS.glob("*.json")} == {
        *map(file_of, commands),
        "headline",
        "common",
        "motion-adapter",
    }
    assert set(NAMES) | ELSEWHERE.keys() == commands
    text = "".join(page.read_text(encoding="utf-8") for page in SCHEMAS.parent.glob("*.md"))
    assert set(re.findall(r"\(schemas/([\w-]+)\.json\)", text)) == {path.stem for path in SCHEMAS.glob("*.json")}


@pytest.mark.parametrize("path", sorted(SCHEMAS.glob("*.json")), ids=lambda path: path.stem)
def test_a_schema_is_valid_and_refers_to_objects_that_exist(path: Path) -> None:
    schema = json.loads(path.read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(schema)
    defined = json.loads((SCHEMAS / "common.json").read_text(encoding="utf-8"))["$defs"]
    assert set(re.findall(r"common\.json#/\$defs/(\w+)", json.dumps(schema))) <= defined.keys()


def test_the_schemas_of_declared_objects_are_up_to_date() -> None:
    written = read_schemas()
    generated = schemas(written)
    assert {file: written[file] for file in generated} == generated, "run `python scripts/json_schemas.py`"


def objects_of(schema: Any) -> Iterator[dict[str, Any]]:
    """Yield the properties of every object in a schema."""
    if isinstance(schema, dict) and isinstance(schema.get("properties"), dict):
        yield schema["properties"]
    for part in schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ():
        yield from objects_of(part)


@pytest.mark.parametrize("path", sorted(SCHEMAS.glob("*.json")), ids=lambda path: path.stem)
def test_every_property_has_a_description_of_its_own(path: Path) -> None:
    for properties in objects_of(json.loads(path.read_text(encoding="utf-8"))):
        descriptions = [part.get("description") for part in properties.values()]
        assert all(descriptions), properties.keys()
        assert len(set(descriptions)) == len(descriptions), descriptions


def test_frozen_outputs_are_as_their_schemas_say() -> None:
    """Golden outputs are what the commands print of frozen records."""
    found = {}
    for line, text in frozen("outputs").items():
        printed = text.partition("\n")[2]
        if re.search(r" --(json|format json)\b[^:]*$", line) and printed.startswith(("{", "[")):
            found[line] = faults(file_of(name_of(line)), json.JSONDecoder().raw_decode(printed)[0])
    assert len(found) >= 15
    assert {line: wrong for line, wrong in found.items() if wrong} == {}


def test_outputs_of_quick_commands_are_as_their_schemas_say(tmp_path: Path) -> None:
    found = collect(tmp_path, QUICK)
    assert [fault for name in found for value in found[name] for fault in faults(file_of(name), value)] == []


@pytest.mark.timeout(900)
@pytest.mark.parametrize("command", [*NAMES, "headline"])
def test_the_output_of_a_command_is_as_its_schema_says(command: str, outputs: dict[str, list[Any]]) -> None:
    assert [fault for value in outputs[command] for fault in faults(file_of(command), value)] == []


def test_every_part_of_a_schema_is_compared_with_a_value(outputs: dict[str, list[Any]]) -> None:
    assert parts_without_a_value(outputs) - WITHOUT_A_VALUE.keys() == set()


def test_times_are_in_iso_8601(outputs: dict[str, list[Any]]) -> None:
    text = json.dumps(outputs)
    assert re.search(r'"\d{4}-\d\d-\d\dT\d\d:\d\d:', text)
    assert re.search(r'"\d{4}-\d\d-\d\d \d\d:\d\d:[^"]*"', text) is None


def test_the_page_of_a_second_rater_is_as_its_schema_says(outputs: dict[str, list[Any]], lab: Path) -> None:
    assert outputs
    words = ["judge", "--second", "Grace", "--port", "0", "--json", "--results", str(lab / "rich")]
    with vsnbench_process(words) as process:
        assert process.stdout is not None
        text = ""
        for line in process.stdout:
            text += line
            if line == "}\n":
                break
        value = json.loads(text)
    assert value["address"].startswith("http")
    assert faults("judge", value) == []


def test_a_new_key_and_a_changed_type_are_faults() -> None:
    good = {"files": ["a"], "kept": []}
    assert faults("init", good) == []
    assert len(faults("init", good | {"more": 1})) == 1
    assert len(faults("init", good | {"kept": None})) == 1
    assert len(faults("init", {"files": []})) == 1
