"""Definitions and meanings of the messages of a package, from the data file of that name."""

import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Any

from importers.settings import MessageMapping

__all__ = ["definitions_of", "meanings_of"]


@lru_cache(maxsize=64)
def definitions_of(package: str) -> dict[str, str]:
    """Definitions by the ROS 2 name of the type; empty for a package not known here."""
    return {f"{package}/msg/{name}": text for name, text in _read(package).get("definitions", {}).items()}


@lru_cache(maxsize=64)
def meanings_of(package: str) -> tuple[MessageMapping, ...]:
    """Mappings of the types of a package; of several for one type and role the first that fits its fields is meant."""
    return tuple(
        MessageMapping.model_validate({**meaning, "type": f"{package}/{meaning['type']}"})
        for meaning in _read(package).get("meaning", ())
    )


def _read(package: str) -> dict[str, Any]:
    """The data of a package; of one that shares its messages with another, that of the other."""
    path = Path(__file__).with_name(f"{package}.toml")
    if not package.isidentifier() or not path.exists():
        return {}
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    return _read(data["same_as"]) if "same_as" in data else data
