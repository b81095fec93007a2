"""Which channel serves which purpose: by type where that is unambiguous, by the settings otherwise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from importers.roles.messages import kind_of
from importers.rows.log import Channel, Log
from importers.settings import InputSettings
from navreplay.timeline import LogError

__all__ = ["NOTHING", "SETTING", "Choice", "always_used", "candidates", "choose_channels", "choose_role", "named_channel"]

SETTING = {
    "imu": "input.imu.channel",
    "accel": "input.imu.accel_channel",
    "fix": "input.fix.channel",
    "velocity": "input.fix.velocity_channel",
    "range": "input.range.channel",
    "attitude": "input.attitude.channel",
    "speed": "input.speed.channel",
    "baro": "input.baro.channel",
    "reference": "input.reference.channel",
}
"""The setting that names the channel of a role."""
_RATES_AND_FORCES = (
    ("gyroscope", ("accelerometer",)),
    ("gyro", ("accel", "acc", "accelerometer", "acceleration")),
    ("angular_velocity", ("linear_acceleration", "acceleration")),
    ("ang_vel", ("lin_acc", "acc")),
)
NOTHING = "none"
"""In place of a channel's name: no channel is to serve."""


@dataclass(frozen=True, eq=False, slots=True)
class Choice:
    """A channel of a log, chosen for a role."""

    log: Log
    channel: Channel
    role: str


def candidates(logs: Sequence[Log], role: str) -> list[Choice]:
    """Channels of a type that can serve as a role, empty ones last resort: left out where another holds messages."""
    found = [
        Choice(log, channel, role)
        for log in logs
        for channel in log.channels()
        if (kind := kind_of(channel)) is not None and role in kind.roles
    ]
    filled = [choice for choice in found if choice.channel.count != 0]
    return filled or found


def choose_channels(logs: Sequence[Log], settings: InputSettings, reference: Log | None) -> tuple[Choice, ...]:
    """The channels of every role. Raises LogError where a named channel is missing or a choice is ambiguous."""
    chosen = [choice for role in SETTING for choice in choose_role(logs, settings, reference, role)]
    return (*chosen, *always_used(logs))


def named_channel(settings: InputSettings, role: str) -> str | None:
    """The channel that the settings name for a role; None where they name none, or the role needs no choice."""
    return {
        "imu": settings.imu.channel,
        "accel": settings.imu.accel_channel,
        "fix": settings.fix.channel,
        "velocity": settings.fix.velocity_channel,
        "range": settings.range.channel,
        "attitude": settings.attitude.channel,
        "speed": settings.speed.channel,
        "baro": settings.baro.channel,
        "reference": settings.reference.channel,
    }.get(role)


def always_used(logs: Sequence[Log]) -> list[Choice]:
    """Channels that serve others and need no choice: time references, and ephemerides."""
    return [*candidates(logs, "time"), *candidates(logs, "ephemeris")]


def choose_role(logs: Sequence[Log], settings: InputSettings, reference: Log | None, role: str) -> list[Choice]:
    """The channels of one role: one, or its continuations from file to file, or none. Raises LogError as `choose_channels`."""
    if role == "reference":
        return [] if settings.reference.from_fixes else _choose_reference(logs, settings.reference.channel, reference)
    name = named_channel(settings, role)
    if name == NOTHING:
        return []
    if role == "accel":
        return _accelerations(logs, name, settings.imu.channel)
    if name is not None:
        return _named(logs, role, name)
    wheels = settings.speed.channel  # a twist that is told to be that of the wheels is no velocity of the antenna
    possible = [choice for choice in candidates(logs, role) if role == "speed" or choice.channel.name != wheels]
    found = _foremost([choice for choice in possible if _automatic(choice.channel, role)])
    return _only_one(_without_accelerations(found) if role == "imu" else found, role)


def _foremost(choices: list[Choice]) -> list[Choice]:
    """Of the choices in each log, those of the least rank."""
    least: dict[int, int] = {}
    for choice in choices:
        least[id(choice.log)] = min(least.get(id(choice.log), _rank(choice)), _rank(choice))
    return [choice for choice in choices if _rank(choice) == least[id(choice.log)]]


def _rank(choice: Choice) -> int:
    kind = kind_of(choice.channel)
    return choice.channel.rank + (0 if kind is None else kind.rank)


def _accelerations(logs: Sequence[Log], name: str | None, imu: str | None) -> list[Choice]:
    """The channel of accelerations: the one named, or the one whose name differs from that of the inertial sensor just in that
    (``camera/gyro/sample``, ``camera/accel/sample``)."""
    if name is not None:
        return [replace(choice, role="accel") for choice in _named(logs, "imu", name, "accel")]
    sensors = candidates(logs, "imu")
    names = {choice.channel.name for choice in sensors} if imu is None else {imu}
    beside = {forces for other in names for forces in _beside_rates(other)}
    return [replace(choice, role="accel") for choice in sensors if choice.channel.name in beside]


def _without_accelerations(found: list[Choice]) -> list[Choice]:
    """The channels, without those of accelerations that stand beside one of rates."""
    names = {choice.channel.name for choice in found}
    beside = {forces for name in names for forces in _beside_rates(name)}
    return [choice for choice in found if choice.channel.name not in beside]


def _beside_rates(name: str) -> list[str]:
    """The names that a channel of accelerations would have beside one of angular rates."""
    return [name.replace(rates, other) for rates, forces in _RATES_AND_FORCES if rates in name for other in forces]


def _automatic(channel: Channel, role: str) -> bool:
    kind = kind_of(channel)
    return kind is not None and kind.automatic and kind.roles[0] == role


def _choose_reference(logs: Sequence[Log], name: str | None, reference: Log | None) -> list[Choice]:
    """From the reference file whatever can serve; from the logs only what is meant as a reference."""
    searched = logs if reference is None else [reference]
    if name is not None:
        return _named(searched, "reference", name)
    found = candidates(searched, "reference")
    meant = [choice for choice in found if _automatic(choice.channel, "reference")]
    if reference is None:
        return _only_one(_foremost(meant), "reference")
    if not found:
        types = ", ".join(f"{channel.name} ({channel.type})" for channel in reference.channels()) or "nothing"
        raise LogError(f"{reference.path}: no channel can serve as a reference; it holds {types}")
    absolute = [choice for choice in found if _automatic(choice.channel, "fix")]
    return _only_one(_foremost(meant or absolute or found), "reference")


def _named(logs: Sequence[Log], role: str, name: str, setting: str = "") -> list[Choice]:
    """The channel of a name; of those that share its topic (``topic#...``) the ones that can serve."""
    same = [Choice(log, channel, role) for log in logs for channel in log.channels() if name in (channel.name, _topic(channel))]
    found = [choice for choice in same if (kind := kind_of(choice.channel)) is not None and role in kind.roles]
    if found:
        return found
    place, key = ", ".join(Path(log.path).name for log in logs), SETTING[setting or role]
    if not same:
        there = ", ".join(channel.name for log in logs for channel in log.channels()) or "no channel at all"
        raise LogError(f"{place}: has no channel {name}, which {key} names; there is {there}")
    could = ", ".join(sorted({other.channel.name for other in candidates(logs, role)})) or "none"
    raise LogError(
        f"{place}: channel {name} is {same[0].channel.type}, which cannot serve as {role} ({key}); channels that can: {could}"
    )


def _topic(channel: Channel) -> str:
    return channel.name.partition("#")[0]


def _only_one(found: list[Choice], role: str) -> list[Choice]:
    """One channel, which may continue from file to file under the same name and type, or on its topic with another type."""
    if _is_open(found):
        found = [choice for choice in found if _is_readable(choice)] or found
    names = {(choice.channel.name, choice.channel.type) for choice in found}
    if _is_open(found):
        listed = "; ".join(f"{name} ({type})" for name, type in sorted(names))
        example = sorted(names)[0][0]
        raise LogError(
            f"{len(names)} channels can serve as {role}: {listed}. Choose one with {SETTING[role]}, "
            f"for instance --set {SETTING[role]}={example}"
        )
    return found


def _is_open(found: list[Choice]) -> bool:
    return len({_topic(choice.channel) for choice in found}) > 1


def _is_readable(choice: Choice) -> bool:
    """Whether any message of the channel can be decoded: one that cannot is no choice."""
    name = choice.channel.name
    return len(choice.log.read((name,))[name].log_time_ns) > 0
