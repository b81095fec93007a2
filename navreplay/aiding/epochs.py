"""What the epoch loop asks of anything that aids it: measurements by epoch."""

from typing import NamedTuple, Protocol

from navreplay.mechanisation.strapdown import NavState
from navreplay.timeline import Floats, Times
from navreplay.update.measurement import Measurement

__all__ = ["Aiding", "Observed"]


class Observed(NamedTuple):
    """measurement: None where the epoch holds none. state and cov (n, n): as given, or with a clock jump absorbed."""

    measurement: Measurement | None
    state: NavState
    cov: Floats


class Aiding(Protocol):
    """Measurements by epoch."""

    @property
    def name(self) -> str:
        """What they are called in messages, in the plural."""
        ...

    @property
    def t_ns(self) -> Times:
        """(e,) times of the epochs."""
        ...

    def observe(self, epoch: int, state: NavState, cov: Floats, dtheta: Floats, dt: float) -> Observed:
        """The measurement with index epoch; dtheta (3,) [rad] and dt [s] are those of the step before it."""
        ...
