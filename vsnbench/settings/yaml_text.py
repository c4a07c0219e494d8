"""Plain values to YAML text and back."""

import io
from typing import Any

_LONGEST_LINE = 10_000


def load_yaml(text: str) -> Any:
    """Return the content of trusted YAML text; see `yaml_file` for files of users.

    Raises:
        ruamel.yaml.error.YAMLError: the text is not valid YAML.
    """
    from ruamel.yaml import YAML

    return YAML(typ="safe", pure=True).load(text)


def dump_yaml(content: Any, *, one_line: bool = False) -> str:
    """Return plain values as YAML text without a final line break.

    Args:
        content: mappings in their order, lists, text, numbers, truth values and None.
        one_line: whether to write everything in one line, with braces and brackets.
    """
    from ruamel.yaml import YAML

    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = one_line
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    if one_line:
        yaml.width = _LONGEST_LINE
    text = io.StringIO()
    yaml.dump(content, text)
    return text.getvalue().rstrip()
