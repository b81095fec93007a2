"""What the experiments on ranges have in common: how their filters are told, and notes on it."""

from navreplay.options import AlignmentOptions, FilterOptions, GateOptions
from synthetic_logs.simulation import Scenario

__all__ = ["NOTES", "ungated_options"]

NOTES = (
    "No innovation gate, as in the paper: what an adapter does not weigh down goes into the state.",
    "Heading at the start is that of the reference with the default standard deviation.",
)


def ungated_options(scenario: Scenario) -> FilterOptions:
    """The filter of a scenario that is told the true noise of its IMU, aligned by the reference, without gate."""
    return FilterOptions(
        imu_noise=scenario.imu.noise,
        alignment=AlignmentOptions("reference"),
        gate=GateOptions(probability=1.0),
        output_rate=2.0,
    )
