"""The section of a configuration about what is known of a vehicle's motion."""

from math import radians
from typing import Literal

from pydantic import Field

from navreplay.options import VehicleOptions
from pipelines.config.sections import NotNegative, Positive, Section, Vector

__all__ = ["VehicleSection"]


class VehicleSection(Section):
    """What is known of the vehicle's motion."""

    kind: Literal["unknown", "car", "boat", "aircraft"] = Field(
        "unknown", description="car: zero_velocity, zero_rate and no_slip are on unless they are set; the others: off"
    )
    zero_velocity: bool | None = Field(
        None, description="zero-velocity updates (ZUPT) where the IMU is as quiet as while fixes show rest"
    )
    zero_velocity_std_mps: Positive = Field(0.01, description="standard deviation of that zero [m/s]")
    zero_rate: bool | None = Field(None, description="zero angular rate beside zero velocity")
    no_slip: bool | None = Field(
        None, description="non-holonomic constraint: the rear axle moves neither sideways nor up; x points forward"
    )
    rear_axle_m: Vector | None = Field(
        None, description="forward, right, down from the IMU to the middle of the rear axle [m]; without it about the IMU"
    )
    slip_std_mps: tuple[Positive, Positive] = Field(
        (0.1, 0.1), description="standard deviations of the velocity sideways and up [m/s]"
    )
    wheel_speed: bool = Field(True, description="speed by the wheels, where the log holds one (input.speed)")
    barometer: bool = Field(True, description="changes of height by a barometer, where the log holds one (input.baro)")
    height_hold: bool = Field(False, description="in outages the height stays, as on flat ground or on water")
    height_hold_std_mps: Positive = Field(0.3, description="how fast it may change nevertheless [m/s]")
    mounting_deg: tuple[float, float] | None = Field(
        None,
        description="pitch, yaw of the vehicle's axes in the IMU's; without it found in the log where no_slip is on [deg]",
    )
    mounting_std_deg: NotNegative = Field(
        1.0, description="how well they are known, where they are told or cannot be found [deg]"
    )

    def options(self) -> VehicleOptions:
        """The same in SI units."""
        car = self.kind == "car"
        return VehicleOptions(
            zero_velocity=car if self.zero_velocity is None else self.zero_velocity,
            zero_velocity_std=self.zero_velocity_std_mps,
            zero_rate=car if self.zero_rate is None else self.zero_rate,
            no_slip=car if self.no_slip is None else self.no_slip,
            rear_axle=self.rear_axle_m,
            slip_std=self.slip_std_mps,
            wheel_speed=self.wheel_speed,
            barometer=self.barometer,
            height_hold=self.height_hold,
            height_hold_std=self.height_hold_std_mps,
            mounting=None if self.mounting_deg is None else (radians(self.mounting_deg[0]), radians(self.mounting_deg[1])),
            mounting_std=radians(self.mounting_std_deg),
        )
