"""The sections of a configuration about measured attitudes and about launches."""

from math import pi

from pydantic import Field

from navreplay.options import AttitudeOptions, LaunchOptions
from navreplay.timeline import LogError
from pipelines.config.sections import Positive, Section, Vector

__all__ = ["AttitudeSection", "LaunchSection"]

_DEG = pi / 180


class AttitudeSection(Section):
    """Measured attitudes in the filter."""

    use: bool = Field(True, description="let measured attitudes aid the filter; false: they serve alignment alone")
    default_std_deg: Positive = Field(1.0, description="standard deviation where the log tells none [deg]")
    std_floor_arcsec: Positive = Field(0.1, description="least standard deviation believed [arcsec]")
    noise_scale: Positive = Field(1.0, description="multiplies the standard deviations")

    def options(self) -> AttitudeOptions:
        """The same in radians."""
        return AttitudeOptions(self.use, self.default_std_deg * _DEG, self.std_floor_arcsec * _DEG / 3600, self.noise_scale)


class LaunchSection(Section):
    """The launch-inertial frame, where filter.frame chooses it."""

    point_deg_m: Vector | None = Field(
        None, description="latitude [deg], longitude [deg], height [m]; else alignment.position_deg_m"
    )
    azimuth_deg: float = Field(0.0, description="downrange, clockwise from north [deg]")
    after_s: float = Field(0.0, description="time of launch behind the first IMU sample [s]")

    def options(self, position_deg_m: Vector | None) -> LaunchOptions:
        """The same in radians; position_deg_m stands in for the point. Raises LogError where neither is given."""
        point = self.point_deg_m or position_deg_m
        if point is None:
            raise LogError("filter.frame = 'launch-inertial' needs launch.point_deg_m = [latitude, longitude, height]")
        lat, lon, height = point
        return LaunchOptions((lat * _DEG, lon * _DEG, height), self.azimuth_deg * _DEG, self.after_s)
