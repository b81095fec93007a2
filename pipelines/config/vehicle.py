"""The section of a configuration about what is known of a vehicle's motion."""

from pydantic import Field

from navreplay.options import VehicleOptions
from pipelines.config.sections import Positive, Section

__all__ = ["VehicleSection"]


class VehicleSection(Section):
    """What is known of the vehicle's motion."""

    zero_velocity: bool = Field(
        False, description="zero-velocity updates (ZUPT) where the IMU is as quiet as while fixes show rest"
    )
    zero_velocity_std_mps: Positive = Field(0.01, description="standard deviation of that zero [m/s]")

    def options(self) -> VehicleOptions:
        """The same in SI units."""
        return VehicleOptions(self.zero_velocity, self.zero_velocity_std_mps)
