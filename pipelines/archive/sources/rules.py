"""rules.toml: what an archive cannot tell by itself, as patterns on the drives' names."""

import tomllib
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from navreplay.timeline import LogError
from pipelines.archive.sources.drives import ArchiveDrive
from pipelines.config.spec import Config, load_config

__all__ = ["Assigned", "Rules", "assign", "read_rules"]


class _Rule(BaseModel):
    """match: pattern of drive names. config: file, relative to the rules. vehicle: name in the catalogue. skip: leave out.
    join: drives of this pattern are one."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    match: Annotated[str, Field(min_length=1)]
    config: str | None = None
    vehicle: str = ""
    skip: bool = False
    join: bool = False


class Rules(BaseModel):
    """The rules, the first that matches counts."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    rule: tuple[_Rule, ...] = ()


@dataclass(frozen=True, slots=True)
class Assigned:
    """A drive with what it is processed with."""

    drive: ArchiveDrive
    config: Config
    vehicle: str = ""


def read_rules(path: Path | None) -> Rules:
    """Raises LogError for a file that cannot be read, or for a key that is none."""
    if path is None:
        return Rules()
    try:
        return Rules.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise LogError(f"{path}: the rules cannot be read: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise LogError(f"{path}: the rules are not TOML: {error}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise LogError(f"{path}: {where}: {first['msg']}; a [[rule]] has match, config, vehicle, skip, join") from error


def assign(drives: list[ArchiveDrive], rules: Rules, rules_path: Path | None, base: Config) -> list[Assigned]:
    """The drives with the configuration of the first rule that matches their name, else base. Raises LogError for a
    configuration that is wrong."""
    configs: dict[str, Config] = {}
    joined: dict[str, list[ArchiveDrive]] = {}
    assigned = []
    for drive in drives:
        rule = next((one for one in rules.rule if fnmatch(drive.name, one.match)), None)
        if rule is not None and rule.skip:
            continue
        if rule is not None and rule.join:
            joined.setdefault(rule.match, []).append(drive)
            continue
        assigned.append(_assigned(drive, rule, rules_path, base, configs))
    for match, parts in joined.items():
        rule = next(one for one in rules.rule if one.match == match)
        logs = tuple(log for part in parts for log in part.logs)
        reference = next((part.reference for part in parts if part.reference is not None), None)
        whole = ArchiveDrive(parts[0].name, logs, reference, f"joined by the rule '{match}'")
        assigned.append(_assigned(whole, rule, rules_path, base, configs))
    return sorted(assigned, key=lambda one: one.drive.name)


def _assigned(
    drive: ArchiveDrive, rule: _Rule | None, rules_path: Path | None, base: Config, configs: dict[str, Config]
) -> Assigned:
    if rule is None or rule.config is None or rules_path is None:
        return Assigned(drive, base, "" if rule is None else rule.vehicle)
    if rule.config not in configs:
        configs[rule.config] = load_config(rules_path.parent / rule.config)
    return Assigned(drive, configs[rule.config], rule.vehicle)
