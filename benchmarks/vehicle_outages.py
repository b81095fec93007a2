"""What is known of a car, in outages: python benchmarks/vehicle_outages.py [--seeds N]

The bundled drive with outages of 15 s: the windows of its outages_15s.json, moved by 0, 15, 30, 45 and 60 s, one run each. Then
synthetic drives in town with outages of 30 s, the IMU shaken and askew by
1 and 2 degrees that nobody tells. A line per setting:
horizontal error at the end of the outages, median, 95 % and largest [m], with the interval (95 %) of the median by resampling;
RMS outside the outages [m]; and mean NEES of position at the ends (3 is right).
"""

import argparse
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from navreplay.calibration.wheels import apply_fit, fit_speed
from navreplay.evaluation.metrics import Evaluation, evaluate
from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy.rotation import matrix_from_quat, quat_from_euler
from navreplay.options import FilterOptions, VehicleOptions
from navreplay.timeline import Floats, GnssFixSeries, ImuSeries, Timeline
from pipelines.config.spec import Config, load_config
from pipelines.drive.outages import outage_windows
from pipelines.drive.process import filter_drive, read_drive
from synthetic_logs import SCENARIOS, simulate, truth_at, with_duration
from synthetic_logs.sensors.wheels import WheelErrors, wheels_of
from synthetic_logs.simulation import SyntheticLog

FOLDER = Path(__file__).parent.parent / "examples" / "drive_0708"
MOVED_S = (0.0, 15.0, 30.0, 45.0, 60.0)
SETTINGS = (
    ("nothing", ("vehicle.kind=unknown",)),
    ("zero_velocity, zero_rate", ("vehicle.zero_velocity=true", "vehicle.zero_rate=true")),
    ("kind = car", ("vehicle.kind=car",)),
)
SECOND = 1_000_000_000
SCENARIO = with_duration(SCENARIOS["car-city"], 360.0)
OUTAGES_S = ((120, 150), (190, 220), (260, 290))
WHEELS = WheelErrors(quantum=0.2, scale=1.02, late=0.2)
SHAKEN = {"gyro": 0.005, "accel": 0.2}
"""Vibration of a car in motion, per sample at 100 Hz [rad/s], [m/s^2]; told as the noise of the IMU."""
PITCH, YAW = np.radians(1.0), np.radians(2.0)


def describe(name: str, ends: list[float], outside: list[float], squares: list[float]) -> str:
    rng = np.random.default_rng(0)
    drawn = np.median(rng.choice(ends, (1000, len(ends))), axis=1)
    low, high = np.quantile(drawn, [0.025, 0.975])
    figures = " / ".join(f"{value:.2f}" for value in (*np.percentile(ends, [50, 95]), max(ends)))
    return (
        f"| {name} ({len(ends)} outages) | {figures} | {low:.2f} to {high:.2f} | {np.sqrt(np.mean(outside)):.3f} "
        f"| {np.mean(squares):.1f} |"
    )


def judge(
    evaluation: Evaluation, windows: list[tuple[int, int]], ends: list[float], outside: list[float], squares: list[float]
) -> None:
    """Adds the errors at the ends of windows [ns], the mean square outside, and NEES at the ends."""
    position, t_ns = evaluation.errors["position"], evaluation.t_ns
    error = np.hypot(*position.error[:, :2].T)
    free = np.ones(len(t_ns), dtype=bool)
    for start, end in windows:
        inside = np.flatnonzero((t_ns > start + SECOND // 1000) & (t_ns <= end + SECOND // 1000))
        free &= ~((t_ns > start) & (t_ns <= end + 5 * SECOND))
        if len(inside):
            ends.append(float(error[inside[-1]]))
            squares.append(float(position.nees[inside[-1]]))
    outside.append(float(np.mean(error[free] ** 2)))


def bundled(sets: tuple[str, ...]) -> tuple[list[float], list[float], list[float]]:
    config = load_config(FOLDER / "drive.toml", ["filter.name=fixed", "output.rate_hz=4", *sets])
    drive = read_drive([FOLDER / "drive_0708.mcap"], config)
    assert drive.timeline.fixes is not None
    last_ns = int(drive.timeline.fixes.t_ns[-1])
    ends: list[float] = []
    outside: list[float] = []
    squares: list[float] = []
    for moved in MOVED_S:
        outages = [(start + moved, end + moved) for start, end in config.outages.windows_gps_tow]
        shifted = config.outages.model_copy(update={"windows_gps_tow": tuple(outages), "file": None})
        known = [pair for pair, (_, end) in zip(outages, outage_windows(shifted, drive.timeline.fixes.t_ns), strict=True)
                 if end < last_ns]  # fmt: skip
        section = shifted.model_copy(update={"windows_gps_tow": tuple(known)})
        told: Config = config.model_copy(update={"outages": section})
        evaluation = filter_drive(drive, told).evaluation
        assert evaluation is not None
        judge(evaluation, list(outage_windows(section, drive.timeline.fixes.t_ns)), ends, outside, squares)
    return ends, outside, squares


def without(fixes: GnssFixSeries, begin_ns: int) -> GnssFixSeries:
    seconds = (fixes.t_ns - begin_ns) / 1e9
    kept = ~np.any([(seconds > start) & (seconds <= end) for start, end in OUTAGES_S], axis=0)
    return GnssFixSeries(*(getattr(fixes, field.name)[kept] for field in fields(fixes)))


def shaken(log: SyntheticLog, c_bv: Floats, seed: int) -> ImuSeries:
    """The IMU of a car that vibrates while it moves, askew in it."""
    rng = np.random.default_rng(1000 + seed)
    speed = np.linalg.norm(truth_at(log.scenario.journey, log.imu.t_ns).vel_n, axis=1)
    moving = (speed > 0.05)[:, None]
    gyro = log.imu.gyro + SHAKEN["gyro"] * moving * rng.standard_normal(log.imu.gyro.shape)
    accel = log.imu.accel + SHAKEN["accel"] * moving * rng.standard_normal(log.imu.accel.shape)
    return ImuSeries(log.imu.t_ns, gyro @ c_bv.T, accel @ c_bv.T, log.imu.increments)


def synthetic(vehicle: VehicleOptions, wheeled: bool, seeds: int) -> tuple[list[float], list[float], list[float]]:
    ends: list[float] = []
    outside: list[float] = []
    squares: list[float] = []
    c_bv = matrix_from_quat(quat_from_euler(0.0, PITCH, YAW))
    for seed in range(1, seeds + 1):
        log = simulate(SCENARIO, seed)
        timeline: Timeline = log.timeline()
        assert timeline.imu is not None
        assert timeline.fixes is not None
        begin_ns = int(timeline.imu.t_ns[0])
        imu = shaken(log, c_bv, seed)
        fixes = without(timeline.fixes, begin_ns)
        truth = truth_at(log.scenario.journey, log.imu.t_ns[10:-40:10])
        wheels = wheels_of(truth, WHEELS, np.random.default_rng(seed)) if wheeled else None
        wheels = None if wheels is None else replace(wheels, turn=np.full(len(wheels), np.nan))
        fit = None if wheels is None else fit_speed(wheels, fixes)
        speed = None if wheels is None or fit is None else apply_fit(wheels, fit)
        cut = replace(timeline, imu=imu, fixes=fixes, speed=speed, fix_lever_b=c_bv @ timeline.fix_lever_b)
        noise = replace(SCENARIO.imu.noise, gyro_noise=SHAKEN["gyro"] / 10, accel_noise=SHAKEN["accel"] / 10)
        options = FilterOptions(imu_noise=noise, output_rate=2.0, vehicle=vehicle)
        solution = run_filter(cut, build_method("fixed"), options)
        # attitudes differ by the mounting, which positions do not know
        evaluation = evaluate(solution, replace(log.truth, q_nb=np.full_like(log.truth.q_nb, np.nan)))
        judge(evaluation, [(begin_ns + a * SECOND, begin_ns + b * SECOND) for a, b in OUTAGES_S], ends, outside, squares)
    return ends, outside, squares


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20, help="synthetic drives (20)")
    seeds = parser.parse_args().seeds
    print("| told | median / 95 % / largest | median, 95 % interval | RMS outside | NEES |\n|---|---|---|---|---|")
    for name, sets in SETTINGS:
        print(describe(f"drive_0708, {name}", *bundled(sets)), flush=True)
    stops = VehicleOptions(zero_velocity=True, zero_rate=True)
    car = replace(stops, no_slip=True)
    known = (("nothing", VehicleOptions(), False), ("zero_velocity, zero_rate", stops, False), ("kind = car", car, False))
    for name, vehicle, wheeled in (*known, ("kind = car, wheel speed", car, True)):
        print(describe(f"synthetic, {name}", *synthetic(vehicle, wheeled, seeds)), flush=True)


if __name__ == "__main__":
    main()
