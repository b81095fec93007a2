"""ROS message definitions: from the text in a log, or the standard ones, to a type store and its leaves.

rosbags parses the definitions; this only flattens them.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.base import normalize_fieldname
from rosbags.typesys.msg import normalize_msgtype
from rosbags.typesys.store import Typestore

from importers.decoding.leaves import Kind, Leaf
from importers.drivers.packages import definitions_of
from navreplay.timeline import LogError

__all__ = ["RosType", "find_type", "find_types", "normalize_msgtype"]

_IDL_SEPARATOR = "=" * 80 + "\n"
_EMPTY = "structure_needs_at_least_one_member"
_PARSER_ERRORS = (TypesysError, SyntaxError, ValueError, KeyError, IndexError, TypeError, AttributeError, RecursionError)
_DTYPES = {
    "bool": "?",
    "byte": "i1",
    "char": "u1",
    "int8": "i1",
    "int16": "i2",
    "int32": "i4",
    "int64": "i8",
    "uint8": "u1",
    "uint16": "u2",
    "uint32": "u4",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}


@dataclass(frozen=True, eq=False, slots=True)
class RosType:
    """A message type ready for decoding. leaves: its columns; arrays of messages are one of objects. fixed: True when only
    strings vary in length."""

    name: str
    store: Typestore
    leaves: tuple[Leaf, ...]
    fixed: bool


def find_types(name: str, definition: str, language: str, encoding: str) -> tuple[RosType, ...]:
    """The type as `find_type` gives it; where the log does not define it, as each release of its driver does."""
    package = normalize_msgtype(name).partition("/")[0]
    releases = 1 if definition.strip() else max(map(len, definitions_of(package).values()), default=1)
    return tuple(find_type(name, definition, language, encoding, release) for release in range(releases))


@lru_cache(maxsize=256)
def find_type(name: str, definition: str, language: str, encoding: str, release: int = 0) -> RosType:
    """The type of this name (either style).

    definition: text out of the log, empty where it has none (then the standard types of ROS are searched, and drivers').
    language: ``msg`` or ``idl``. encoding: ``cdr`` or ``ros1``. release: of a driver, 0 the newest. Raises LogError for an
    unknown type or a definition that does not parse.
    """
    name = normalize_msgtype(name)
    if definition.strip():
        store = _parse(name, definition, language)
    else:
        # Recorders since ROS 2 Iron store definitions, so a log without them is at most as new as Humble.
        store = get_typestore(Stores.ROS1_NOETIC if encoding == "ros1" else Stores.ROS2_HUMBLE)
        definitions = definitions_of(name.partition("/")[0])
        for known, texts in definitions.items() if name in definitions else ():
            store.register(get_types_from_msg(texts[min(release, len(texts) - 1)], known))
    if name not in store.fielddefs:
        raise LogError(
            f"type {name} is not defined in the log, is no standard type of ROS and none of a driver known here; record its "
            "definition with the log (ros2 bag convert of a newer release does, where the messages are installed)"
        )
    leaves: list[Leaf] = []
    try:
        fixed = _flatten(store, name, "", "", leaves)
    except (KeyError, RecursionError) as error:
        raise LogError(
            f"the definition of type {name} in the log cannot be resolved ({error}); is the file damaged?"
        ) from error
    return RosType(name, store, tuple(leaves), fixed and bool(leaves))


def _parse(name: str, definition: str, language: str) -> Typestore:
    store = get_typestore(Stores.EMPTY)
    try:
        if language == "msg":
            store.register(get_types_from_msg(definition, name))
            return store
        # Several IDL files in one text are each headed by a rule and a line with the file's name.
        parts = [part.partition("\n")[2] for part in definition.split(_IDL_SEPARATOR) if part.startswith("IDL: ")]
        for part in parts or [definition]:
            store.register(get_types_from_idl(part))
    except _PARSER_ERRORS as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise LogError(f"the definition of type {name} in the log cannot be parsed ({reason}); is the file damaged?") from error
    return store


def _flatten(store: Typestore, name: str, path: str, attribute: str, leaves: list[Leaf]) -> bool:
    """Append the leaves of a type; False when something in it varies in length."""
    fixed = True
    field: str
    node: int
    detail: Any
    for field, (node, detail) in store.fielddefs[name][1]:
        if field == _EMPTY:
            fixed = False
            continue
        where, attr = path + field, attribute + normalize_fieldname(field)
        if node == Nodetype.NAME:
            merged = _merged(store, detail, where, attr)
            if merged:
                leaves.append(merged)
            else:
                fixed &= _flatten(store, detail, f"{where}.", f"{attr}.", leaves)
            continue
        if node in (Nodetype.ARRAY, Nodetype.SEQUENCE) and detail[0][0] == Nodetype.NAME:
            _flatten(store, detail[0][1], "", "", [])  # what it is made of must be known
            leaves.append(Leaf(where, (attr,), Kind.MESSAGES, np.dtype(object)))
            fixed = False
            continue
        leaf = _leaf(node, detail, where, attr)
        leaves.append(leaf)
        fixed &= leaf.kind is not Kind.LIST
    return fixed


def _leaf(node: int, detail: Any, path: str, attribute: str) -> Leaf:
    """The leaf of a basic type or an array of one. Raises KeyError for a type that rosbags cannot read (wide strings)."""
    basic = detail[0] if node == Nodetype.BASE else detail[0][1][0]
    dtype = np.dtype(object) if basic == "string" else np.dtype(_DTYPES[basic])
    if node == Nodetype.BASE:
        return Leaf(path, (attribute,), Kind.TEXT if basic == "string" else Kind.NUMBER, dtype)
    if node == Nodetype.ARRAY and basic != "string":
        return Leaf(path, (attribute,), Kind.ARRAY, dtype, detail[1])
    return Leaf(path, (attribute,), Kind.LIST, dtype)


def _merged(store: Typestore, name: str, path: str, attribute: str) -> Leaf | None:
    """Times, and messages that are just x, y, z (w), as one leaf."""
    fields: list[tuple[str, Any]] = list(store.fielddefs[name][1])
    names = tuple(field for field, _ in fields)
    basics = [detail[0] if node == Nodetype.BASE else "" for field, (node, detail) in fields]
    parts = tuple(f"{attribute}.{part}" for part in names)
    if names == ("sec", "nanosec") and all(basic in ("int32", "uint32") for basic in basics):
        dtype = np.dtype([(part, _DTYPES[basic]) for part, basic in zip(names, basics, strict=True)])
        return Leaf(path, parts, Kind.TIME, dtype)
    if names in (("x", "y", "z"), ("x", "y", "z", "w")) and basics[0] in ("float32", "float64") and len(set(basics)) == 1:
        return Leaf(path, parts, Kind.VECTOR, np.dtype(_DTYPES[basics[0]]), len(parts))
    return None
