"""Errors carried point by point through the mechanisation itself, without linear error equations: two models of attitude.

Source: Gao et al. (2021), (1)-(10): 16 states, with the attitude error the difference dQ = computed - true of quaternions.
Their (1), (3), (4), with the measured rates next to the true quaternion, are the difference of two mechanisations exactly; so a
point is moved by the mechanisation like the nominal state, and subtracted from it (tests integrate their equations beside it).
Mended against the print: signs of Omega_d (2, 3) and of the last term of (3), rates of the frames, M; gravity changes with
height.

Four numbers hold three angles, and the covariance of dQ is singular along Q. On purpose: between nodes it is kept in the three
directions orthogonal to Q, dQ = -[0, phi] Q / 2, which gives a square root of the published covariance whose last column, along
Q, is zero; that column's pair of points is the nominal state. Q - dQ stands for its direction: a point is normalised, and read
back where its ray meets the tangent plane at Q. Left as long as it comes, as printed, C(Q - dQ) would multiply the specific
force by 1 + |phi|^2 / 4. Outside, states, covariance and NEES are those of the rotation vector phi.
"""

from dataclasses import dataclass

import numpy as np

from navreplay.error_models.ned import NedErrorModel, Propagated
from navreplay.mechanisation import _cubature_kernel
from navreplay.mechanisation.strapdown import Leg, NavState
from navreplay.timeline import Floats

__all__ = ["PointwiseModel"]


@dataclass(frozen=True, slots=True)
class PointwiseModel(NedErrorModel):
    """`NedErrorModel` with moments by cubature points. attitude_states: 4, additive quaternion (16 states where `NedErrorModel`
    has 15), or 3, rotation vector."""

    attitude_states: int = 4

    def propagate(self, state: NavState, cov: Floats, leg: Leg, cross: Floats | None = None) -> Propagated:
        """From state and cov (n, n) to the nodes of a leg.

        The leg's interval is the longest step of the points, and of the linear model, whose accumulated noise is taken.
        Transitions and noises are always returned. cross (n, c): covariance with other states, as if they did not move.
        """
        cross = np.empty((self.size, 0)) if cross is None else cross
        moved = NedErrorModel.propagate(self, state, cov, leg.keeping(), cross)
        extra = self.attitude_states - 3
        _cubature_kernel.propagate(
            state.pack(), cov, cross, leg.rows, leg.counts, self.correlation_time(), leg.interval, extra, moved
        )
        return moved
