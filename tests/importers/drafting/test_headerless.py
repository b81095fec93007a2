"""Tables without a header, and matrices of MATLAB files, are understood by value, or not at all."""

import numpy as np
import pytest
from scipy.io import savemat

from importers import load_timeline
from importers.drafting.headerless import understand
from navreplay.timeline import LogError

N = 400
T = np.arange(N) * 0.01
RNG = np.random.default_rng(1)
GYRO = RNG.normal(0, 0.02, (N, 3))
ACCEL = RNG.normal(0, 0.05, (N, 3)) + [0.1, -0.2, 9.8]
MAGNET = RNG.normal(0, 0.1, (N, 3)) + [20.0, 5.0, -40.0]


def numbered(*parts: np.ndarray) -> dict[int, np.ndarray]:
    return dict(enumerate(np.column_stack(parts).T, 1))


@pytest.mark.parametrize("unit", ["g", "m/s2"])
def test_gravity_tells_the_accelerations(unit: str) -> None:
    meaning = understand(numbered(ACCEL / (9.80665 if unit == "g" else 1), GYRO, 261_906 + np.rint(T * 1000)))
    assert meaning is not None
    assert meaning.role == "imu"
    assert [meaning.columns[f"accel_{axis}"] for axis in "xyz"] == [1, 2, 3]
    assert [meaning.columns[f"gyro_{axis}"] for axis in "xyz"] == [4, 5, 6]
    assert meaning.units == {"accel": unit, "gyro": "rad/s"}
    assert meaning.time["base"] == "boot"


def test_rates_behind_the_time_and_dates_are_understood() -> None:
    meaning = understand(numbered(1.7e9 + T, GYRO * 57.3 * 20, ACCEL, MAGNET))
    assert meaning is not None
    assert meaning.columns["gyro_x"] == 2
    assert meaning.columns["accel_x"] == 5
    assert meaning.units["gyro"] == "deg/s"
    assert meaning.time == {"column": 1, "base": "utc", "unit": "s"}


def test_places_are_told_by_the_radius_of_the_earth() -> None:
    place = np.array([-3_961_877.1, 3_348_960.8, 3_698_236.9]) + np.cumsum(RNG.normal(0, 1, (N, 3)), axis=0)
    meaning = understand(numbered(111_078.8 + T * 20, place))
    assert meaning is not None
    assert (meaning.role, meaning.time["base"]) == ("fix", "gps_tow")
    assert meaning.columns == {"ecef_x": 2, "ecef_y": 3, "ecef_z": 4}


@pytest.mark.parametrize(
    "columns",
    [
        numbered(ACCEL, GYRO),  # no time
        numbered(T, GYRO, MAGNET),  # nothing as long as gravity
        numbered(T, ACCEL),  # no rates
        numbered(T, GYRO, RNG.normal(0, 5.6, (N, 3))),  # as long as gravity, but pointing everywhere
    ],
)
def test_what_is_not_plain_is_not_understood(columns: dict[int, np.ndarray]) -> None:
    assert understand(columns) is None


def test_a_matrix_is_read_by_value(tmp_path) -> None:
    matrix = np.column_stack([1.7e9 + T, ACCEL, GYRO])
    savemat(tmp_path / "imu.mat", {"IMU": matrix, "other": np.eye(3)})
    imu = load_timeline([tmp_path / "imu.mat"]).imu
    np.testing.assert_allclose(imu.accel, ACCEL)
    savemat(tmp_path / "obs.mat", {"obs": np.ones((50, 4))})
    with pytest.raises(LogError, match=r"whose matrices \(obs 50 x 4\) are not plain by their values"):
        load_timeline([tmp_path / "obs.mat"])


def test_directions_in_names_tell_axes_and_signs(tmp_path) -> None:
    names = "t_imu_s,f_right_mps2,f_fwd_mps2,f_up_mps2,w_right_rps,w_fwd_rps,w_up_rps"
    rows = [f"{100 + i * 0.01:.2f},0.1,0.2,9.8,0.01,0.02,0.03" for i in range(60)]
    (tmp_path / "imu.csv").write_text("\n".join([names, *rows]) + "\n")
    imu = load_timeline([tmp_path / "imu.csv"]).imu
    np.testing.assert_allclose(imu.accel[5], [0.2, 0.1, -9.8])
    np.testing.assert_allclose(imu.gyro[5], [0.02, 0.01, -0.03])
