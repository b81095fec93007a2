"""The sections of a configuration beside ``input``, in the units a user thinks in, and their conversion to filter options.

Every key that has a unit names it. Where two keys exist for one thing (a grade and a figure), the figure wins.
"""

from collections.abc import Mapping
from dataclasses import replace
from math import pi
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from navreplay.options import GRADES, AlignmentOptions, ConsiderOptions, CorrelatedNoise, GapOptions, GateOptions, ImuNoise

__all__ = [
    "AlignmentSection",
    "ConsiderSection",
    "FilterSection",
    "GapSection",
    "GateSection",
    "GnssSection",
    "ImuSection",
    "NotNegative",
    "OutageSection",
    "OutputSection",
    "PositionStdSection",
    "Positive",
    "Section",
    "Vector",
]

_DEG = pi / 180
_MG = 9.80665e-3
_UG = 9.80665e-6
_PPM = 1e-6

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Vector = tuple[float, float, float]
Pair = tuple[Positive, Positive]
Stds = tuple[NotNegative, NotNegative, NotNegative]


class Section(BaseModel):
    """A table of the configuration: frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class ImuSection(Section):
    """Noise model of the IMU: a grade, and figures of a data sheet where they are known."""

    grade: Literal["consumer", "industrial", "tactical", "navigation"] = Field(
        "consumer", description="typical figures for every key below that is not given"
    )
    gyro_noise_dps_rthz: Positive | None = Field(None, description="gyro white noise [deg/s/sqrt(Hz)]")
    accel_noise_ug_rthz: Positive | None = Field(None, description="accelerometer white noise [ug/sqrt(Hz)]")
    gyro_bias_std_dps: Positive | None = Field(None, description="turn-on uncertainty of the gyro bias [deg/s]")
    accel_bias_std_mg: Positive | None = Field(None, description="turn-on uncertainty of the accelerometer bias [mg]")
    gyro_bias_walk_dps_rts: NotNegative | None = Field(None, description="random walk of the gyro bias [deg/s/sqrt(s)]")
    accel_bias_walk_mps2_rts: NotNegative | None = Field(
        None, description="random walk of the accelerometer bias [m/s^2/sqrt(s)]"
    )
    gyro_bias_tau_s: Positive | None = Field(
        None, description="Gauss-Markov time constant of the gyro bias [s]; inf: random walk"
    )
    accel_bias_tau_s: Positive | None = Field(
        None, description="Gauss-Markov time constant of the accelerometer bias [s]; inf: random walk"
    )
    gyro_scale_std_ppm: NotNegative | None = Field(
        None, description="uncertainty of the gyro scale factors [ppm]; above 0 they are estimated"
    )
    accel_scale_std_ppm: NotNegative | None = Field(
        None, description="uncertainty of the accelerometer scale factors [ppm]; above 0 they are estimated"
    )
    gyro_markov_std_dps: NotNegative | None = Field(
        None, description="Gauss-Markov error beside the gyro bias [deg/s]; above 0 it is estimated"
    )
    gyro_markov_tau_s: Positive | None = Field(None, description="its time constant [s]")

    def noise(self) -> ImuNoise:
        """The noise model in SI units."""
        given = {
            "gyro_noise": (self.gyro_noise_dps_rthz, _DEG),
            "accel_noise": (self.accel_noise_ug_rthz, _UG),
            "gyro_bias_std": (self.gyro_bias_std_dps, _DEG),
            "accel_bias_std": (self.accel_bias_std_mg, _MG),
            "gyro_bias_walk": (self.gyro_bias_walk_dps_rts, _DEG),
            "accel_bias_walk": (self.accel_bias_walk_mps2_rts, 1.0),
            "gyro_bias_tau": (self.gyro_bias_tau_s, 1.0),
            "accel_bias_tau": (self.accel_bias_tau_s, 1.0),
            "gyro_scale_std": (self.gyro_scale_std_ppm, _PPM),
            "accel_scale_std": (self.accel_scale_std_ppm, _PPM),
            "gyro_markov_std": (self.gyro_markov_std_dps, _DEG),
            "gyro_markov_tau": (self.gyro_markov_tau_s, 1.0),
        }
        return replace(GRADES[self.grade], **{name: value * unit for name, (value, unit) in given.items() if value is not None})


class AlignmentSection(Section):
    """Where the initial attitude comes from."""

    method: Literal["auto", "given", "attitude", "gyrocompass", "course"] = Field(
        "auto", description="auto takes the first of given angles, attitude channel, gyrocompass, course that the log allows"
    )
    given_deg: Vector | None = Field(None, description="roll, pitch, yaw of the body in NED [deg]")
    given_std_deg: tuple[Positive, Positive, Positive] = Field((1.0, 1.0, 3.0), description="their standard deviations [deg]")
    position_deg_m: Vector | None = Field(
        None, description="start where the log tells no position: latitude [deg], longitude [deg], height [m]"
    )
    position_std_m: tuple[Positive, Positive, Positive] = Field(
        (10.0, 10.0, 10.0), description="standard deviations of that position: north, east, down [m]"
    )
    velocity_mps: Vector = Field((0.0, 0.0, 0.0), description="velocity at that start: north, east, down [m/s]")
    velocity_std_mps: tuple[Positive, Positive, Positive] = Field((0.1, 0.1, 0.1), description="its standard deviations [m/s]")
    static_window_s: Positive = Field(60.0, description="longest static stretch used for levelling [s]")
    min_speed_mps: Positive = Field(2.0, description="GNSS speed from which course counts as heading [m/s]")
    course_std_deg: Positive = Field(3.0, description="least standard deviation of a heading from course [deg]")
    forward_deg: float | None = Field(
        None,
        description="where the direction of travel lies in the body's x-y plane, from x to the right; without it found in the "
        "log where it is plain [deg]",
    )
    max_gyrocompass_std_deg: Positive = Field(2.0, description="a gyrocompass worse than this is not used [deg]")

    @model_validator(mode="after")
    def _check_given(self) -> Self:
        if self.method == "given" and self.given_deg is None:
            raise ValueError('method = "given" needs given_deg = [roll, pitch, yaw]')
        return self

    def options(self) -> AlignmentOptions:
        """The same in radians."""
        roll, pitch, yaw = self.given_std_deg
        return AlignmentOptions(
            method=self.method,
            given=None if self.given_deg is None else _radians(self.given_deg),
            given_std=_radians((roll, pitch, yaw)),
            position=None if self.position_deg_m is None else (*_radians(self.position_deg_m)[:2], self.position_deg_m[2]),
            position_std=self.position_std_m,
            velocity=self.velocity_mps,
            velocity_std=self.velocity_std_mps,
            static_window=self.static_window_s,
            min_speed=self.min_speed_mps,
            course_std=self.course_std_deg * _DEG,
            forward=0.0 if self.forward_deg is None else self.forward_deg * _DEG,
            max_gyrocompass_std=self.max_gyrocompass_std_deg * _DEG,
        )


def _radians(angles_deg: Vector) -> Vector:
    roll, pitch, yaw = angles_deg
    return roll * _DEG, pitch * _DEG, yaw * _DEG


class GateSection(Section):
    """Test of each measurement against its prediction."""

    probability: Annotated[float, Field(gt=0, le=1)] = Field(
        0.9999, description="probability of a good measurement to pass; 1.0 switches the gate off"
    )
    reset_after: Annotated[int, Field(ge=0)] = Field(
        10, description="epochs rejected in a row (and 10 s, where the filter had agreed) before it is widened; 0: never"
    )

    def options(self) -> GateOptions:
        """The same for the filter."""
        return GateOptions(self.probability, self.reset_after)


class GapSection(Section):
    """What to do where IMU samples are missing."""

    bridge_s: NotNegative = Field(0.5, description="gaps up to this long are bridged with the neighbouring samples [s]")
    longer: Literal["reset", "refuse"] = Field("reset", description="longer gaps: align anew behind them, or refuse the log")

    def options(self) -> GapOptions:
        """The same for the filter."""
        return GapOptions(self.bridge_s, self.longer)


class FilterSection(Section):
    """The method (``navreplay filters`` lists them) and how it runs."""

    name: str = Field("checked", description="name of the method")
    use: Literal["auto", "fixes", "ranges", "attitudes"] = Field(
        "auto",
        description="what aids the filter beside attitudes: fixes, ranges (auto: where the log has them) or nothing else",
    )
    frame: Literal["ned", "launch-inertial"] = Field(
        "ned", description="frame in which motion and errors move; launch-inertial: see [launch]"
    )
    parameters: Mapping[str, object] = Field(default_factory=dict, description="parameters of the method, by name")
    covariance_interval_s: Positive = Field(0.05, description="longest step of the covariance propagation [s]")
    use_velocity: bool = Field(True, description="use GNSS velocity where the log has it")
    smooth: bool = Field(False, description="smooth: every row from the measurements before and behind it")


class ConsiderSection(Section):
    """Unknown constant biases that eckf and psteckf reckon with but do not estimate: standard deviations, 0 where none."""

    position_bias_std_m: Stds = Field((1.0, 1.0, 2.0), description="of measured positions: [north, east, down] [m]")
    velocity_bias_std_mps: Stds = Field((0.0, 0.0, 0.0), description="of measured velocities: [north, east, down] [m/s]")
    zenith_delay_std_m: NotNegative = Field(
        0.0, description="of pseudoranges, towards the zenith; grows by 1 / sin(elevation) [m]"
    )
    position_rate_std_mps: Stds = Field(
        (0.0, 0.0, 0.0), description="added to the derivative of the position: [north, east, down] [m/s]"
    )
    velocity_rate_std_mps2: Stds = Field(
        (0.0, 0.0, 0.0), description="added to the derivative of the velocity: [north, east, down] [m/s^2]"
    )
    every_method: bool | Literal["ranges"] = Field(
        "ranges",
        description="true: reckon with them in every method, false: in eckf and psteckf alone; 'ranges': where ranges aid the "
        "filter, in every method that can",
    )

    def options(self) -> ConsiderOptions:
        """The same for the filter."""
        return ConsiderOptions(
            position_bias=self.position_bias_std_m,
            velocity_bias=self.velocity_bias_std_mps,
            zenith_delay=self.zenith_delay_std_m,
            position_rate=self.position_rate_std_mps,
            velocity_rate=self.velocity_rate_std_mps2,
            every_method=self.every_method,
        )


class PositionStdSection(Section):
    """Standard deviations, horizontal and vertical [m], of fixes that come without a covariance, by kind of fix."""

    unknown: Pair = (3.0, 5.0)
    single: Pair = (3.0, 5.0)
    differential: Pair = (1.0, 2.0)
    float: Pair = (0.3, 0.6)
    fixed: Pair = (0.02, 0.04)
    dead_reckoning: Pair = (10.0, 20.0)

    def by_status(self) -> dict[str, Pair]:
        """The same by name of FixStatus."""
        return {name.upper(): pair for name, pair in self.model_dump().items()}


class GnssSection(Section):
    """How far GNSS measurements are believed."""

    noise_scale: Positive = Field(1.0, description="multiplies the standard deviations of all GNSS measurements")
    position_noise_scale: Positive = Field(1.0, description="those of positions besides")
    velocity_noise_scale: Positive = Field(1.0, description="those of velocities besides")
    correlated_position_std_m: tuple[NotNegative, NotNegative] = Field(
        (0.0, 0.0),
        description="position errors that stay, beside those told: [horizontal, vertical]; above 0 they are estimated [m]",
    )
    position_correlation_time_s: Positive = Field(30.0, description="how long they stay: time of correlation [s]")
    correlated_velocity_std_mps: tuple[NotNegative, NotNegative] = Field((0.0, 0.0), description="the same of velocities [m/s]")
    velocity_correlation_time_s: Positive = Field(3.0, description="how long those stay [s]")
    position_std_floor_m: NotNegative = Field(0.01, description="least standard deviation of a position believed [m]")
    velocity_std_floor_mps: NotNegative = Field(0.02, description="least standard deviation of a velocity believed [m/s]")
    default_position_std_m: PositionStdSection = Field(
        PositionStdSection(), description="where the covariance is unknown: [horizontal, vertical] by kind of fix [m]"
    )
    default_velocity_std_mps: Pair = Field(
        (0.1, 0.2), description="where the covariance is unknown: [horizontal, vertical] [m/s]"
    )

    def correlated_noise(self) -> tuple[CorrelatedNoise, ...]:
        """The errors that stay and are not zero."""
        position = CorrelatedNoise("position", self.correlated_position_std_m, self.position_correlation_time_s)
        velocity = CorrelatedNoise("velocity", self.correlated_velocity_std_mps, self.velocity_correlation_time_s)
        return tuple(noise for noise in (position, velocity) if any(noise.std))


class OutputSection(Section):
    """What is written."""

    rate_hz: NotNegative = Field(10.0, description="rows between GNSS epochs [Hz]; 0: only at GNSS epochs")
    output_point_m: Vector | None = Field(
        None, description="point the solution describes: forward, right, down from the IMU [m]; without it the IMU"
    )
    recording: bool = Field(True, description="write recording.rrd")
    format: Literal["csv", "parquet"] = Field("csv", description="solution.csv, or solution.parquet with all digits")


class OutageSection(Section):
    """Fixes, or ranges where those are used, kept from the filter, to see how it does without them."""

    fix_interval_s: Positive | None = Field(None, description="keep one fix per interval, counted from the first fix [s]")
    windows_gps_tow: tuple[tuple[float, float], ...] = Field(
        (), description="windows [start, end] in seconds of the GPS week; a fix with start < t <= end is withheld"
    )
    week: Annotated[int, Field(ge=0)] | None = Field(
        None, description="full GPS week of the windows; without it the week of the first fix"
    )
    satellites_kept: Annotated[int, Field(ge=0)] = Field(
        0, description="satellites whose ranges stay in the windows, those seen most in each"
    )
    file: str | None = Field(None, description="JSON file with the keys week and windows, read in place of windows_gps_tow")

    @model_validator(mode="after")
    def _check_windows(self) -> Self:
        if self.file is not None and self.windows_gps_tow:
            raise ValueError("give either file or windows_gps_tow, not both")
        for start, end in self.windows_gps_tow:
            if end <= start:
                raise ValueError(f"windows_gps_tow: the window [{start}, {end}] ends before it starts")
        return self
