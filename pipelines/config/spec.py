"""The configuration of a run: TOML in, one validated frozen object inside, the effective TOML out.

A relative path in a configuration file counts from the folder of that file. In the effective configuration paths are
absolute and windows read from a file are written out, so that it gives the same solution from anywhere.
"""

import difflib
import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import tomlkit
from pydantic import BaseModel, Field, ValidationError
from pydantic_core import ErrorDetails

from importers.containers.remote import address_of
from importers.settings import InputSettings
from navreplay.options import FilterOptions
from navreplay.timeline import LogError
from pipelines.config.flight import AttitudeSection, LaunchSection
from pipelines.config.ranges import MotionSection, RangeSection
from pipelines.config.sections import (
    AlignmentSection,
    ConsiderSection,
    FilterSection,
    GapSection,
    GateSection,
    GnssSection,
    ImuSection,
    OutageSection,
    OutputSection,
    Section,
)
from pipelines.config.vehicle import VehicleSection

__all__ = ["Config", "apply_sets", "config_keys", "dump_toml", "filter_options", "load_config", "validate"]

_PATH_KEYS = (("input", "reference", "file"), ("input", "leap_seconds"), ("outages", "file"))


class Config(Section):
    """Everything that decides a run beside the logs themselves. `Config()` is a usable default."""

    input: InputSettings = Field(default_factory=InputSettings)
    imu: ImuSection = ImuSection()
    alignment: AlignmentSection = AlignmentSection()
    gate: GateSection = GateSection()
    gaps: GapSection = GapSection()
    filter: FilterSection = FilterSection()
    consider: ConsiderSection = ConsiderSection()
    gnss: GnssSection = GnssSection()
    attitude: AttitudeSection = AttitudeSection()
    vehicle: VehicleSection = VehicleSection()
    launch: LaunchSection = LaunchSection()
    range: RangeSection = RangeSection()
    motion: MotionSection = MotionSection()
    output: OutputSection = OutputSection()
    outages: OutageSection = OutageSection()


def filter_options(config: Config) -> FilterOptions:
    """The filter's part of the configuration, in SI units."""
    return FilterOptions(
        imu_noise=config.imu.noise(),
        alignment=config.alignment.options(),
        gate=config.gate.options(),
        gaps=config.gaps.options(),
        output_rate=config.output.rate_hz,
        covariance_interval=config.filter.covariance_interval_s,
        use_velocity=config.filter.use_velocity,
        smooth=config.filter.smooth,
        noise_scale=config.gnss.noise_scale,
        correlated_noise=config.gnss.correlated_noise(),
        position_noise_scale=config.gnss.position_noise_scale,
        velocity_noise_scale=config.gnss.velocity_noise_scale,
        position_std_floor=config.gnss.position_std_floor_m,
        velocity_std_floor=config.gnss.velocity_std_floor_mps,
        default_position_std=config.gnss.default_position_std_m.by_status(),
        default_velocity_std=config.gnss.default_velocity_std_mps,
        use=config.filter.use,
        attitude=config.attitude.options(),
        vehicle=config.vehicle.options(),
        launch=None if config.filter.frame == "ned" else config.launch.options(config.alignment.position_deg_m),
        ranges=config.range.options(),
        motion=config.motion.options(),
        consider=config.consider.options(),
    )


def load_config(path: str | Path | None, sets: Sequence[str] = ()) -> Config:
    """Reads a TOML file (None: the defaults) and applies ``KEY=VALUE`` overrides to it.

    Raises LogError, in one line that names the file and the key, when the file cannot be read, is not TOML, or holds an
    unknown key or a value that does not fit.
    """
    data: dict[str, Any] = {}
    if path is not None:
        data = _read_toml(Path(path))
        _resolve_paths(data, Path(path).parent)
        validate(data, str(path))
    if sets:
        data = apply_sets(data, sets)
    _resolve_paths(data, Path())
    return validate(_inline_windows(data), "command line" if sets else str(path))


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise LogError(f"{path}: cannot read the configuration: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise LogError(
            f"{path}: not a text file in UTF-8, so not a configuration; were log and configuration exchanged?"
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise LogError(f"{path}: not valid TOML: {error}") from error


def apply_sets(data: Mapping[str, Any], sets: Sequence[str]) -> dict[str, Any]:
    """A copy of the parsed TOML with each ``section.key=VALUE`` set; a value that is not TOML is taken as a string.

    Raises LogError for an override without ``=``, or one that would put a key below a value.
    """
    result: dict[str, Any] = json.loads(json.dumps(data))
    for text in sets:
        key, separator, value = text.partition("=")
        if not separator or not key.strip():
            raise LogError(f"--set {text}: expected KEY=VALUE, for example --set imu.grade=tactical")
        *sections, name = key.strip().split(".")
        table = result
        for section in sections:
            table = table.setdefault(section, {})
            if not isinstance(table, dict):
                raise LogError(f"--set {text}: {section} is a value, not a section")
        table[name] = _parse_value(value.strip())
    return result


def _parse_value(text: str) -> object:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def _resolve_paths(data: dict[str, Any], folder: Path) -> None:
    """Makes the paths in the parsed TOML absolute, in place; addresses stay."""
    for *sections, name in _PATH_KEYS:
        table: Any = data
        for section in sections:
            table = table.get(section, {}) if isinstance(table, dict) else {}
        if isinstance(table, dict) and isinstance(table.get(name), str) and address_of(table[name]) is None:
            table[name] = str((folder / table[name]).resolve())


def _inline_windows(data: dict[str, Any]) -> dict[str, Any]:
    """The parsed TOML with the outage windows of a file written out."""
    outages = data.get("outages", {})
    path = outages.get("file") if isinstance(outages, dict) else None
    if not isinstance(path, str):
        return data
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        windows = {"windows_gps_tow": [[float(start), float(end)] for start, end in content["windows"]]}
        if "week" in content:
            windows["week"] = int(content["week"])
    except OSError as error:
        raise LogError(f"{path}: cannot read the outage windows: {error.strerror}") from error
    except (ValueError, TypeError, KeyError) as error:
        raise LogError(
            f"{path}: not an outage file; expected JSON with windows = [[start, end], ...] and week ({error!r})"
        ) from error
    return {**data, "outages": {**{key: value for key, value in outages.items() if key != "file"}, **windows}}


def validate(data: Mapping[str, Any], source: str) -> Config:
    """The configuration from parsed TOML. Raises LogError naming source, key, what was expected and what was found."""
    try:
        return Config.model_validate(data)
    except ValidationError as error:
        unknown_first = sorted(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
        raise LogError(f"{source}: {_describe(unknown_first[0])}") from error


def _describe(error: ErrorDetails) -> str:
    key = ".".join(str(part) for part in error["loc"])
    if error["type"] == "extra_forbidden":
        nearest = _nearest(key)
        hint = f"; the nearest valid key is '{nearest}'" if nearest else ""
        return f"unknown key '{key}'{hint}"
    if error["type"] == "missing":
        return f"{key} is missing"
    if error["type"] in {"model_type", "dict_type"}:
        return f"{key}: expected a section with keys of its own, got {error['input']!r}"
    message = error["msg"].removeprefix("Value error, ").replace("Input should be", "expected")
    if error["type"] == "value_error":
        return f"{key}: {message}"
    return f"{key}: {message}, got {error['input']!r}"


def _nearest(key: str) -> str | None:
    """The valid key most like the given one: in the same section if any is alike, else anywhere by its last part."""
    keys = tuple(config_keys())
    *parents, name = key.split(".")
    section = ".".join(part for part in parents if not part.isdigit())
    siblings = {k.rpartition(".")[2]: k for k in keys if k.rpartition(".")[0] == section}
    sections = {k.split(".")[0]: k.split(".")[0] for k in keys}
    anywhere = {k.rpartition(".")[2]: k for k in keys}
    for names in (siblings if section else sections, anywhere):
        match = difflib.get_close_matches(name.lower(), names, n=1, cutoff=0.5)
        if match:
            return names[match[0]]
    return None


def config_keys(model: type[BaseModel] = Config, prefix: str = "") -> Iterator[str]:
    """All keys of the configuration, dotted, in order."""
    for name, field in model.model_fields.items():
        section = _model_of(field.annotation)
        if section is None:
            yield prefix + name
        else:
            yield from config_keys(section, f"{prefix}{name}.")


def _model_of(annotation: object) -> type[BaseModel] | None:
    """The model in an annotation such as ``Section`` or ``Section | None``."""
    candidates = (annotation, *getattr(annotation, "__args__", ()))
    return next((c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel)), None)


def dump_toml(config: Config) -> str:
    """The effective configuration, every default written out; loading it gives the same configuration back."""
    return tomlkit.dumps(_plain(config.model_dump(mode="python", exclude_none=True)))


def _plain(value: Any) -> Any:
    """Mappings and sequences as the dicts and lists that TOML knows."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    return value
