"""Mappings of messages: the ``[[input.message]]`` part of a configuration, and of what is known of drivers."""

from typing import Literal

from pydantic import AliasChoices, Field, field_validator, model_validator

from importers.quantities import MessageQuantity, Settings, StatusName, Vector, check_axes, unit_factor

__all__ = ["MessageMapping", "MessageTime"]


class MessageTime(Settings):
    """Which field of a message is its time. base: ``auto`` is a stamp like that of a header, to which the ``time_base`` of its
    role applies; ``gps_tow`` counts from the start of the GPS week, of week_column or else the one nearest to the recorder's
    clock; the others as in `CsvTime`."""

    column: str
    unit: Literal["s", "ms", "us", "ns"] = "ns"
    base: Literal["auto", "gps", "gps_unix", "gps_tow", "utc", "tai"] = "auto"
    week_column: str | None = None


class MessageMapping(Settings):
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
    role: Literal["imu", "fix", "velocity", "attitude", "reference", "speed", "baro"]
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
