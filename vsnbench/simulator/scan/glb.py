"""Checks of a GLB file before a parser reads it: sizes, references and extensions."""

import struct
from typing import Any, Final

from vsnbench.errors import SiteError
from vsnbench.files.bounded_json import parse_json

_MOST_JSON_BYTES = 32_000_000
_MOST_ENTRIES = 100_000
_MOST_ITEMS = 40_000_000
_MOST_NODES = 10_000
_COMPRESSED: Final = {
    "KHR_draco_mesh_compression": "Draco compression",
    "EXT_meshopt_compression": "meshopt compression",
    "KHR_meshopt_compression": "meshopt compression",
    "KHR_texture_basisu": "Basis textures (KTX2)",
}
_BYTES: Final = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_PARTS: Final = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


def check_glb(data: bytes) -> int:
    """Return the number of triangles of a GLB file, with repeated parts, from its description alone.

    Raises:
        ValueError: it is not a GLB file that is complete in itself, or describes more than it has.
        SiteError: `scan-compressed`, it has a compression that cannot be read.
    """
    if len(data) < 20 or data[:4] != b"glTF":
        raise ValueError("it is not a GLB file")
    version, _, length, kind = struct.unpack_from("<IIII", data, 4)
    if version != 2 or kind != 0x4E4F534A or not 0 < length <= min(len(data) - 20, _MOST_JSON_BYTES):
        raise ValueError("it is not a GLB file of version 2")
    try:
        content = parse_json(data[20 : 20 + length])
    except RecursionError:
        raise ValueError("its description is nested too deeply") from None
    if not isinstance(content, dict):
        raise ValueError("its description is not an object")  # noqa: TRY004 - content, not an argument
    _check_extensions(content)
    lists = {name: _list(content, name) for name in ("buffers", "bufferViews", "accessors", "meshes", "nodes")}
    for name in ("buffers", "images"):
        if any("uri" in entry and not str(entry["uri"])[:5] == "data:" for entry in _list(content, name)):
            raise ValueError("it names other files: export it with everything inside")
    counts = [_accessor(accessor, lists["bufferViews"], len(data)) for accessor in lists["accessors"]]
    if sum(counts) > _MOST_ITEMS:
        raise ValueError(f"it describes more than {_MOST_ITEMS:,} values")
    triangles = [
        sum(_triangles(primitive, counts) for primitive in _list(mesh, "primitives")) for mesh in lists["meshes"]
    ]
    return _with_repetitions(lists["nodes"], triangles)


def _list(content: dict[str, Any], name: str) -> list[dict[str, Any]]:
    entries = content.get(name, [])
    if not isinstance(entries, list) or len(entries) > _MOST_ENTRIES or not all(isinstance(e, dict) for e in entries):
        raise ValueError(f"its list of {name} is invalid")
    return entries


def _integer(entry: dict[str, Any], name: str, default: int | None = None) -> int:
    value = entry.get(name, default)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 2**40:
        raise ValueError(f"the value of {name} is invalid")
    return value


def _check_extensions(content: dict[str, Any]) -> None:
    used = [name for key in ("extensionsRequired", "extensionsUsed") for name in _names(content, key)]
    for name in used:
        if name in _COMPRESSED:
            raise SiteError(
                f"the scan uses {_COMPRESSED[name]}, which cannot be read",
                advice="export it without compression, or convert it: npx @gltf-transform/cli copy SCAN.glb PLAIN.glb",
                code="scan-compressed",
            )


def _names(content: dict[str, Any], key: str) -> list[str]:
    names = content.get(key, [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise ValueError(f"its {key} is invalid")
    return names


def _accessor(accessor: dict[str, Any], views: list[dict[str, Any]], size: int) -> int:
    """Return the number of an accessor's items, which must be in the file."""
    count, kind = _integer(accessor, "count"), accessor.get("type")
    if "bufferView" not in accessor or "sparse" in accessor:
        raise ValueError("it has sparse values, which cannot be read")
    index = _integer(accessor, "bufferView")
    if index >= len(views) or not isinstance(kind, str) or kind not in _PARTS:
        raise ValueError("an accessor is invalid")
    item = _PARTS[kind] * _BYTES.get(_integer(accessor, "componentType"), 8)
    if count * item > min(_integer(views[index], "byteLength"), 2 * size):
        raise ValueError("its description promises more than the file has")
    return count


def _triangles(primitive: dict[str, Any], counts: list[int]) -> int:
    attributes = primitive.get("attributes", {})
    if not isinstance(attributes, dict):
        raise ValueError("the attributes of a mesh are invalid")  # noqa: TRY004 - as above
    index = _integer(primitive, "indices", -1 % 2**32)
    if "indices" not in primitive:
        index = _integer(attributes, "POSITION", 0)
    if index >= len(counts):
        raise ValueError("a mesh has values that do not exist")
    return counts[index] // 3


def _with_repetitions(nodes: list[dict[str, Any]], triangles: list[int]) -> int:
    """Return the triangles of all nodes; a node that is below two others would be drawn without end."""
    if len(nodes) > _MOST_NODES:
        raise SiteError(
            f"the scan has {len(nodes):,} parts; the limit is {_MOST_NODES:,}",
            advice="join its parts into one mesh, and export it again",
            code="scan-too-large",
        )
    parents = [0] * len(nodes)
    total = 0
    for node in nodes:
        children = node.get("children", [])
        if not isinstance(children, list):
            raise ValueError("the nodes are invalid")  # noqa: TRY004 - as above
        for child in children:
            if not isinstance(child, int) or not 0 <= child < len(nodes):
                raise ValueError("a node has a child that does not exist")
            parents[child] += 1
        if "mesh" in node:
            mesh = _integer(node, "mesh")
            if mesh >= len(triangles):
                raise ValueError("a node has a mesh that does not exist")
            total += triangles[mesh]
    if any(count > 1 for count in parents) or (nodes and all(parents)):
        raise ValueError("its nodes contain each other")
    left, reached = [index for index, count in enumerate(parents) if not count], 0
    while left:
        reached += 1
        left += nodes[left.pop()].get("children", [])
    if reached != len(nodes):
        raise ValueError("its nodes contain each other")
    return total
