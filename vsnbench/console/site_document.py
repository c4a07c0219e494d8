"""A site file as text that is corrected entry by entry: what nobody touched stays as it was, comments and all.

ruamel.yaml says where in the text each entry begins and ends; only the text of entries that changed is written anew.
"""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.nodes import MappingNode, Node, SequenceNode

from vsnbench.errors import SiteError
from vsnbench.protocol.settings_file import MOST_CHARACTERS, parse_plain
from vsnbench.whole_files import write_whole

LISTS: Final = ("rooms", "walls", "doors", "windows", "objects", "starts")
SCALARS: Final = ("name", "title", "ceiling_height_m", "survey_error_m")
WAS: Final = "_was"
"""In an entry of the page: its place, from 0, in the text that the page was given."""
_DECIMALS = 4

Content = dict[str, Any]


@dataclass(frozen=True, slots=True)
class SiteDocument:
    """The text of a site file, and what it says."""

    text: str
    content: Content

    @classmethod
    def of(cls, text: str, origin: str) -> "SiteDocument":
        """Read a text; it may break the format of a site, but must be a mapping with lists of mappings.

        Raises:
            SiteError: it is not; the message names the line.
        """
        content = parse_plain(text, origin, SiteError, "site")
        for name in LISTS:
            entries = content.get(name)
            if entries is not None and not (isinstance(entries, list) and all(isinstance(e, dict) for e in entries)):
                raise SiteError(f"{origin}: {name} is no list of entries", advice="mend it in a text editor first")
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
        """Hash of the text: whether the file is still what the page was given."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def for_page(self) -> Content:
        """Return the content with every entry's place in the text."""
        listed = {name: self.content.get(name) or [] for name in LISTS}
        plain = {name: [{**entry, WAS: place} for place, entry in enumerate(each)] for name, each in listed.items()}
        return json.loads(json.dumps({**self.content, **plain}, default=str))  # type: ignore[no-any-return]

    def with_content(self, wanted: Content) -> "SiteDocument":
        """Return the document with the page's content; what is equal keeps its text.

        Raises:
            SiteError: the content is too long for a site file.
        """
        tree = YAML(typ="safe", pure=True).compose(self.text)
        if not isinstance(tree, MappingNode):
            raise SiteError("a site file is a mapping")
        nodes = {key.value: (key, value) for key, value in tree.value}
        changes: list[tuple[int, int, str]] = []
        added = ""
        for name in SCALARS:
            if name in wanted and wanted[name] != self.content.get(name):
                if name in nodes:
                    changes.append((*_span(nodes[name][1]), _flow(wanted[name])))
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
        if len(text) > MOST_CHARACTERS:
            raise SiteError(f"a site file has at most {MOST_CHARACTERS:,} characters, this one {len(text):,}")
        return SiteDocument.of(text, str(wanted.get("name", "site")))

    def _list_changes(self, name: str, nodes: tuple[Node, Node], entries: list[Content]) -> list[tuple[int, int, str]]:
        key, value = nodes
        before: list[Content] = self.content.get(name) or []
        kept = [entry.get(WAS) for entry in entries]
        kept = [place if isinstance(place, int) and 0 <= place < len(before) else None for place in kept]
        fresh = [_plain(entry) for entry, place in zip(entries, kept, strict=True) if place is None]
        places = [place for place in kept if place is not None]
        block = isinstance(value, SequenceNode) and not value.flow_style and len(value.value) == len(before) > 0
        if not block or places != sorted(set(places)):
            if [_plain(entry) for entry in entries] == before:
                return []
            lines = "".join(f"\n  - {_flow(_plain(entry))}" for entry in entries)
            start, end = (key.end_mark.index, key.end_mark.index) if _is_nothing(value) else _span(value)
            if _is_nothing(value):
                return [(start + 1, start + 1, lines)] if entries else []
            return [(key.end_mark.index, end, f":{lines}" + ("\n" if block else "")) if lines else (start, end, "[]")]
        changes = []
        for place, node in enumerate(value.value):
            if place not in places:
                changes.append((*self._whole_lines(node), ""))
                continue
            entry = _plain(next(entry for entry, was in zip(entries, kept, strict=True) if was == place))
            if entry != before[place]:
                changes += self._entry_changes(node, before[place], entry)
        if not places:
            # The list would be left without an entry, which YAML reads as nothing.
            start = self._whole_lines(value.value[0])[0]
            end = self._whole_lines(value.value[-1])[1]
            body = "".join(f"  - {_flow(entry)}\n" for entry in fresh)
            return [(key.end_mark.index, end, ":\n" + body if fresh else ": []\n")] if start > 0 else []
        if fresh:
            last = self._whole_lines(value.value[-1])
            indent = " " * self._column_of_dash(value.value[-1])
            body = "".join(f"{indent}- {_flow(entry)}\n" for entry in fresh)
            ends_line = self.text[: last[1]].endswith("\n")
            changes.append((last[1], last[1], body if ends_line else "\n" + body.rstrip("\n")))
        return changes

    def _entry_changes(self, node: MappingNode, before: Content, entry: Content) -> list[tuple[int, int, str]]:
        """Change only the fields that differ, where each is written out in the entry itself."""
        written = {key.value: (key, value) for key, value in node.value}
        changed = {name: entry[name] for name in entry if name not in before or entry[name] != before[name]}
        gone = set(before) - set(entry)
        start, end = _span(node)
        inside = all(start <= value.start_mark.index and value.end_mark.index <= end for _, value in written.values())
        if gone or not inside or any(name in before and name not in written for name in changed):
            text = self.text[start:end]
            trailing = text[len(text.rstrip()) :] if not node.flow_style else ""
            return [(start, end, _flow(entry) + trailing)]
        changes = [(*_span(written[name][1]), _flow(value)) for name, value in changed.items() if name in written]
        fresh = {name: value for name, value in changed.items() if name not in written}
        if fresh:
            _, last = node.value[-1]
            at = _span(last)[1]
            indent = "\n" + " " * node.start_mark.column
            parts = [f"{name}: {_flow(value)}" for name, value in fresh.items()]
            new = "".join(f", {part}" for part in parts) if node.flow_style else "".join(indent + p for p in parts)
            if not node.flow_style:
                line_end = self.text.find("\n", at)
                at = len(self.text) if line_end < 0 else line_end  # after a comment behind the last field
            changes.append((at, at, new))
        return changes

    def _column_of_dash(self, node: Node) -> int:
        line = self.text.rfind("\n", 0, node.start_mark.index) + 1
        dash = self.text.find("-", line)
        return dash - line if 0 <= dash < node.start_mark.index else max(node.start_mark.column - 2, 0)

    def _whole_lines(self, node: Node) -> tuple[int, int]:
        """Return the lines of an entry: from its dash to the end of its last line, a comment behind it included."""
        start = self.text.rfind("\n", 0, node.start_mark.index) + 1
        end = self.text.find("\n", _end_of(self.text, node))
        return start, len(self.text) if end < 0 else end + 1


def save_document(document: SiteDocument, path: Path, last_sha256: str | None) -> None:
    """Write a document's file whole, where nobody else has changed the file since.

    Raises:
        SiteError: somebody has, or it cannot be written.
    """
    try:
        there = hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else None
    except OSError as error:
        raise SiteError(f"cannot read {path}: {error.strerror or error}") from error
    if there != last_sha256 and there != document.sha256:
        raise SiteError(f"{path} was changed by somebody else since it was opened", advice="reload the page first")
    write_whole(path, document.text.encode(), SiteError)


def _is_nothing(node: Node) -> bool:
    return bool(node.start_mark.index == node.end_mark.index)


def _span(node: Node) -> tuple[int, int]:
    return node.start_mark.index, node.end_mark.index


def _end_of(text: str, node: Node) -> int:
    """Return where an entry's own text ends: a block node's mark is where the next one begins."""
    if isinstance(node, MappingNode) and not node.flow_style and node.value:
        return _end_of(text, node.value[-1][1])
    if isinstance(node, SequenceNode) and not node.flow_style and node.value:
        return _end_of(text, node.value[-1])
    return int(node.end_mark.index)


def _plain(entry: Content) -> Content:
    """Return an entry as it is written: no word of the page, no empty field, lengths to a tenth of a millimetre."""
    return {name: _rounded(value) for name, value in entry.items() if not name.startswith("_") and value is not None}


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        rounded = round(value, _DECIMALS) + 0.0
        return int(rounded) if rounded == int(rounded) and abs(rounded) < 1e9 else rounded
    if isinstance(value, list):
        return [_rounded(each) for each in value]
    return value


def _flow(value: Any) -> str:
    """Return a value as YAML in one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{name}: {_flow(each)}" for name, each in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_flow(each) for each in value) + "]"
    if isinstance(value, str) and value.replace("_", "").replace("-", "").isalnum() and not _reads_otherwise(value):
        return value
    return json.dumps(_rounded(value), ensure_ascii=False)


def _reads_otherwise(text: str) -> bool:
    try:
        return bool(YAML(typ="safe", pure=True).load(text) != text)
    except YAMLError:
        return True
