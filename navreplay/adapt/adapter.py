"""What every noise adapter is: a choice of R (or of an inflated prior) inside the epoch, with a state of its own."""

from typing import Generic, NamedTuple, Protocol, TypeVar

from navreplay.filters.core import Gaussian, Innovation
from navreplay.timeline import Floats

__all__ = ["Adaptation", "NoiseAdapter"]

S = TypeVar("S")


class Adaptation(NamedTuple, Generic[S]):
    """prior: as given, or inflated. noise (m, m): the R to update with. state: for the next epoch of the same components."""

    prior: Gaussian
    noise: Floats
    state: S


class NoiseAdapter(Protocol[S]):
    """An adapter keeps one state per set of measurement components (a log may give position alone now, with velocity then)."""

    def init(self) -> S:
        """State before the first epoch."""
        ...

    def adapt(self, state: S, prior: Gaussian, innovation: Innovation) -> Adaptation[S]:
        """Choice for this epoch. Neither argument is changed."""
        ...
