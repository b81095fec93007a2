"""Calibration: noise estimated from the whole log, with as many passes as it takes, before the pass that counts."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

from navreplay.calibration.linear_log import LinearLog
from navreplay.options import FilterOptions
from navreplay.update.adapter import NoiseAdapter

__all__ = ["Calibration", "Settled", "Trace", "settle_nothing"]

Trace = Callable[[FilterOptions, NoiseAdapter[Any], tuple[str, ...]], tuple[LinearLog, ...]]
"""What a forward pass with these options and this adapter linearises, by stretch; with the process noise of the sources named
kept apart."""


class Settled(NamedTuple):
    """What to filter with. adapter: None for that of the method. estimated: figures of the options that were found. notes:
    sentences for the user."""

    options: FilterOptions
    adapter: NoiseAdapter[Any] | None
    estimated: Mapping[str, float | tuple[float, float]]
    notes: tuple[str, ...]


class Calibration(Protocol):
    """A choice of options and adapter that knows the whole log."""

    @property
    def traces(self) -> int:
        """How many passes it asks for."""
        ...

    def settle(self, options: FilterOptions, trace: Trace) -> Settled:
        """What to filter with, from options as told."""
        ...


def settle_nothing(options: FilterOptions, adapter: NoiseAdapter[Any]) -> Settled:
    """Options and adapter as they are."""
    return Settled(options, adapter, {}, ())
