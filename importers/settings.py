"""How logs are read: the ``[input]`` part of a configuration.

Every unit is in the name of its field. What is not set is recognised from the log where that is safe, and told in the
provenance.
"""

from datetime import date
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from importers.message_settings import MessageMapping
from importers.quantities import (
    Column,
    Positive,
    Quantity,
    Settings,
    Signal,
    Stamp,
    StatusName,
    System,
    TimeBase,
    Vector,
    check_axes,
    unit_factor,
)

__all__ = [
    "AttitudeInput",
    "BaroInput",
    "CsvMapping",
    "CsvTime",
    "FixInput",
    "ImuInput",
    "InputSettings",
    "Quantity",
    "RangeCorrections",
    "RangeInput",
    "ReferenceInput",
    "SpeedInput",
    "StatusName",
    "TimeBase",
]


class ImuInput(Settings):
    """The inertial sensor. accel_channel: where another channel holds the accelerations. axes: where its x, y, z point in
    the vehicle (forward, back, right, left, up, down), right-handed. gyro_axes: the same of the angular rates where they
    differ (turns counted to the left beside accelerations that point down), of either hand. mounting_deg: roll, pitch, yaw
    of the so relabelled axes against the vehicle. increments: each sample is the mean over the interval that ends at its
    stamp. time_offset_s is added to its stamps; with the time base ``boot`` of a text file it is the GPS time, in seconds
    since 1980-01-06, at which the sensor's clock read zero."""

    channel: str | None = None
    accel_channel: str | None = None
    stamp: Stamp = "header"
    time_base: TimeBase = "auto"
    time_offset_s: float = 0.0
    axes: str = "auto"
    gyro_axes: str = "auto"
    mounting_deg: Vector = (0.0, 0.0, 0.0)
    gyro_unit: Literal["auto", "rad/s", "deg/s"] = "auto"
    accel_unit: Literal["auto", "m/s2", "g"] = "auto"
    increments: bool = False

    @field_validator("axes")
    @classmethod
    def _check_axes(cls, axes: str) -> str:
        return check_axes(axes)

    @field_validator("gyro_axes")
    @classmethod
    def _check_gyro_axes(cls, axes: str) -> str:
        return check_axes(axes, right_handed=False)


class FixInput(Settings):
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


class AttitudeInput(Settings):
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


class SpeedInput(Settings):
    """Wheels of a land vehicle. Of messages only used where channel names it: a twist may be of the antenna, of the body or a
    command. scale: metres per second for a unit of the sensor (metres for a tick); fitted to the fixes' speed where it is not
    given, together with the delay. track_m: between left and right wheels; fitted to the gyro where it is not given."""

    channel: str | None = None
    stamp: Stamp = "header"
    time_base: TimeBase = "auto"
    time_offset_s: float = 0.0
    scale: float | None = None
    track_m: Positive | None = None


class BaroInput(Settings):
    """A barometer. Of messages only used where channel names it."""

    channel: str | None = None
    stamp: Stamp = "header"
    time_base: TimeBase = "auto"
    time_offset_s: float = 0.0


class ReferenceInput(Settings):
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


class RangeInput(Settings):
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


class RangeCorrections(Settings):
    """What the pseudoranges of a table hold already, besides what its columns add. sagnac: ``none`` where satellites stand in
    Earth-fixed axes of transmission, ``applied`` where they were turned to those of reception, ``pseudorange`` where that was
    done by pseudorange / c, receiver clock included."""

    satellite_clock: bool = False
    relativity: bool = False
    group_delay: bool = False
    ionosphere: bool = False
    troposphere: bool = False
    sagnac: Literal["none", "applied", "pseudorange"] = "none"


class CsvTime(Settings):
    """Where the time of a row stands. base: ``gps`` counts from 1980-01-06, ``gps_unix`` from 1970 without leap seconds (as
    RTKLIB does), ``gps_tow`` from the start of the GPS week (week_column, or ``gps_week`` of the input), ``utc`` and ``tai``
    from 1970, ``boot`` from an unknown zero (see `ImuInput`); ``datetime_*`` is a date and time of day, in one column or
    several. unit: ``auto`` goes by the size of the counts. day_first: whether 05/04/2023 is a day of April; None decides by the
    whole column, and refuses where that leaves both."""

    column: Column | tuple[Column, ...]
    unit: Literal["auto", "s", "ms", "us", "ns"] = "auto"
    base: Literal["gps", "gps_unix", "gps_tow", "utc", "tai", "boot", "datetime_utc", "datetime_gps"] = "gps"
    week_column: Column | None = None
    day_first: bool | None = None


class CsvMapping(Settings):
    """Meaning of a text file (or of a matrix in a MATLAB file) without a layout of its own.

    match: pattern of the file's name. columns: by quantity, the name or the number (from 1) of its column. status: by the
    text of a status column, the kind of fix. angle_unit: of latitude and longitude ``auto`` goes by their size, of all other
    angles it means degrees; ``ddmm`` are degrees and minutes written together. units: by quantity (or ``gyro``, ``accel``,
    ``vel`` for all of a kind) another unit than SI, such as ``km/h``, ``ft``, ``1e-7 deg``. variable: name of the matrix in a
    MATLAB file. corrections: of ranges, see `RangeCorrections`. satellite_blocks: where satellites are mere numbers, the first
    number of each system."""

    match: str
    role: Literal["imu", "fix", "velocity", "attitude", "reference", "range", "speed", "baro"]
    time: CsvTime
    columns: dict[Quantity, Column] = Field(min_length=1)
    delimiter: str = "auto"
    header: Literal["auto"] | bool = "auto"
    skip_rows: int = Field(default=0, ge=0)
    comment: Annotated[str, Field(min_length=1, max_length=1)] | None = None
    angle_unit: Literal["auto", "deg", "rad", "ddmm"] = "auto"
    units: dict[str, str] = Field(default_factory=dict)
    status: dict[str, StatusName] = Field(default_factory=dict)
    variable: str | None = None
    corrections: RangeCorrections = RangeCorrections()
    satellite_blocks: dict[System, Annotated[int, Field(ge=1)]] = Field(default_factory=dict)

    @field_validator("units")
    @classmethod
    def _check_units(cls, units: dict[str, str]) -> dict[str, str]:
        for text in units.values():
            unit_factor(text)
        return units


class InputSettings(Settings):
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
    speed: SpeedInput = SpeedInput()
    baro: BaroInput = BaroInput()
    reference: ReferenceInput = ReferenceInput()
    csv: tuple[CsvMapping, ...] = ()
    message: tuple[MessageMapping, ...] = ()
