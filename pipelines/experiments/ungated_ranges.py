"""What the experiments on ranges have in common: how their filters are told, and notes on it."""

from navreplay.options import AlignmentOptions, FilterOptions, GateOptions, RangeOptions
from synthetic_logs.simulation import Scenario

__all__ = ["NOTES", "ungated_options"]

NOTES = (
    "No innovation gate, as in the paper: what an adapter does not weigh down goes into the state.",
    "Heading at the start is that of the reference with the default standard deviation.",
    "The noise of the receiver's clock is told as it is: methods on innovations take what they are told too much of it from R.",
)


def ungated_options(scenario: Scenario) -> FilterOptions:
    """The filter of a scenario with ranges, told the true noise of its IMU and its receiver clock, aligned by the reference,
    without gate."""
    assert scenario.receiver is not None
    clock = scenario.receiver.clock
    return FilterOptions(
        imu_noise=scenario.imu.noise,
        alignment=AlignmentOptions("reference"),
        gate=GateOptions(probability=1.0),
        output_rate=2.0,
        ranges=RangeOptions(clock_noise=clock.frequency_noise, clock_drift_walk=clock.frequency_walk),
    )
