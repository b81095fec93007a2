"""Definitions and meanings of the messages of a package, from the data file of that name."""

import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Any

from importers.message_settings import MessageMapping

__all__ = ["definitions_of", "meanings_of"]

_SAME_AS = {
    "gps_common": "gps_msgs",
    "gnss_comm_msgs": "gnss_comm",
    "sensor_msgs": "standard_topics",
    "geometry_msgs": "standard_topics",
    "nav_msgs": "standard_topics",
}


@lru_cache(maxsize=64)
def definitions_of(package: str) -> dict[str, tuple[str, ...]]:
    """Definitions by the ROS 2 name of the type, that of the newest release first where releases differ; empty for a package
    not known here."""
    found = _read(package).get("definitions", {})
    return {f"{package}/msg/{name}": (text,) if isinstance(text, str) else tuple(text) for name, text in found.items()}


@lru_cache(maxsize=64)
def meanings_of(package: str) -> tuple[MessageMapping, ...]:
    """Mappings of the types of a package; of several for one type and role the first that fits its fields is meant."""
    return tuple(
        MessageMapping.model_validate(
            {**meaning, "type": meaning["type"] if "/" in meaning["type"] else f"{package}/{meaning['type']}"}
        )
        for meaning in _read(package).get("meaning", ())
    )


def _read(package: str) -> dict[str, Any]:
    """The data of a package, or of the one that holds the same messages; empty for one not known here."""
    name = _SAME_AS.get(package, package)
    path = Path(__file__).with_name(f"{name}.toml")
    return tomllib.loads(path.read_text(encoding="utf-8")) if name.isidentifier() and path.exists() else {}
