"""Experiments: methods against each other and against a paper, on a synthetic scenario over many seeds."""

import multiprocessing
import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from time import process_time

import numpy as np

from navreplay.evaluation.metrics import evaluate, normalised_squares
from navreplay.filters.presets import Method, build_method
from navreplay.filters.run import run_filter
from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.options import FilterOptions
from navreplay.solution import Solution, WeightSeries
from navreplay.timeline import Floats, LogError, Times
from pipelines.monte_carlo.perturbed import Perturbation, Perturbed
from pipelines.monte_carlo.restarted import Restarted
from pipelines.monte_carlo.told_noise import Knowledge, NoiseRatio, StartErrors, compare_noise, displace_start, tell
from pipelines.monte_carlo.told_process import ToldProcess
from synthetic_logs.motion.ballistic import BallisticFlight
from synthetic_logs.simulation import Journey, Scenario, SyntheticLog, simulate, truth_at

__all__ = [
    "CONSISTENT",
    "DEGREES",
    "LAUNCH_ARCSEC",
    "QUANTITIES",
    "Arm",
    "ArmOutcome",
    "AttitudeScale",
    "ConsistencyClaim",
    "Experiment",
    "NoiseClaim",
    "OrderClaim",
    "Outcome",
    "Published",
    "PublishedNoise",
    "RatioClaim",
    "Stretch",
    "run_experiment",
    "run_seed",
]

QUANTITIES = ("position", "velocity", "attitude")
CONSISTENT = (*QUANTITIES, "gyro bias")
"""Of what NEES is judged."""


@dataclass(frozen=True, slots=True)
class AttitudeScale:
    """In what attitude errors are told: unit, how many of it are a radian, and what their three components are called."""

    unit: str
    per_radian: float
    axes: tuple[str, str, str]


DEGREES = AttitudeScale("deg", float(np.degrees(1.0)), ("north", "east", "heading"))
LAUNCH_ARCSEC = AttitudeScale("arcsec", float(np.degrees(3600.0)), ("roll", "yaw", "pitch"))
"""Of a ballistic flight, whose attitude errors are resolved in its launch frame."""


@dataclass(frozen=True, slots=True)
class Arm:
    """One line of an experiment's tables. method: a preset, with parameters. told: what of the true noise it knows. restarts:
    times in seconds from the start of the log at which its adapter forgets all it has seen. options: in place of the
    experiment's."""

    label: str
    method: str
    parameters: Mapping[str, object] = field(default_factory=dict)
    told: Knowledge = "log"
    restarts: tuple[float, ...] = ()
    options: FilterOptions | None = None


@dataclass(frozen=True, slots=True)
class Stretch:
    """Part of a scenario: windows (start, end) in seconds from the start of the log, the end excluded."""

    name: str
    windows: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class Published:
    """A row of a paper's table: root mean square errors by label of the arm, of a quantity (see `rmse_figures`) in a stretch.
    source: where in the paper."""

    source: str
    stretch: str
    quantity: str
    figures: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class PublishedNoise:
    """A row of a paper's table of R: the mean variance that an arm used in a stretch, by component (``position north``) in SI
    units. source: where in the paper."""

    source: str
    stretch: str
    arm: str
    figures: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class OrderClaim:
    """A paper's statement that one arm's error is smaller than another's. source: where, and by how much."""

    source: str
    stretch: str
    quantity: str
    better: str
    worse: str


@dataclass(frozen=True, slots=True)
class NoiseClaim:
    """An explanation to be tested: the median ratio of the R an arm uses to the true one, for a kind of measurement in a
    stretch, lies between low and high. text: what the paper says."""

    text: str
    stretch: str
    kind: str
    arm: str
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class RatioClaim:
    """A promise: the error of an arm in a quantity and a stretch is at most so many times that of the reference. most None:
    the distance is told without a promise."""

    stretch: str
    quantity: str
    arm: str
    reference: str
    most: float | None


@dataclass(frozen=True, slots=True)
class ConsistencyClaim:
    """A promise: the NEES of an arm in a quantity and a stretch is accepted. reference: an arm to tell beside it."""

    stretch: str
    quantity: str
    arm: str
    reference: str


@dataclass(frozen=True, slots=True)
class Experiment:
    """Everything that decides an experiment but the seeds. description is one line, paper names the source. arms: the first is
    the reference of paired differences. drawn: labels of up to six arms that the plots show. start: errors that every filter
    starts with, beside those of the alignment in options; None: those of the first fix. perturbations: of what arms predict
    that are not told the model. changes: times [s] at which another hypothesis of a bank becomes the true one, and its label.
    attitude: how its errors are told. notes: readings, choices."""

    name: str
    description: str
    paper: str
    scenario: Scenario
    options: FilterOptions
    arms: tuple[Arm, ...]
    stretches: tuple[Stretch, ...]
    drawn: tuple[str, ...]
    published: tuple[Published, ...] = ()
    orders: tuple[OrderClaim, ...] = ()
    noise_claims: tuple[NoiseClaim, ...] = ()
    ratios: tuple[RatioClaim, ...] = ()
    accepted: tuple[ConsistencyClaim, ...] = ()
    published_noise: tuple[PublishedNoise, ...] = ()
    start: StartErrors | None = None
    perturbations: tuple[Perturbation, ...] = ()
    changes: tuple[tuple[float, str], ...] = ()
    attitude: AttitudeScale = DEGREES
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, slots=True)
class ArmOutcome:
    """One arm on one seed. errors (k, 9): position NED [m], velocity NED [m/s] and rotation vector [rad], in NED or, of a
    ballistic flight, in its launch frame, estimated minus true. nees (k, 4): of the three, and of the gyro bias where the
    filter estimates one constant. Both NaN where the solution does not
    reach. noise: by kind of measurement. epochs: with a measurement. weights: of a bank."""

    errors: Floats
    nees: Floats
    noise: Mapping[str, NoiseRatio]
    epochs: int
    weights: WeightSeries | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Outcome:
    """All arms on one seed, at times t_s (k,) from the start of the log. failures: by arm, why it gave no solution. seconds: by
    arm, the CPU time of filtering."""

    seed: int
    t_s: Floats
    arms: Mapping[str, ArmOutcome]
    failures: Mapping[str, str]
    seconds: Mapping[str, float]


def run_experiment(
    experiment: Experiment, seeds: int, jobs: int, progress: Callable[[str, float], None] | None = None
) -> tuple[Outcome, ...]:
    """The outcomes of seeds 1 to `seeds`, in their order, computed by `jobs` processes.

    Every arm sees the same log of a seed, so that differences between arms are paired. Each seed is computed by a process of
    one thread, whatever jobs is, so that outcomes do not depend on it. Raises LogError for fewer than one seed or job.
    """
    if seeds < 1 or jobs < 1:
        raise LogError(f"experiment: at least one seed and one job are needed, got {seeds} and {jobs}")
    outcomes = []
    with _single_threaded(), ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        for done, outcome in enumerate(pool.map(partial(run_seed, experiment), range(1, seeds + 1)), start=1):
            outcomes.append(outcome)
            if progress is not None:
                progress(experiment.name, done / seeds)
    return tuple(outcomes)


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Processes started within take one thread each for linear algebra."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def run_seed(experiment: Experiment, seed: int) -> Outcome:
    """All arms on the log of one seed. An arm that a LogError stops is a failure of that arm."""
    log = simulate(experiment.scenario, seed)
    t_ns = _judged_epochs(experiment.scenario.journey)
    arms, failures, seconds = {}, {}, {}
    for arm in experiment.arms:
        timeline, method = tell(log, arm.told), _build(arm, experiment, log)
        if experiment.start is not None:
            timeline = displace_start(timeline, log, experiment.start)
        begin = process_time()
        try:
            solution = run_filter(timeline, method, arm.options or experiment.options)
        except LogError as error:
            failures[arm.label] = str(error)
            continue
        seconds[arm.label] = process_time() - begin
        arms[arm.label] = _judge(solution, log, t_ns)
    return Outcome(seed, (t_ns - log.scenario.journey.start_ns) / 1e9, arms, failures, seconds)


def _build(arm: Arm, experiment: Experiment, log: SyntheticLog) -> Method:
    method, start_ns = build_method(arm.method, arm.parameters), log.scenario.journey.start_ns
    if arm.restarts:
        times = tuple(start_ns + round(t_s * 1e9) for t_s in arm.restarts)
        method = replace(method, adapter=Restarted(method.adapter, times))
    if experiment.perturbations and arm.told != "model":
        method = replace(method, rule=Perturbed(experiment.perturbations, start_ns))
    if log.scenario.imu.noise_windows and arm.told != "log":
        method = replace(method, rule=ToldProcess(log.scenario.imu.noise_windows, start_ns))
    return method


def _judged_epochs(journey: Journey) -> Times:
    """Once a second, on the half second: between the epochs of a receiver that measures on the second."""
    return journey.start_ns + 500_000_000 + np.arange(int(journey.duration - 0.5) + 1, dtype=np.int64) * 1_000_000_000


def _judge(solution: Solution, log: SyntheticLog, t_ns: Times) -> ArmOutcome:
    reference = truth_at(log.scenario.journey, t_ns)
    evaluation = evaluate(solution, reference)
    at = np.searchsorted(t_ns, evaluation.t_ns)
    errors, nees = np.full((len(t_ns), 9), np.nan), np.full((len(t_ns), len(CONSISTENT)), np.nan)
    # where attitudes are measured the position shall not count: against the stars, still resolved in NED
    judged = evaluation.errors | {"attitude": evaluation.errors.get("inertial_attitude", evaluation.errors["attitude"])}
    for i, quantity in enumerate(QUANTITIES):
        errors[at, 3 * i : 3 * i + 3] = judged[quantity].error
        nees[at, i] = judged[quantity].nees
    nees[at, -1] = _gyro_bias_nees(solution, log, t_ns[at])
    motion = log.scenario.journey.motion
    if isinstance(motion, BallisticFlight):
        elapsed = (t_ns - log.scenario.journey.start_ns) / 1e9
        level = np.tile([1.0, 0.0, 0.0, 0.0], (len(t_ns), 1))
        q_ln = motion.frame.from_earth(elapsed, reference.lla, reference.vel_n, level).q_lb
        errors[:, 6:] = np.einsum("kij,kj->ki", matrix_from_quat(q_ln), errors[:, 6:])
    epochs = len(np.unique(np.concatenate([np.empty(0, np.int64), *(series.t_ns for series in solution.innovations)])))
    return ArmOutcome(errors, nees, compare_noise(solution.innovations, log), epochs, solution.weights)


def _gyro_bias_nees(solution: Solution, log: SyntheticLog, t_ns: Times) -> Floats:
    """(k,) at the last rows before t_ns (k,); NaN where the bias is no state, or not the only one of the gyros' errors."""
    if "gyro_bias_x" not in solution.state_names or "gyro_markov_x" in solution.state_names:
        return np.full(len(t_ns), np.nan)
    rows = np.searchsorted(solution.t_ns, t_ns, side="right") - 1
    true = log.gyro_errors.bias[np.searchsorted(log.imu.t_ns, solution.t_ns[rows])]
    start = solution.state_names.index("gyro_bias_x")
    cov = solution.cov[rows, start : start + 3, start : start + 3]
    return normalised_squares(solution.gyro_bias[rows] - true, cov)
