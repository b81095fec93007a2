"""What a method found of the noise in a whole log, as a configuration that the fixed filter can take over."""

import json
from math import pi

from navreplay.solution import Solution
from pipelines.config.spec import Config, apply_sets, dump_toml, validate

__all__ = ["estimated_config", "estimated_toml"]

_DEG = pi / 180
_UG = 9.80665e-6

_KEYS = {
    "position_noise_scale": ("gnss.position_noise_scale", 1.0),
    "velocity_noise_scale": ("gnss.velocity_noise_scale", 1.0),
    "pseudorange_noise_scale": ("range.pseudorange_noise_scale", 1.0),
    "range_rate_noise_scale": ("range.range_rate_noise_scale", 1.0),
    "attitude_noise_scale": ("attitude.noise_scale", 1.0),
    "correlated_position_std": ("gnss.correlated_position_std_m", 1.0),
    "position_correlation_time": ("gnss.position_correlation_time_s", 1.0),
    "correlated_velocity_std": ("gnss.correlated_velocity_std_mps", 1.0),
    "velocity_correlation_time": ("gnss.velocity_correlation_time_s", 1.0),
    "gyro_noise": ("imu.gyro_noise_dps_rthz", _DEG),
    "accel_noise": ("imu.accel_noise_ug_rthz", _UG),
    "gyro_bias_walk": ("imu.gyro_bias_walk_dps_rts", _DEG),
    "accel_bias_walk": ("imu.accel_bias_walk_mps2_rts", 1.0),
    "horizontal": ("motion.horizontal", 1.0),
    "vertical": ("motion.vertical", 1.0),
}
"""By name in the solution: the key and the SI value of its unit."""


def estimated_toml(config: Config, solution: Solution) -> str:
    """`estimated_config` as a file."""
    note = f"# Noise found by {solution.method} in this log; everything else as it was configured.\n"
    return note + dump_toml(estimated_config(config, solution))


def estimated_config(config: Config, solution: Solution) -> Config:
    """The configuration of a run with the figures that its method found, for the fixed filter."""
    sets = [f"{_KEYS[name][0]}={_in_unit(value, _KEYS[name][1])}" for name, value in solution.estimated.items()]
    data = config.model_dump(mode="json", exclude_none=True)
    data["filter"] = {**data["filter"], "name": "fixed", "parameters": {}}
    return validate(apply_sets(data, sets), "config.estimated.toml")


def _in_unit(value: float | tuple[float, float], unit: float) -> str:
    return json.dumps([part / unit for part in value] if isinstance(value, tuple) else value / unit)
