"""Cubature moment rule: the prediction's mean and covariance from points carried through the mechanisation itself.

Source: Arasaratnam and Haykin, IEEE Trans. Automatic Control 54 (2009) 1254, as in Gao et al. (2021), (16)-(28): 2n points
+-sqrt(n) e_i of equal weight, drawn behind every node and update. Process noise, that of the linear model, is added at the end
(22). At the measurement it is first order, which for fixes at a lever arm l leaves out |l| sigma^2 with sigma [rad] of the
attitude (2 mm for 1 m and 2.5 deg), for ranges r off s^2 / r with s [m] of the position (5 um for 10 m).
A receiver without IMU moves linearly here, so that its points would give what its transition gives.
Assumes: errors that are Gaussian when drawn.
Fails: where points lie a radian off in attitude (sqrt(n) times 15 deg) they mean nothing, and the linear transition is taken.
Costs two mechanisations per state. At attitude errors of minutes of arc nothing is gained over the linearised filter.
When well specified: mean NEES per state 0.9 to 1.1, NIS per component 0.95 to 1.05.
"""

from dataclasses import dataclass, replace

from navreplay.error_models.clocked import ClockedModel
from navreplay.error_models.considered import ConsideredModel
from navreplay.error_models.error_model import ErrorModel, MotionModel
from navreplay.error_models.launch_inertial import LaunchInertialModel
from navreplay.error_models.ned import NedErrorModel, Propagated
from navreplay.error_models.pointwise import PointwiseModel
from navreplay.mechanisation.strapdown import Leg, NavState
from navreplay.moments.linearised import Linearised
from navreplay.timeline import Floats, LogError

__all__ = ["Cubature"]


@dataclass(frozen=True, slots=True)
class Cubature(Linearised):
    """attitude_states: 4, the additive quaternion of Gao et al. (16 states), or 3, the rotation vector (15 states). Raises
    LogError for another number."""

    attitude_states: int = 4

    def __post_init__(self) -> None:
        if self.attitude_states not in (3, 4):
            given = self.attitude_states
            raise LogError(f"filter: attitude_states is 4 (additive quaternion) or 3 (rotation vector), got {given}")

    def propagate(self, model: ErrorModel, state: NavState, cov: Floats, leg: Leg) -> Propagated:
        """From state and cov (n, n) to the nodes of a leg; the state is moved to the mean of the points at each."""
        return self._by_points(model).propagate(state, cov, leg)

    def _by_points(self, model: ErrorModel) -> ErrorModel:
        if isinstance(model, ConsideredModel):
            return replace(model, inner=self._by_points(model.inner))
        if isinstance(model, ClockedModel):
            return replace(model, motion=self._motion_by_points(model.motion))
        return self._motion_by_points(model) if isinstance(model, NedErrorModel) else model

    def _motion_by_points(self, motion: MotionModel) -> MotionModel:
        if isinstance(motion, LaunchInertialModel):
            raise LogError("filter: cubature points move in NED; choose filter.frame = 'ned', or a method without cubature")
        return PointwiseModel(motion.noise, self.attitude_states) if isinstance(motion, NedErrorModel) else motion
