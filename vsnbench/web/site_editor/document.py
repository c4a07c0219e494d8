"""Edits a site file entry by entry, so that unchanged text keeps its comments and layout.

ruamel.yaml gives the position of each entry in the text. Only entries that changed are written again.
"""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from vsnbench.errors import SiteError
from vsnbench.files.atomic import write_atomic
from vsnbench.settings.yaml_file import MAX_CHARACTERS, parse_plain

LISTS: Final = ("rooms", "walls", "doors", "windows", "objects", "starts", "goals")
SCALARS: Final = ("name", "title", "ceiling_height_m", "survey_error_m")
INDEX: Final = "_index"
"""Field that the page adds to an entry: its index in the text that was sent to the page."""
_DECIMALS = 4

Content = dict[str, Any]


@dataclass(frozen=True, slots=True)
class SiteDocument:
    """The text of a site file and its content."""

    text: str
    content: Content

    @classmethod
    def of(cls, text: str, origin: str) -> "SiteDocument":
        """Parse a text. It may break other rules of the site format.

        Raises:
            SiteError: it is not a mapping with lists of mappings.
        """
        content = parse_plain(text, origin, SiteError, "site")
        for name in LISTS:
            entries = content.get(name)
            if entries is not None and not (isinstance(entries, list) and all(isinstance(e, dict) for e in entries)):
                raise SiteError(
                    f"{origin}: {name} is not a list of entries", advice="correct it in a text editor first"
                )
        return cls(text, content)

    @classmethod
    def new(cls, name: str) -> "SiteDocument":
        """Return an empty site."""
        text = (
            "# Metres; x to the right, y up on the plan; headings in degrees, counter-clockwise from x.\n"
            f"name: {name}\nceiling_height_m: 2.5\n\nrooms: []\n\nwalls: []\n\ndoors: []\n\nwindows: []\n\n"
            "objects: []\n\nstarts: []\n"
        )
        return cls.of(text, name)

    @property
    def sha256(self) -> str:
        """Hash of the text, to detect changes by other programs."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def as_json(self) -> Content:
        """Return the content, with the index of every entry."""
        listed = {name: self.content.get(name) or [] for name in LISTS}
        indexed = {name: [{**entry, INDEX: i} for i, entry in enumerate(entries)] for name, entries in listed.items()}
        return json.loads(json.dumps({**self.content, **indexed}, default=str))  # type: ignore[no-any-return]

    def with_content(self, wanted: Content) -> "SiteDocument":
        """Return the document with the page's content. Equal parts keep their text.

        Raises:
            SiteError: the content is too long for a site file.
        """
        tree = YAML(typ="safe", pure=True).compose(self.text)
        if not isinstance(tree, MappingNode):
            raise SiteError("a site file must be a mapping")
        nodes = {key.value: (key, value) for key, value in tree.value}
        changes: list[tuple[int, int, str]] = []
        added = ""
        for name in SCALARS:
            if name in wanted and wanted[name] != self.content.get(name):
                if name in nodes:
                    changes.append(self._value_change(*nodes[name], wanted[name]))
                elif wanted[name] not in ("", None):
                    added += f"{name}: {_flow(wanted[name])}\n"
        for name in LISTS:
            entries = wanted.get(name) or []
            if name in nodes:
                changes += self._list_changes(name, nodes[name], entries)
            elif entries:
                added += f"\n{name}:\n" + "".join(f"  - {_flow(_plain(entry))}\n" for entry in entries)
        text = self.text
        for start, end, new in sorted(changes, reverse=True):
            text = text[:start] + new + text[end:]
        if added:
            text = text.rstrip("\n") + "\n" + added
        if len(text) > MAX_CHARACTERS:
            raise SiteError(f"a site file can have {MAX_CHARACTERS:,} characters; this one has {len(text):,}")
        return SiteDocument.of(text, str(wanted.get("name", "site")))

    def _list_changes(self, name: str, nodes: tuple[Node, Node], entries: list[Content]) -> list[tuple[int, int, str]]:
        key, value = nodes
        before: list[Content] = self.content.get(name) or []
        indices = [entry.get(INDEX) for entry in entries]
        indices = [index if isinstance(index, int) and 0 <= index < len(before) else None for index in indices]
        new = [_plain(entry) for entry, index in zip(entries, indices, strict=True) if index is None]
        kept = [index for index in indices if index is not None]
        is_block = isinstance(value, SequenceNode) and not value.flow_style and len(value.value) == len(before) > 0
        if not is_block or kept != sorted(set(kept)):
            if [_plain(entry) for entry in entries] == before:
                return []
            lines = "".join(f"\n  - {_flow(_plain(entry))}" for entry in entries)
            start, end = (key.end_mark.index, key.end_mark.index) if _is_empty(value) else _span(value)
            if _is_empty(value):
                return [(start + 1, start + 1, lines)] if entries else []
            return [
                (key.end_mark.index, end, f":{lines}" + ("\n" if is_block else "")) if lines else (start, end, "[]")
            ]
        changes = []
        for index, node in enumerate(value.value):
            if index not in kept:
                changes.append((*self._whole_lines(node), ""))
                continue
            entry = _plain(next(entry for entry, i in zip(entries, indices, strict=True) if i == index))
            if entry != before[index]:
                changes += self._entry_changes(node, before[index], entry)
        if not kept:
            # YAML reads a list without entries as null.
            start = self._whole_lines(value.value[0])[0]
            end = self._whole_lines(value.value[-1])[1]
            body = "".join(f"  - {_flow(entry)}\n" for entry in new)
            return [(key.end_mark.index, end, ":\n" + body if new else ": []\n")] if start > 0 else []
        if new:
            last = self._whole_lines(value.value[-1])
            indent = " " * self._column_of_dash(value.value[-1])
            body = "".join(f"{indent}- {_flow(entry)}\n" for entry in new)
            ends_line = self.text[: last[1]].endswith("\n")
            changes.append((last[1], last[1], body if ends_line else "\n" + body.rstrip("\n")))
        return changes

    def _entry_changes(self, node: MappingNode, before: Content, entry: Content) -> list[tuple[int, int, str]]:
        """Change only the fields that differ, if the entry itself contains them."""
        written = {key.value: (key, value) for key, value in node.value}
        changed = {name: entry[name] for name in entry if name not in before or entry[name] != before[name]}
        removed = set(before) - set(entry)
        start, end = _span(node)
        is_explicit = all(
            start <= value.start_mark.index and value.end_mark.index <= end for _, value in written.values()
        )
        if removed or not is_explicit or any(name in before and name not in written for name in changed):
            text = self.text[start:end]
            trailing = text[len(text.rstrip()) :] if not node.flow_style else ""
            return [(start, end, _flow(entry) + trailing)]
        changes = [self._value_change(*written[name], value) for name, value in changed.items() if name in written]
        added = {name: value for name, value in changed.items() if name not in written}
        if added:
            _, last = node.value[-1]
            at = _end_of(self.text, last)
            indent = "\n" + " " * node.start_mark.column
            parts = [f"{name}: {_flow(value)}" for name, value in added.items()]
            text = "".join(f", {part}" for part in parts) if node.flow_style else "".join(indent + p for p in parts)
            if not node.flow_style:
                line_end = self.text.find("\n", at)
                at = len(self.text) if line_end < 0 else line_end  # after a comment that follows the last field
            changes.append((at, at, text))
        return changes

    def _value_change(self, key: Node, value: Node, new: Any) -> tuple[int, int, str]:
        """Replace the value of a field. A value on lines of its own moves to the line of its field."""
        start, end = value.start_mark.index, _end_of(self.text, value)
        if self.text.find("\n", key.end_mark.index, start) >= 0:
            start = self.text.index(":", key.end_mark.index) + 1
            return start, end, " " + _flow(new)
        return start, end, _flow(new)

    def _column_of_dash(self, node: Node) -> int:
        line = self.text.rfind("\n", 0, node.start_mark.index) + 1
        dash = self.text.find("-", line)
        return dash - line if 0 <= dash < node.start_mark.index else max(node.start_mark.column - 2, 0)

    def _whole_lines(self, node: Node) -> tuple[int, int]:
        """Return the span of an entry's lines, with a comment at the end of the last line."""
        start = self.text.rfind("\n", 0, node.start_mark.index) + 1
        end = self.text.find("\n", _end_of(self.text, node))
        return start, len(self.text) if end < 0 else end + 1


def save_document(document: SiteDocument, path: Path, last_sha256: str | None) -> None:
    """Write a document atomically, unless another program has changed the file.

    Args:
        document: the new text.
        path: the site file.
        last_sha256: hash of the file when it was read; None if it did not exist.

    Raises:
        SiteError: `changed-meanwhile`, the file was changed; or it cannot be read or written.
    """
    try:
        current = hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else None
    except OSError as error:
        raise SiteError(f"cannot read {path}: {error.strerror or error}") from error
    if current not in (last_sha256, document.sha256):
        raise SiteError(f"another program has changed {path}", advice="reload the page first", code="changed-meanwhile")
    write_atomic(path, document.text.encode(), SiteError)


def _is_empty(node: Node) -> bool:
    return bool(node.start_mark.index == node.end_mark.index)


def _span(node: Node) -> tuple[int, int]:
    return node.start_mark.index, node.end_mark.index


def _end_of(text: str, node: Node) -> int:
    """Return the end of an entry's text. The end mark of a block node is the start of the next one."""
    if isinstance(node, MappingNode) and not node.flow_style and node.value:
        return _end_of(text, node.value[-1][1])
    if isinstance(node, SequenceNode) and not node.flow_style and node.value:
        return _end_of(text, node.value[-1])
    if isinstance(node, ScalarNode) and node.style in ("|", ">"):
        start = int(node.start_mark.index)
        return start + len(text[start : node.end_mark.index].rstrip())
    return int(node.end_mark.index)


def _plain(entry: Content) -> Content:
    """Return an entry without the page's own fields and empty ones, with lengths rounded to 0.1 mm."""
    return {name: _rounded(value) for name, value in entry.items() if not name.startswith("_") and value is not None}


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        rounded = round(value, _DECIMALS) + 0.0
        return int(rounded) if rounded == int(rounded) and abs(rounded) < 1e9 else rounded
    if isinstance(value, list):
        return [_rounded(item) for item in value]
    if isinstance(value, dict):
        return {name: _rounded(item) for name, item in value.items()}
    return value


def _flow(value: Any) -> str:
    """Return a value as YAML on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{name}: {_flow(item)}" for name, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_flow(item) for item in value) + "]"
    if isinstance(value, str) and value.replace("_", "").replace("-", "").isalnum() and not _needs_quotes(value):
        return value
    return json.dumps(_rounded(value), ensure_ascii=False)


def _needs_quotes(text: str) -> bool:
    try:
        return bool(YAML(typ="safe", pure=True).load(text) != text)
    except YAMLError:
        return True
