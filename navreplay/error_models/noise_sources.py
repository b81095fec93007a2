"""The white noises that drive an error model, by the names of the options that hold their densities."""

from collections.abc import Mapping
from dataclasses import replace

from navreplay.error_models.clocked import ClockedModel
from navreplay.error_models.error_model import ErrorModel, MotionModel
from navreplay.error_models.free_motion import FreeMotionModel
from navreplay.error_models.ned import NedErrorModel
from navreplay.options import FilterOptions

__all__ = ["IMU_SOURCES", "MOTION_SOURCES", "scale_sources", "without_sources"]

IMU_SOURCES = ("gyro_noise", "accel_noise", "gyro_bias_walk", "accel_bias_walk")
"""Fields of `ImuNoise`."""
MOTION_SOURCES = ("horizontal", "vertical")
"""Fields of `MotionOptions`."""


def without_sources(model: ErrorModel) -> dict[str, ErrorModel]:
    """By source that is not zero, the model with it set to zero; empty for a model whose sources are not known."""
    if isinstance(model, ClockedModel):
        return {name: replace(model, motion=motion) for name, motion in _without(model.motion).items()}
    return dict(_without(model))


def _without(model: ErrorModel) -> Mapping[str, MotionModel]:
    if isinstance(model, NedErrorModel):
        noise = model.noise
        return {s: replace(model, noise=replace(noise, **{s: 0.0})) for s in IMU_SOURCES if getattr(noise, s) > 0}
    if isinstance(model, FreeMotionModel):
        options = model.options
        silent = {"horizontal": replace(options, horizontal=0.0), "vertical": replace(options, vertical=0.0)}
        return {s: FreeMotionModel(silent[s]) for s in MOTION_SOURCES if getattr(options, s) > 0}
    return {}


def scale_sources(options: FilterOptions, factors: Mapping[str, float]) -> FilterOptions:
    """The options with the density of each source multiplied by its factor (of standard deviations)."""
    imu = {name: getattr(options.imu_noise, name) * factors[name] for name in IMU_SOURCES if name in factors}
    motion = replace(
        options.motion,
        horizontal=options.motion.horizontal * factors.get("horizontal", 1.0),
        vertical=options.motion.vertical * factors.get("vertical", 1.0),
    )
    return replace(options, imu_noise=replace(options.imu_noise, **imu), motion=motion)
