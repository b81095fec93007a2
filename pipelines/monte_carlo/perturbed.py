"""A first-order moment rule whose predictions are wrong at given times: what an experiment on model errors needs."""

from dataclasses import dataclass

import numpy as np

from navreplay.error_models.error_model import ErrorModel
from navreplay.error_models.ned import POSITION, VELOCITY, Propagated
from navreplay.mechanisation.strapdown import Leg, NavState
from navreplay.moments.linearised import Linearised
from navreplay.timeline import Floats

__all__ = ["Perturbation", "Perturbed"]


@dataclass(frozen=True, slots=True)
class Perturbation:
    """From start to end [s from the start of the log, both included], position NED [m] and velocity NED [m/s] are added to the
    state that is predicted for each measurement epoch."""

    start: float
    end: float
    position: tuple[float, float, float]
    velocity: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Perturbed(Linearised):
    """perturbations: by time, of a log that starts at start_ns."""

    perturbations: tuple[Perturbation, ...]
    start_ns: int

    def propagate(self, model: ErrorModel, state: NavState, cov: Floats, leg: Leg) -> Propagated:
        """From state and cov (n, n) to the nodes of a leg, the last an epoch's."""
        moved = model.propagate(state, cov, leg)
        t_s = (int(leg.steps.t_ns[leg.ends[-1] - 1]) - self.start_ns) / 1e9
        error = np.zeros(model.size)
        for each in self.perturbations:
            if each.start <= t_s <= each.end:
                error[POSITION] += each.position
                error[VELOCITY] += each.velocity
        if not error.any():
            return moved
        states = moved.states.copy()
        states[-1] = model.retract(NavState.unpack(states[-1]), error).pack()
        return moved._replace(states=states)
