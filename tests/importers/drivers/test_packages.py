"""The data files of drivers: definitions that parse, meanings whose fields exist."""

from pathlib import Path

import pytest

import importers.drivers
from importers.decoding.ros_definitions import RosType, find_type
from importers.drivers.packages import definitions_of, meanings_of
from importers.meanings.mapped_log import CONVERTED
from importers.message_settings import MessageMapping
from importers.roles.messages import find_kind

PACKAGES = sorted(path.stem for path in Path(importers.drivers.__file__).parent.glob("*.toml"))
TYPES = [(package, name) for package in PACKAGES for name in definitions_of(package)]
MEANINGS = [meaning for package in PACKAGES for meaning in meanings_of(package)]
STANDARD = ("sensor_msgs", "geometry_msgs", "nav_msgs")


def type_of(name: str) -> RosType:
    return find_type(name, "", "msg", "cdr")


@pytest.mark.parametrize("name", [name for _, name in TYPES])
def test_definition_is_complete(name: str) -> None:
    assert type_of(name).leaves


@pytest.mark.parametrize("package", PACKAGES)
def test_package_has_a_meaning(package: str) -> None:
    own = [name.replace("/msg/", "/") for name in definitions_of(package)]
    if package == "standard_topics":
        package = "sensor_msgs"
    assert meanings_of(package) or any(name in CONVERTED or find_kind(name) for name in own)


def known_fields(meaning: MessageMapping) -> set[str]:
    """Names of all scalar fields of a type and of those beside it, elements of vectors and arrays included."""
    assert meaning.type is not None
    package, _, name = meaning.type.partition("/")
    fields = set()
    for kind, prefix in ((name, ""), *((other, f"{other}.") for other in meaning.beside)):
        for leaf in type_of(f"{package}/msg/{kind}").leaves:
            fields |= {prefix + leaf.path, *(f"{prefix}{leaf.path}.{axis}" for axis in "xyzw"[: leaf.count])}
            fields |= {f"{prefix}{leaf.path}[{place}]" for place in range(leaf.count)}
    return fields


@pytest.mark.parametrize("type", sorted({meaning.type for meaning in MEANINGS if meaning.type}))
def test_meaning_names_fields_of_its_definition(type: str) -> None:
    variants = [meaning for meaning in MEANINGS if meaning.type == type]
    package = type.partition("/")[0]
    if package not in STANDARD and type.replace("/", "/msg/") not in definitions_of(package):
        pytest.skip("its definition differs between versions and comes with the log")
    fitting = [
        meaning
        for meaning in variants
        if {path.partition(" &")[0] for path in [*meaning.columns.values(), *meaning.no_fix]} <= known_fields(meaning)
        or {path.partition(" &")[0] for path in meaning.columns.values()} <= known_fields(meaning)
    ]
    assert fitting, f"none of the {len(variants)} meanings fits the fields of {type}"
