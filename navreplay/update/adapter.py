"""What every noise adapter is: a choice of R (or of an inflated prior) inside the epoch, with a state of its own."""

from collections.abc import Sequence
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Floats
from navreplay.update.gaussian import Gaussian, Innovation

__all__ = ["Adaptation", "NoiseAdapter", "adapt_measured", "is_measured"]

_PSEUDO = ("standstill", "zero_rate")
"""Kinds of what no sensor has measured, and begin of their labels."""

S = TypeVar("S")


class Adaptation(NamedTuple, Generic[S]):
    """prior: as given, or inflated. noise (m, m): the R to update with. state: for the next epoch."""

    prior: Gaussian
    noise: Floats
    state: S


class NoiseAdapter(Protocol[S]):
    """What an adapter remembers of a component it keeps by the component's label: epochs differ in what they hold (position
    alone now, with velocity then; satellites come and go)."""

    def init(self) -> S:
        """State before the first epoch."""
        ...

    def adapt(self, state: S, prior: Gaussian, innovation: Innovation) -> Adaptation[S]:
        """Choice for this epoch. Neither argument is changed."""
        ...


def is_measured(names: Sequence[str]) -> NDArray[np.bool_]:
    """(m,) whether a sensor has measured the components of these kinds or labels (m,)."""
    return np.array([not name.startswith(_PSEUDO) for name in names])


def adapt_measured(adapter: NoiseAdapter[S], state: S, prior: Gaussian, innovation: Innovation) -> Adaptation[S]:
    """What an adapter chooses for the components that a sensor has measured. Standstill is no measurement with a noise to be
    found, and keeps its R."""
    measured = is_measured(innovation.labels)
    if measured.all():
        return adapter.adapt(state, prior, innovation)
    if not measured.any():
        return Adaptation(prior, innovation.noise, state)
    rows = np.flatnonzero(measured)
    chosen = adapter.adapt(state, prior, innovation.select(rows))
    noise = innovation.noise.copy()
    noise[rows[:, None], rows] = chosen.noise
    return chosen._replace(noise=noise)
