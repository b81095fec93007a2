"""How logs are read: the ``[input]`` part of a configuration.

Every unit is in the name of its field. What is not set is recognised from the log where that is safe, and told in the
provenance.
"""

from datetime import date
from math import pi
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AliasChoices, BaseModel, ConfigDict, Field, field_validator, model_validator

__all__ = [
    "AttitudeInput",
    "CsvMapping",
    "CsvTime",
    "FixInput",
    "ImuInput",
    "InputSettings",
    "MessageMapping",
    "MessageQuantity",
    "MessageTime",
    "Quantity",
    "RangeCorrections",
    "RangeInput",
    "ReferenceInput",
    "StatusName",
    "TimeBase",
    "unit_factor",
]

TimeBase = Literal["auto", "utc", "gps", "tai", "boot"]
Stamp = Literal["header", "log"]
StatusName = Literal["unknown", "single", "differential", "float", "fixed", "dead_reckoning", "none"]
Column = str | Annotated[int, Field(ge=1)]
Vector = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0)]
System = Literal["G", "R", "E", "C", "J"]
Signal = Annotated[str, Field(pattern="^[1-9][A-Z]$")]

Quantity = Literal[
    "gyro_x",
    "gyro_y",
    "gyro_z",
    "accel_x",
    "accel_y",
    "accel_z",
    "lat",
    "lon",
    "height",
    "ecef_x",
    "ecef_y",
    "ecef_z",
    "vel_n",
    "vel_e",
    "vel_d",
    "vel_u",
    "vel_ecef_x",
    "vel_ecef_y",
    "vel_ecef_z",
    "std_n",
    "std_e",
    "std_d",
    "std_vn",
    "std_ve",
    "std_vd",
    "roll",
    "pitch",
    "yaw",
    "q_w",
    "q_x",
    "q_y",
    "q_z",
    "std_att_x",
    "std_att_y",
    "std_att_z",
    "status",
    "sat",
    "signal",
    "pseudorange",
    "range_rate",
    "doppler_hz",
    "pseudorange_std",
    "range_rate_std",
    "cn0",
    "sat_x",
    "sat_y",
    "sat_z",
    "sat_vx",
    "sat_vy",
    "sat_vz",
    "sat_clock_s",
    "sat_clock_m",
    "relativity_m",
    "group_delay_m",
    "ionosphere_m",
    "troposphere_m",
]
"""What a column of a text file can hold. ``yaw`` is clockwise from north; ``q_*`` is the quaternion body (FRD) to NED, or
to the frame that ``input.attitude`` names, ``std_att_*`` the standard deviations about the axes of that frame. Of
ranges, ``sat_clock_*`` and ``relativity_m`` are added to the pseudorange, ``group_delay_m``, ``ionosphere_m`` and
``troposphere_m`` (delays) are subtracted from it."""

_ALONG = {"f": (1, 0, 0), "b": (-1, 0, 0), "r": (0, 1, 0), "l": (0, -1, 0), "d": (0, 0, 1), "u": (0, 0, -1)}


class _Settings(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


def check_axes(axes: str) -> str:
    """The axes as they are. Raises ValueError unless they are ``auto``, or three letters that make a right-handed triad."""
    if axes == "auto":
        return axes
    if len(axes) != 3 or any(letter not in _ALONG for letter in axes):
        raise ValueError("axes must be 'auto' or three letters of f, b, r, l, u, d, such as 'flu' or 'frd'")
    x, y, z = (_ALONG[letter] for letter in axes)
    cross = (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
    if cross != z:
        raise ValueError(f"axes '{axes}' are not a right-handed triad; one of the letters points the wrong way")
    return axes


class ImuInput(_Settings):
    """The inertial sensor. accel_channel: where another channel holds the accelerations. axes: where its x, y, z point in
    the vehicle (forward, back, right, left, up, down), right-handed. mounting_deg: roll, pitch, yaw of the so relabelled
    axes against the vehicle. increments: each sample is the mean over the interval that ends at its stamp. time_offset_s is
    added to its stamps; with the time base ``boot`` of a text file it is the GPS time, in seconds since 1980-01-06, at
    which the sensor's clock read zero."""

    channel: str | None = None
    accel_channel: str | None = None
    stamp: Stamp = "header"
    time_base: TimeBase = "auto"
    time_offset_s: float = 0.0
    axes: str = "auto"
    mounting_deg: Vector = (0.0, 0.0, 0.0)
    gyro_unit: Literal["auto", "rad/s", "deg/s"] = "auto"
    accel_unit: Literal["auto", "m/s2", "g"] = "auto"
    increments: bool = False

    @field_validator("axes")
    @classmethod
    def _check_axes(cls, axes: str) -> str:
        return check_axes(axes)


class FixInput(_Settings):
    """The GNSS receiver. lever_arm_m: forward, right, down from the IMU to the antenna. height: what the log's heights are
    above; with ``msl`` geoid_separation_m is added to them. min_status: fixes of a lower kind are rejected."""

    channel: str | None = None
    velocity_channel: str | None = None
    stamp: Stamp = "header"
    time_base: TimeBase = "auto"
    time_offset_s: float = 0.0
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    height: Literal["ellipsoidal", "msl"] = "ellipsoidal"
    geoid_separation_m: float | None = None
    velocity_frame: Literal["auto", "ned", "enu", "ecef"] = "auto"
    min_status: Literal["unknown", "single", "differential", "float", "fixed"] = "unknown"

    @model_validator(mode="after")
    def _check_geoid(self) -> "FixInput":
        if self.height == "msl" and self.geoid_separation_m is None:
            raise ValueError("height = 'msl' needs geoid_separation_m, the height of the geoid above the ellipsoid there")
        return self


class AttitudeInput(_Settings):
    """Another attitude sensor: dual antenna, AHRS, star tracker. Of messages only used where channel names it.

    frame: what the attitude is against; ``auto`` is NED unless the layout says Earth-fixed; ``inertial`` are axes through the
    Earth's that do not turn with it, of date (no precession or nutation is applied), ut1_utc_s UT1 - UTC. direction: of the
    quaternion or angles. convention, of ROS messages: ``ros`` is a forward-left-up body, in east-north-up where the frame is
    navigation; ``ned`` a forward-right-down body, in north-east-down. boresight_deg: roll, pitch, yaw of the sensor's axes
    against the body. sigma_arcsec: about the sensor's x, y and z, in place of what the log tells."""

    channel: str | None = None
    time_base: TimeBase = "auto"
    time_offset_s: float = 0.0
    frame: Literal["auto", "navigation", "earth", "inertial"] = "auto"
    direction: Literal["body_to_frame", "frame_to_body"] = "body_to_frame"
    convention: Literal["ros", "ned"] = "ros"
    boresight_deg: Vector = (0.0, 0.0, 0.0)
    sigma_arcsec: tuple[Positive, Positive, Positive] | None = None
    ut1_utc_s: Annotated[float, Field(ge=-1, le=1)] = 0.0
    heading_only: bool = False


class ReferenceInput(_Settings):
    """The reference solution: a file of its own, or a channel of the logs, or (from_fixes) the fixes before any are
    withheld.

    status: kinds of fixes that count (empty: all). max_speed_jump_mps: rows beside an implied speed above it are dropped.
    lever_arm_m: forward, right, down from the IMU to the described point. origin_deg_m: latitude [deg], longitude [deg] and
    height [m] of the origin of a local east-north-up frame (TUM, poses).
    """

    file: Path | None = None
    channel: str | None = None
    from_fixes: bool = False
    status: tuple[StatusName, ...] = ()
    max_speed_jump_mps: float | None = Field(default=None, gt=0)
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    time_base: TimeBase = "auto"
    time_offset_s: float = 0.0
    convention: Literal["ros", "ned"] = "ros"
    origin_deg_m: Vector | None = None


class RangeInput(_Settings):
    """Raw pseudoranges. navigation: files with ephemerides beside the logs (RINEX navigation, SP3, or a log that holds them).
    systems: RINEX letters of the systems to use. signals: by system, the signals to use where a satellite has several, best
    first, in place of those of L1, E1 and B1. Observations of a lower C/N0 are rejected."""

    channel: str | None = None
    time_offset_s: float = 0.0
    systems: tuple[System, ...] = Field(("G", "E", "C", "J", "R"), description="systems to use, by their RINEX letters")
    signals: dict[System, tuple[Signal, ...]] = Field(
        default_factory=dict, description='by system, best first, such as { G = ["5Q", "5I"] }; else those of L1, E1 and B1'
    )
    min_cn0_dbhz: float = Field(default=0.0, ge=0, description="reject weaker signals [dB-Hz]")
    navigation: tuple[Path, ...] = Field((), description="files with ephemerides: RINEX navigation, SP3")


class RangeCorrections(_Settings):
    """What the pseudoranges of a table hold already, besides what its columns add. sagnac: ``none`` where satellites stand in
    Earth-fixed axes of transmission, ``applied`` where they were turned to those of reception, ``pseudorange`` where that was
    done by pseudorange / c, receiver clock included."""

    satellite_clock: bool = False
    relativity: bool = False
    group_delay: bool = False
    ionosphere: bool = False
    troposphere: bool = False
    sagnac: Literal["none", "applied", "pseudorange"] = "none"


class CsvTime(_Settings):
    """Where the time of a row stands. base: ``gps`` counts from 1980-01-06, ``gps_unix`` from 1970 without leap seconds (as
    RTKLIB does), ``gps_tow`` from the start of the GPS week (week_column, or ``gps_week`` of the input), ``utc`` and ``tai``
    from 1970, ``boot`` from an unknown zero (see `ImuInput`); ``datetime_*`` is a date and time of day, in one column or
    several."""

    column: Column | tuple[Column, ...]
    unit: Literal["s", "ms", "us", "ns"] = "s"
    base: Literal["gps", "gps_unix", "gps_tow", "utc", "tai", "boot", "datetime_utc", "datetime_gps"] = "gps"
    week_column: Column | None = None


class CsvMapping(_Settings):
    """Meaning of a text file (or of a matrix in a MATLAB file) without a layout of its own.

    match: pattern of the file's name. columns: by quantity, the name or the number (from 1) of its column. status: by the
    text of a status column, the kind of fix. variable: name of the matrix in a MATLAB file. corrections: of ranges, see
    `RangeCorrections`. satellite_blocks: where satellites are mere numbers, the first number of each system."""

    match: str
    role: Literal["imu", "fix", "velocity", "attitude", "reference", "range"]
    time: CsvTime
    columns: dict[Quantity, Column] = Field(min_length=1)
    delimiter: str = "auto"
    header: Literal["auto"] | bool = "auto"
    skip_rows: int = Field(default=0, ge=0)
    comment: Annotated[str, Field(min_length=1, max_length=1)] | None = None
    angle_unit: Literal["deg", "rad"] = "deg"
    status: dict[str, StatusName] = Field(default_factory=dict)
    variable: str | None = None
    corrections: RangeCorrections = RangeCorrections()
    satellite_blocks: dict[System, Annotated[int, Field(ge=1)]] = Field(default_factory=dict)


MessageQuantity = (
    Quantity
    | Literal[
        "speed",
        "course",
        "east",
        "north",
        "up",
        "std_h",
        "std_vel",
        "var_n",
        "var_e",
        "var_d",
        "var_vn",
        "var_ve",
        "var_vd",
        "lat_plus",
        "lon_plus",
        "height_plus",
    ]
)
"""What a field of a message can hold, besides: ``speed`` and ``course`` (clockwise from north) over ground; ``east``,
``north``, ``up`` of ``origin_deg_m``; one standard deviation for both horizontal axes, or for all of a velocity;
variances; and what is added to latitude, longitude and height (finer digits, the geoid separation of a height above mean
sea level)."""


class MessageTime(_Settings):
    """Which field of a message is its time. base: ``auto`` is a stamp like that of a header, to which the ``time_base`` of its
    role applies; ``gps_tow`` counts from the start of the GPS week, of week_column or else the one nearest to the recorder's
    clock; the others as in `CsvTime`."""

    column: str
    unit: Literal["s", "ms", "us", "ns"] = "ns"
    base: Literal["auto", "gps", "gps_unix", "gps_tow", "utc", "tai"] = "auto"
    week_column: str | None = None


class MessageMapping(_Settings):
    """Meaning of the messages of a topic, or of a type, in any container.

    topic, type: patterns; of those given, both must fit. columns: by quantity, the path of its field (``pose.position.x``,
    ``rates[0]``, ``flags & 192``). units: by quantity (or ``gyro``, ``accel``, ``vel`` for all of a kind) a unit, with a factor
    before it where there is one (``1e-7 deg``). axes: where x, y, z of an inertial sensor point. increments: its samples are
    increments since the last one. time: without it the header's stamp, else the recorder's. status: by the text of the status
    field, the kind of fix. no_fix: values of fields at which there is no fix. beside: types whose message of the same key is
    joined to each; their fields are then ``Type.field``. origin_deg_m: of ``east``, ``north``, ``up``. rank: of several
    channels that can serve, that of the lowest is taken."""

    topic: str | None = None
    type: str | None = None
    role: Literal["imu", "fix", "velocity", "attitude", "reference"]
    columns: dict[MessageQuantity, str] = Field(min_length=1, validation_alias=AliasChoices("columns", "fields"))
    units: dict[str, str] = Field(default_factory=dict)
    angle_unit: Literal["deg", "rad"] = "deg"
    time: MessageTime | None = None
    status: dict[str, StatusName] = Field(default_factory=dict)
    no_fix: dict[str, tuple[float, ...]] = Field(default_factory=dict)
    axes: str = "frd"
    increments: bool = False
    beside: tuple[str, ...] = ()
    key: str | None = None
    origin_deg_m: Vector | None = None
    rank: int = 0
    note: str = ""

    @model_validator(mode="after")
    def _check_match(self) -> "MessageMapping":
        if self.topic is None and self.type is None:
            raise ValueError("a mapping of messages needs topic or type, such as topic = '/gps/raw'")
        if self.beside and self.key is None:
            raise ValueError("beside needs key, the field that is equal in the messages to join")
        return self

    @field_validator("axes")
    @classmethod
    def _check_axes(cls, axes: str) -> str:
        return check_axes(axes)

    @field_validator("units")
    @classmethod
    def _check_units(cls, units: dict[str, str]) -> dict[str, str]:
        for text in units.values():
            unit_factor(text)
        return units


_UNITS = {
    "rad": 1.0,
    "deg": pi / 180,
    "arcsec": pi / 648_000,
    "m": 1.0,
    "cm": 0.01,
    "mm": 0.001,
    "km": 1000.0,
    "ft": 0.3048,
    "m/s": 1.0,
    "cm/s": 0.01,
    "mm/s": 0.001,
    "km/h": 1 / 3.6,
    "kn": 1852 / 3600,
    "ft/s": 0.3048,
    "rad/s": 1.0,
    "deg/s": pi / 180,
    "m/s2": 1.0,
    "g": 9.80665,
    "mg": 9.80665e-3,
    "m2": 1.0,
    "m2/s2": 1.0,
}


def unit_factor(text: str) -> float:
    """What a number in a unit (``mm``, ``1e-7 deg``, ``0.5 g``) is multiplied by to get it in SI and radians. Raises
    ValueError."""
    factor, _, unit = text.strip().rpartition(" ")
    try:
        return float(factor or 1) * _UNITS[unit]
    except (KeyError, ValueError) as error:
        raise ValueError(
            f"no unit '{text}'; known are {', '.join(_UNITS)}, each with a factor before it, as '1e-7 deg'"
        ) from error


class InputSettings(_Settings):
    """Everything about the input. Where a channel is not named, the only one of a fitting type is taken; ``none`` takes none.
    leap_seconds: a table in the IERS format replacing the built-in one. gps_week: full week
    where a file holds only seconds of week. utc_date: date of the first sentence where an NMEA file holds none."""

    leap_seconds: Path | None = None
    gps_week: int | None = Field(default=None, ge=0)
    utc_date: date | None = None
    imu: ImuInput = ImuInput()
    fix: FixInput = FixInput()
    range: RangeInput = RangeInput()
    attitude: AttitudeInput = AttitudeInput()
    reference: ReferenceInput = ReferenceInput()
    csv: tuple[CsvMapping, ...] = ()
    message: tuple[MessageMapping, ...] = ()
