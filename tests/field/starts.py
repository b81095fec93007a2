"""The heading that the filter starts with, over random starts: its error over its told standard deviation.

    python -m tests.field.starts [--starts 100]

By its number each start is drawn: how the vehicle begins (standing, backing out, rolling slowly, driving, in a turn, backing),
its course, speed, grade of IMU, rate of the fixes, with and without velocities. The default method filters its first 60 s.
"""

import argparse
from collections import defaultdict
from dataclasses import replace
from math import pi

import numpy as np

from navreplay.filters.presets import build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy import rotation
from navreplay.options import FilterOptions
from navreplay.timeline import ImuSeries, Timeline
from synthetic_logs import SCENARIOS, SyntheticLog, simulate
from synthetic_logs.motion.manoeuvres import Leg, Motion, accelerate, straight, turn
from synthetic_logs.simulation import Journey, Scenario

DEG = pi / 180
WAYS = ("stands", "backs out", "rolls slowly", "drives", "turns", "drives backwards")
_HALF_TURN = np.diag([-1.0, -1.0, 1.0])


def draw(number: int) -> tuple[str, SyntheticLog]:
    """The way a start is made, and its log."""
    rng = np.random.default_rng([number, 77])
    way = WAYS[number % len(WAYS)]
    course, speed = rng.uniform(-pi, pi), rng.uniform(5.0, 20.0)
    bend = turn(rng.choice([-1, 1]) * rng.uniform(60, 120) * DEG, rng.uniform(10, 25) * DEG)
    legs: Leg = straight(rng.uniform(3, 20)) + bend + accelerate(rng.uniform(6, 18), 8.0) + straight(10.0)
    if way in ("stands", "backs out"):
        first, legs = 0.0, straight(rng.uniform(5, 25)) + accelerate(speed, rng.uniform(5, 12)) + legs
    elif way == "rolls slowly":
        first, legs = rng.uniform(0.5, 2.0), straight(rng.uniform(5, 15)) + accelerate(speed, 10.0) + legs
    elif way == "turns":
        first, legs = rng.uniform(4.0, 10.0), bend + straight(5.0) + accelerate(speed, 8.0) + legs
    else:
        first = speed
    base = SCENARIOS[str(rng.choice(["car-city", "car-highway", "uav-flight"]))]
    motion = Motion((rng.uniform(-60, 60) * DEG, rng.uniform(-pi, pi), 100.0), legs, speed=first, course=course)
    journey = Journey(motion, 60.0, gnss_rate=float(rng.choice([1.0, 5.0])), lever_b=base.journey.lever_b)
    gnss = base.gnss
    assert gnss is not None
    if rng.random() < 0.5:
        gnss = replace(gnss, velocity_std=None)
    return way, simulate(Scenario("start", "A random start.", journey, base.imu, gnss), number)


def backed(log: SyntheticLog) -> SyntheticLog:
    """The same drive with the body turned about: what drove forwards backs."""
    imu = ImuSeries(log.imu.t_ns, log.imu.gyro @ _HALF_TURN, log.imu.accel @ _HALF_TURN, log.imu.increments)
    return replace(log, imu=imu)


def judge(number: int) -> tuple[str, float, float, str]:
    """The way of a start, the error of its heading [rad], its told standard deviation [rad] and where it came from."""
    way, log = draw(number)
    turned = 0.0
    timeline: Timeline = log.timeline()
    if way in ("backs out", "drives backwards"):
        log = backed(log)
        turned = pi
        timeline = replace(log.timeline(), fix_lever_b=_HALF_TURN @ timeline.fix_lever_b)
    solution = run_filter(timeline, build_method("checked"), FilterOptions(imu_noise=log.scenario.imu.noise, output_rate=0.0))
    row = int(np.argmin(np.abs(log.truth.t_ns - solution.t_ns[0])))
    true = rotation.euler_from_quat(log.truth.q_nb[row])[2] + turned
    error = float(rotation.wrap_angle(rotation.euler_from_quat(solution.q_nb[0])[2] - true))
    text = next((event.text for event in solution.events if "aligned" in event.text), "")
    tried = any("heading" in event.text and "tried" in event.text for event in solution.events)
    return way, error, float(solution.std[0, 8]), text.rsplit("from ", 1)[-1] + (", then tried" if tried else "")


def main() -> None:
    """Prints a line per way, and the starts that err by more than three standard deviations."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=100)
    starts = [judge(number) for number in range(parser.parse_args().starts)]
    ways = defaultdict(list)
    for number, (way, error, std, source) in enumerate(starts):
        ways[way].append((error, std))
        if abs(error) > 3 * std:
            print(f"start {number}: {way}, {np.degrees(error):.1f} deg off, told {np.degrees(std):.1f}, from {source}")
    for way, pairs in [*ways.items(), ("all", [(error, std) for _, error, std, _ in starts])]:
        error, std = np.array(pairs).T
        nees = float(np.mean((error / std) ** 2))
        print(
            f"{way:<18} {len(pairs):>4}  NEES {nees:6.2f}  error {np.degrees(np.sqrt(np.mean(error**2))):6.2f} deg rms", end=""
        )
        print(f"  told {np.degrees(np.sqrt(np.mean(std**2))):6.2f}  largest {np.degrees(np.abs(error).max()):6.2f}")


if __name__ == "__main__":
    main()
