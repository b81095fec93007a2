"""Methods started in motion with a heading that is far off: python benchmarks/heading_off.py [--seeds 10]

The log begins 45 s into a drive or flight; the filter is told a heading off by 0, 60 or 120 degrees to either side, with a
standard deviation of 60 degrees (of 1 degree at 0), and starts there without trying others. A cell: starts of which the heading
is more than 10 degrees off anywhere from 80 to 115 s behind the start; the median of its RMS error there [deg]; its NEES.
"""

import argparse
from dataclasses import replace

import numpy as np

from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy.rotation import euler_from_quat, wrap_angle
from navreplay.options import AlignmentOptions, FilterOptions
from navreplay.timeline import Floats, GnssFixSeries, ImuSeries
from synthetic_logs import SCENARIOS, SyntheticLog, simulate, with_duration

DRIVES = (("car-city", True), ("car-city", False), ("uav-flight", True), ("uav-flight", False))
OFF_DEG = (0.0, 60.0, 120.0)
_BEGIN_NS = 45_000_000_000
_JUDGED_NS = 80_000_000_000


def in_motion(log: SyntheticLog, velocities: bool) -> SyntheticLog:
    """The log from 45 s on, with or without velocities."""
    assert log.fixes is not None
    start = log.imu.t_ns[0] + _BEGIN_NS
    late, rows = log.imu.t_ns >= start, log.fixes.t_ns >= start
    imu = ImuSeries(log.imu.t_ns[late], log.imu.gyro[late], log.imu.accel[late], log.imu.increments)
    fixes = GnssFixSeries(*(getattr(log.fixes, name)[rows] for name in GnssFixSeries.__slots__))
    if not velocities:
        fixes = replace(fixes, vel_n=np.full_like(fixes.vel_n, np.nan), cov_vel=np.full_like(fixes.cov_vel, np.nan))
    return replace(log, imu=imu, fixes=fixes)


def judge(log: SyntheticLog, method: str, off_deg: float) -> tuple[Floats, Floats]:
    """Errors of heading [rad] and their told deviations, from 80 s behind the start on."""
    assert log.fixes is not None
    row = int(np.argmin(np.abs(log.truth.t_ns - log.fixes.t_ns[0])))
    roll, pitch, yaw = euler_from_quat(log.truth.q_nb[row])
    tilt = float(np.radians(1))
    alignment = AlignmentOptions(
        method="given",
        given=(float(roll), float(pitch), float(yaw + np.radians(off_deg))),
        given_std=(tilt, tilt, float(np.radians(60 if off_deg else 1))),
    )
    options = FilterOptions(imu_noise=log.scenario.imu.noise, output_rate=0.0, alignment=alignment)
    solution = run_filter(log.timeline(), build_method(method), options)
    rows = np.clip(np.searchsorted(log.truth.t_ns, solution.t_ns), 0, len(log.truth) - 1)
    error = wrap_angle(euler_from_quat(solution.q_nb)[:, 2] - euler_from_quat(log.truth.q_nb[rows])[:, 2])
    late = solution.t_ns > solution.t_ns[0] + _JUDGED_NS
    return error[late], solution.std[late, 8]


def main() -> None:
    """A line per drive and offset, a column per method."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--methods", nargs="+", default=["fixed", "ckf", "iekf"])
    arguments = parser.parse_args()
    print("| | " + " | ".join(arguments.methods) + " |\n" + "|---" * (1 + len(arguments.methods)) + "|")
    for scenario, velocities in DRIVES:
        logs = [
            in_motion(simulate(with_duration(SCENARIOS[scenario], 160.0), seed), velocities)
            for seed in range(1, arguments.seeds + 1)
        ]
        for off in OFF_DEG:
            cells = []
            for method in arguments.methods:
                pairs = [judge(log, method, off if seed % 2 else -off) for seed, log in enumerate(logs)]
                lost = sum(bool(np.abs(error).max() > np.radians(10)) for error, _ in pairs)
                rms = np.degrees(np.median([np.sqrt(np.mean(error**2)) for error, _ in pairs]))
                nees = np.mean([np.mean((error / std) ** 2) for error, std in pairs])
                cells.append(f"{lost} of {len(pairs)}; {rms:.2g}; {nees:.2g}")
            kind = "with velocities" if velocities else "positions"
            print(f"| {scenario}, {kind}, {off:.0f} deg off | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
