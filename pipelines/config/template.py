"""A commented configuration file: every section and key with a line of explanation, what is unset commented out."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import tomlkit
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from pipelines.config.spec import Config

__all__ = ["commented_template"]

_EXAMPLES = {
    "input.leap_seconds": "leap-seconds.list",
    "input.gps_week": 2374,
    "input.utc_date": "2025-07-08",
    "channel": "/topic",
    "velocity_channel": "/topic",
    "accel_channel": "/topic",
    "geoid_separation_m": 47.0,
    "input.reference.file": "truth.csv",
    "max_speed_jump_mps": 50.0,
    "origin_deg_m": [40.0, -105.0, 1600.0],
    "gyro_noise_dps_rthz": 0.004,
    "accel_noise_ug_rthz": 80.0,
    "gyro_bias_std_dps": 0.15,
    "accel_bias_std_mg": 8.0,
    "gyro_bias_walk_dps_rts": 1e-4,
    "accel_bias_walk_mps2_rts": 3e-5,
    "gyro_bias_tau_s": 1000.0,
    "accel_bias_tau_s": 1000.0,
    "gyro_scale_std_ppm": 1000.0,
    "accel_scale_std_ppm": 1000.0,
    "gyro_markov_std_dps": 1e-4,
    "gyro_markov_tau_s": 300.0,
    "given_deg": [0.0, 0.0, 90.0],
    "forward_deg": 0.0,
    "position_deg_m": [40.0, 116.3, 50.0],
    "point_deg_m": [40.0, 116.3, 50.0],
    "sigma_arcsec": [1.0, 1.0, 5.0],
    "output_point_m": [1.2, 0.0, 0.8],
    "zero_velocity": True,
    "zero_rate": True,
    "no_slip": True,
    "vehicle.mounting_deg": [0.0, 0.0],
    "rear_axle_m": [-1.0, 0.0, 0.5],
    "scale": 1.0,
    "track_m": 1.5,
    "fix_interval_s": 1.0,
    "week": 2374,
    "outages.file": "outages.json",
}
"""Shown, commented out, for keys that have no value unless one is given."""

_INPUT = {
    "leap_seconds": "leap-second table in the IERS format, in place of the built-in one",
    "gps_week": "full GPS week, where a file holds only seconds of week",
    "utc_date": "date of the first sentence, where an NMEA file holds none",
    "channel": "topic or file name; without it chosen by type where that is unambiguous",
    "accel_channel": "topic or file name of the accelerations, where they are not beside the angular rates",
    "velocity_channel": "topic or file name of the velocity, where it is not in the fixes",
    "stamp": "header: stamp in the message; log: time of recording",
    "time_base": "auto, utc, gps, tai or boot",
    "time_offset_s": "added to the stamps [s]",
    "axes": "where x, y, z point: three of f, b, r, l, u, d (such as frd, flu), or auto",
    "gyro_axes": "the same of the angular rates where they differ, of either hand; auto: as axes",
    "mounting_deg": "roll, pitch, yaw of the so named axes against the vehicle [deg]",
    "gyro_unit": "auto, rad/s or deg/s",
    "accel_unit": "auto, m/s2 or g",
    "increments": "samples are means over the interval that ends at their stamp",
    "height": "ellipsoidal or msl (then geoid_separation_m is needed)",
    "geoid_separation_m": "height of the geoid above the ellipsoid [m]",
    "velocity_frame": "auto, ned, enu or ecef",
    "min_status": "reject fixes of a lower kind: unknown, single, differential, float, fixed",
    "convention": "ros: forward-left-up in east-north-up; ned: forward-right-down in north-east-down",
    "frame": "navigation (NED), earth, inertial (axes of date), or auto: NED unless the layout says Earth-fixed",
    "direction": "body_to_frame or frame_to_body: what the quaternions or angles turn into what",
    "boresight_deg": "roll, pitch, yaw of the sensor's axes against the body [deg]",
    "sigma_arcsec": "standard deviations about the sensor's x, y, z, in place of the log's [arcsec]",
    "ut1_utc_s": "UT1 - UTC, for the frame inertial [s]",
    "heading_only": "roll and pitch of this sensor carry no information",
    "file": "file with the reference solution",
    "from_fixes": "take the log's own fixes, before any are withheld",
    "scale": "metres per second for a unit of the sensor, metres for a tick; without it fitted to the fixes' speed",
    "track_m": "between left and right wheels; without it fitted to the gyro [m]",
    "csv": "tables of numbers without a layout of their own, see docs/formats.md",
    "message": "messages of types without a meaning known here, see docs/formats.md",
    "status": 'kinds of fixes that count, such as ["fixed"]; empty: all',
    "max_speed_jump_mps": "rows beside a larger implied speed are dropped [m/s]",
    "origin_deg_m": "origin of a local frame: latitude [deg], longitude [deg], height [m]",
    "input.fix.lever_arm_m": "forward, right, down from the IMU to the antenna [m]",
    "input.reference.lever_arm_m": "forward, right, down from the IMU to the described point [m]",
}

_SECTIONS = {
    "input": "how the logs are read",
    "input.imu": "the inertial sensor",
    "input.fix": "the GNSS receiver",
    "input.attitude": "another attitude sensor: dual antenna, AHRS, star tracker; of messages only where channel names it",
    "input.speed": "wheels of a land vehicle; of messages only where channel names it",
    "input.baro": "a barometer; of messages only where channel names it",
    "input.reference": "the solution to compare with: a file, a channel, or the fixes themselves",
}


def commented_template(config: Config, notes: Sequence[str] = ()) -> str:
    """The configuration as a file to edit, below notes as leading comments. Loading it gives the same configuration."""
    lines = [f"# {note}" for note in notes]
    for name, field in Config.model_fields.items():
        lines += _describe_section(name, field, getattr(config, name))
    return "\n".join(lines).lstrip("\n") + "\n"


def _describe_section(path: str, field: FieldInfo, section: BaseModel) -> Iterator[str]:
    """Lines of one table: its keys first, its tables behind them (as TOML wants it)."""
    fields = type(section).model_fields
    tables = [key for key in fields if isinstance(getattr(section, key), BaseModel)]
    yield from ("", f"[{path}] # {_SECTIONS.get(path) or field.description or _first_sentence(type(section))}")
    for key in fields:
        if key not in tables:
            yield from _describe_key(path, key, getattr(section, key), fields[key])
    for key in tables:
        yield from _describe_section(f"{path}.{key}", fields[key], getattr(section, key))


def _first_sentence(model: type[BaseModel]) -> str:
    sentence = (model.__doc__ or "").split(". ")[0].rstrip(".")
    return sentence[0].lower() + sentence[1:] if sentence[1:2].islower() else sentence


def _describe_key(path: str, key: str, value: object, field: FieldInfo) -> Iterator[str]:
    example = _EXAMPLES.get(f"{path}.{key}", _EXAMPLES.get(key))
    text = field.description or _INPUT.get(f"{path}.{key}") or _INPUT.get(key)
    comment = f" # {text}" if text else ""
    if key in ("csv", "message") and not value:
        yield f"# {key} = []{comment}"  # an array written here could not be added to by tables below
    elif value is not None:
        yield f"{key} = {_inline(value)}{comment}"
    elif example is not None:
        yield f"# {key} = {_inline(example)}{comment}"


def _inline(value: object) -> str:
    """A value in TOML on one line."""
    if isinstance(value, BaseModel):
        value = value.model_dump(exclude_none=True)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{tomlkit.item(str(key)).as_string()} = {_inline(item)}" for key, item in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_inline(item) for item in value) + "]"
    return tomlkit.item(str(value) if isinstance(value, Path) else value).as_string()
