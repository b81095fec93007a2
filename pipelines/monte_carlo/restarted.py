"""A noise adapter that forgets at given times: what an experiment needs whose estimators are started anew."""

from bisect import bisect_right
from dataclasses import dataclass
from typing import Any

from navreplay.update.adapter import Adaptation, NoiseAdapter
from navreplay.update.gaussian import Gaussian, Innovation

__all__ = ["Restarted"]


@dataclass(frozen=True, slots=True)
class Restarted:
    """adapter: the one that does the work. at_ns: times in ascending order; the first epoch at or after each finds an adapter
    without memory."""

    adapter: NoiseAdapter[Any]
    at_ns: tuple[int, ...]

    def init(self) -> tuple[int, Any]:
        """Restarts done, and the adapter's own state."""
        return 0, self.adapter.init()

    def adapt(self, state: tuple[int, Any], prior: Gaussian, innovation: Innovation) -> Adaptation[tuple[int, Any]]:
        """The adapter's choice for this epoch, from its own state or a fresh one."""
        done, own = state
        due = bisect_right(self.at_ns, innovation.t_ns)
        adapted, noise, own = self.adapter.adapt(own if due == done else self.adapter.init(), prior, innovation)
        return Adaptation(adapted, noise, (due, own))
