"""A hand-made drive for tests of metrics and outputs: no filter, errors drawn to match the covariance it carries."""

import numpy as np

from importers.findings import Finding
from navreplay.evaluation.metrics import evaluate, find_outages
from navreplay.evaluation.verdict import judge
from navreplay.geodesy.earth import move_lla
from navreplay.geodesy.rotation import quat_from_euler, quat_from_rotvec, quat_multiply
from navreplay.geodesy.time_scales import gps_from_week_tow
from navreplay.solution import Event, InnovationSeries, RowStatus, Solution
from navreplay.timeline import ChannelUse, Floats, GnssFixSeries, Provenance, SourceFile, Timeline, Times, Trajectory
from pipelines.config.spec import Config
from pipelines.drive.result import RunResult

ORIGIN = np.array([np.radians(40.097), np.radians(-105.147), 1560.0])
START_NS = int(gps_from_week_tow(2374, np.array([243300.5]))[0])
STATES = tuple(f"{name}_{axis}" for name in ("position", "velocity", "attitude", "gyro_bias", "accel_bias") for axis in "xyz")
UNITS = ("m",) * 3 + ("m/s",) * 3 + ("rad",) * 3 + ("rad/s",) * 3 + ("m/s^2",) * 3


def _path(t_s: Floats) -> tuple[Floats, Floats, Floats]:
    """Offset from ORIGIN, velocity (k, 3) NED and yaw (k,) of a figure of eight that drifts north."""
    a, b = 2 * np.pi / 120, 2 * np.pi / 240
    offset = np.stack([120 * np.sin(a * t_s) + 0.3 * t_s, 300 * np.sin(b * t_s), 4 * np.sin(b * t_s)], axis=1)
    velocity = np.stack([120 * a * np.cos(a * t_s) + 0.3, 300 * b * np.cos(b * t_s), 4 * b * np.cos(b * t_s)], axis=1)
    return offset, velocity, np.arctan2(velocity[:, 1], velocity[:, 0])


def _attitude(t_s: Floats) -> Floats:
    return quat_from_euler(0.03 * np.sin(t_s / 7), 0.05 * np.sin(t_s / 11), _path(t_s)[2])


def truth(t_ns: Times) -> Trajectory:
    """The truth at t_ns (k,)."""
    t_s = (t_ns - START_NS) / 1e9
    offset, velocity, _ = _path(t_s)
    return Trajectory(t_ns, move_lla(ORIGIN, offset), velocity, _attitude(t_s), np.full((len(t_ns), 3, 3), np.nan))


def _since_fix(t_s: Floats, fix_s: Floats) -> Floats:
    return np.asarray(t_s - fix_s[np.maximum(np.searchsorted(fix_s, t_s + 1e-6) - 1, 0)])


def _draw(std: Floats, t_s: Floats, rng: np.random.Generator, knot_s: float = 4.0) -> Floats:
    """Smooth errors (k, n) with standard deviations std (k, n)."""
    knots = np.arange(t_s[0] - knot_s, t_s[-1] + 2 * knot_s, knot_s)
    values = rng.standard_normal((len(knots), std.shape[1]))
    unit = np.stack([np.interp(t_s, knots, values[:, i]) for i in range(std.shape[1])], axis=1)
    x = (t_s - knots[0]) / knot_s % 1
    return np.asarray(unit / np.sqrt(x**2 + (1 - x) ** 2)[:, None] * std)


def _innovations(kind: str, unit: str, t_ns: Times, std: float, rng: np.random.Generator, bad: Floats) -> InnovationSeries:
    noise = np.full((len(t_ns), 3), std) * rng.uniform(0.9, 1.6, (len(t_ns), 1))
    spread = np.hypot(noise, 0.7 * std)
    residual = rng.standard_normal(noise.shape) * spread
    residual[bad] *= 12
    return InnovationSeries(
        kind=kind,
        labels=("north", "east", "down"),
        unit=unit,
        t_ns=t_ns,
        residual=residual,
        std=spread,
        noise_std=noise,
        nominal_std=np.full_like(noise, std),
        nis=np.sum((residual / spread) ** 2, axis=1),
        used=~bad,
        reason=tuple("gate" if reject else "" for reject in bad),
    )


def _state(t_ns: Times, since: Floats, rng: np.random.Generator, scale: float) -> dict[str, Floats]:
    t_s = (t_ns - START_NS) / 1e9
    grown = np.stack([0.02 + 0.03 * since**2, 0.02 + 0.03 * since**2, 0.04 + 0.02 * since**2], axis=1) * scale
    moving = np.stack([0.03 + 0.06 * since] * 3, axis=1) * scale
    tilt = np.tile(np.radians([0.1, 0.1, 0.6]), (len(t_s), 1))
    settle = 0.2 + 0.8 * np.exp(-t_s / 60)[:, None]
    gyro, accel = np.radians(0.02) * settle * np.ones(3), 0.03 * settle * np.ones(3)
    std = np.concatenate([grown, moving, tilt, gyro, accel], axis=1)
    error = _draw(std, t_s, rng)
    exact = truth(t_ns)
    return {
        "lla": move_lla(exact.lla, error[:, :3]),
        "vel_n": exact.vel_n + error[:, 3:6],
        "q_nb": quat_multiply(quat_from_rotvec(error[:, 6:9]), exact.q_nb),
        "gyro_bias": np.radians([0.02, -0.01, 0.03]) + error[:, 9:12] * 0.3,
        "accel_bias": np.array([0.05, -0.02, 0.1]) + error[:, 12:] * 0.3,
        "cov": std[:, :, None] ** 2 * np.eye(15),
    }


def make_solution(
    duration_s: float = 60.0,
    outage_every_s: float = 30.0,
    outage_s: float = 10.0,
    seed: int = 1,
    scale: float = 1.0,
    rate: float = 10.0,
) -> Solution:
    """Rows at rate [Hz], fixes at 1 Hz save in outages, a rejected fix every 17 s."""
    rng = np.random.default_rng(seed)
    t_ns = START_NS + np.arange(int(duration_s * rate) + 1) * round(1e9 / rate)
    fix_ns = START_NS + np.arange(int(duration_s) + 1) * 1_000_000_000
    phase = (fix_ns - START_NS) / 1e9 % outage_every_s
    fix_ns = fix_ns[(phase <= outage_every_s - outage_s) | (fix_ns == START_NS)]
    bad = (fix_ns - START_NS) // 1_000_000_000 % 17 == 16
    since = _since_fix((t_ns - START_NS) / 1e9, (fix_ns[~bad] - START_NS) / 1e9)
    status = np.zeros(len(t_ns), dtype=np.int8)
    status[np.isin(t_ns, fix_ns[~bad])] = RowStatus.UPDATED
    status[np.isin(t_ns, fix_ns[bad])] = RowStatus.REJECTED
    solution = Solution(
        t_ns=t_ns,
        **_state(t_ns, since, rng, scale),
        status=status,
        state_names=STATES,
        state_units=UNITS,
        method="fixed",
        innovations=(
            _innovations("position", "m", fix_ns, 0.05, rng, bad),
            _innovations("velocity", "m/s", fix_ns, 0.05, rng, np.zeros(len(fix_ns), dtype=bool)),
        ),
        events=(
            Event(START_NS, "info", "aligned: levelled at rest, heading from course"),
            Event(START_NS + 16_000_000_000, "warning", "position rejected: north 0.9 m at 0.07 m"),
        ),
    )
    return _with_outages(solution)


def _with_outages(solution: Solution) -> Solution:
    values = {name: getattr(solution, name) for name in Solution.__dataclass_fields__}
    return Solution(**values | {"outages": find_outages(solution)})


def make_timeline(solution: Solution, topic: str = "/gps/fix", reference_rate: float = 4.0) -> Timeline:
    """Fixes at the innovations' epochs and the truth as reference."""
    t_ns = solution.innovations[0].t_ns
    exact = truth(t_ns)
    rng = np.random.default_rng(5)
    cov = np.tile(np.eye(3) * 0.05**2, (len(t_ns), 1, 1))
    fixes = GnssFixSeries(
        t_ns,
        move_lla(exact.lla, rng.standard_normal((len(t_ns), 3)) * 0.05),
        exact.vel_n,
        cov,
        cov,
        np.where(np.arange(len(t_ns)) % 20 < 15, 4, 3).astype(np.int8),
    )
    step = round(1e9 / reference_rate)
    reference = truth(np.arange(solution.t_ns[0], solution.t_ns[-1] + 1, step))
    count = len(t_ns)
    return Timeline(
        fixes=fixes,
        reference=reference,
        provenance=Provenance(
            files=(SourceFile("drive.mcap", "mcap", 123456, "ab" * 32),),
            channels=(
                ChannelUse("/imu", "drive.mcap", "sensor_msgs/msg/Imu", "imu", 6000, 5998, {"not finite": 2}),
                ChannelUse(topic, "drive.mcap", "sensor_msgs/msg/NavSatFix", "fix", count, count),
            ),
            assumptions=("axes of /imu taken as forward-left-up: gravity reads +9.8 m/s^2 on z",),
        ),
    )


def make_result(solution: Solution | None = None, topic: str = "/gps/fix", with_reference: bool = True) -> RunResult:
    """A processed drive; without a reference when asked."""
    solution = make_solution() if solution is None else solution
    timeline = make_timeline(solution, topic)
    if not with_reference:
        timeline = Timeline(fixes=timeline.fixes, provenance=timeline.provenance)
    return RunResult(
        config=Config(),
        timeline=timeline,
        used=timeline,
        solution=solution,
        evaluation=evaluate(solution, timeline.reference) if timeline.reference is not None else None,
        verdict=judge(solution, timeline),
        findings=(Finding("warning", "imu-rate", "The IMU rate varies by 12 %.", "Check the driver's stamps."),),
        timing_s={"read": 0.4, "filter": 0.2},
    )
