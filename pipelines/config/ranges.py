"""The sections of a configuration about raw ranges, and about motion where there is no IMU."""

from math import pi
from typing import Annotated, Literal

from pydantic import Field

from navreplay.options import MotionOptions, RangeOptions
from pipelines.config.sections import NotNegative, Positive, Section

__all__ = ["MotionSection", "RangeSection"]

_DEG = pi / 180


class RangeSection(Section):
    """Pseudoranges, range rates and the receiver clock."""

    elevation_mask_deg: Annotated[float, Field(ge=0, lt=90)] = Field(10.0, description="lower satellites are not used [deg]")
    cn0_mask_dbhz: NotNegative = Field(30.0, description="weaker signals are not used [dB-Hz]")
    pseudorange_std_m: Positive = Field(
        1.0, description="of a strong signal from the zenith, where the receiver reports none [m]"
    )
    range_rate_std_mps: Positive = Field(
        0.05, description="of a strong signal from the zenith, where the receiver reports none [m/s]"
    )
    pseudorange_noise_scale: Positive = Field(1.0, description="multiplies the standard deviations of pseudoranges")
    range_rate_noise_scale: Positive = Field(1.0, description="multiplies those of range rates")
    cn0_reference_dbhz: Positive = Field(32.0, description="strength at which these variances double [dB-Hz]")
    pseudorange_std_floor_m: Positive = Field(0.3, description="least standard deviation of a pseudorange believed [m]")
    range_rate_std_floor_mps: Positive = Field(0.01, description="least standard deviation of a range rate believed [m/s]")
    ionosphere: bool = Field(True, description="correct by the broadcast model what is not corrected yet")
    troposphere: bool = Field(True, description="correct by a standard atmosphere what is not corrected yet")
    clock_noise_m_rts: Positive = Field(0.1, description="white noise of the receiver clock's frequency [m/sqrt(s)]")
    clock_drift_walk_mps_rts: Positive = Field(
        0.5, description="random walk of its frequency: a TCXO that is shaken; 0.2 at rest [m/s/sqrt(s)]"
    )
    system_offset_std_m: Positive = Field(
        300.0, description="clock offset of another system against the first, before it is seen [m]"
    )
    system_offset_walk_m_rts: NotNegative = Field(0.01, description="its random walk [m/sqrt(s)]")
    clock_jump_m: Positive = Field(150.0, description="a common jump of all pseudoranges beyond this is the clock's [m]")

    multipath_share: Annotated[float, Field(ge=0, lt=1)] = Field(
        0.0, description="share of a pseudorange's variance that is multipath; above 0 it is estimated for every satellite"
    )
    multipath_time_s: Positive = Field(20.0, description="time constant of multipath: minutes at rest, seconds at speed [s]")

    def options(self) -> RangeOptions:
        """The same for the filter."""
        return RangeOptions(
            pseudorange_std=self.pseudorange_std_m,
            range_rate_std=self.range_rate_std_mps,
            pseudorange_std_floor=self.pseudorange_std_floor_m,
            range_rate_std_floor=self.range_rate_std_floor_mps,
            pseudorange_noise_scale=self.pseudorange_noise_scale,
            range_rate_noise_scale=self.range_rate_noise_scale,
            cn0_reference=self.cn0_reference_dbhz,
            elevation_mask=self.elevation_mask_deg * _DEG,
            cn0_mask=self.cn0_mask_dbhz,
            ionosphere=self.ionosphere,
            troposphere=self.troposphere,
            clock_noise=self.clock_noise_m_rts,
            clock_drift_walk=self.clock_drift_walk_mps_rts,
            system_offset_std=self.system_offset_std_m,
            system_offset_walk=self.system_offset_walk_m_rts,
            clock_jump=self.clock_jump_m,
            multipath_share=self.multipath_share,
            multipath_time=self.multipath_time_s,
        )


class MotionSection(Section):
    """Motion of a receiver whose log has no IMU."""

    model: Literal["velocity", "acceleration"] = Field("velocity", description="what is constant but for white noise")
    horizontal: Positive = Field(1.0, description="density of the acceleration [m/s^2/sqrt(Hz)] or jerk [m/s^3/sqrt(Hz)]")
    vertical: Positive = Field(0.3, description="the same, vertical")

    def options(self) -> MotionOptions:
        """The same for the filter."""
        return MotionOptions(self.model, self.horizontal, self.vertical)
