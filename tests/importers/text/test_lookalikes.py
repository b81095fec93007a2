"""Text formats that are written in several ways, and texts that look like another format."""

import numpy as np
import pytest

from importers import load_timeline, open_log
from importers.settings import InputSettings
from navreplay.geodesy.rotation import quat_from_euler
from navreplay.geodesy.time_scales import gps_from_week_tow
from navreplay.timeline import FixStatus, LogError

N = 12
HEAD = ["latitude(deg)", "longitude(deg)", "height(m)", "Q", "ns"]


@pytest.mark.parametrize("mark", [" ", "  ", ",", ", ", ";", "\t", "|"])
@pytest.mark.parametrize("calendar", [True, False])
@pytest.mark.parametrize("decimals", [0, 1, 3])
def test_rtklib_positions_with_any_separator_and_time(tmp_path, mark, calendar, decimals):
    rows = []
    for i in range(N):
        fraction = f".{0:0{decimals}d}" if decimals else ""
        time = f"2023/11/14 22:13:{18 + i}{fraction}" if calendar else f"2288{mark}{252_798 + i}{fraction}"
        rows.append(mark.join([time, f"{48 + i * 1e-5:.9f}", "11.6", "545.0", "1", "15"]))
    path = tmp_path / "a.pos"
    path.write_text("\n".join(["%  GPST" + mark + mark.join(HEAD), *rows]) + "\n")
    fixes = load_timeline([path]).fixes
    expected = gps_from_week_tow(2288, 252_798.0) + 10**9 * np.arange(N)
    assert fixes.t_ns.tolist() == expected.tolist()
    np.testing.assert_allclose(np.degrees(fixes.lla[:, 0]), 48 + 1e-5 * np.arange(N))
    assert (fixes.status == FixStatus.FIXED).all()


def trajectory(yaw0, turn, speed=5.0, n=200):
    """Times, places (n, 2) east and north, and scalar-first quaternions of a forward-left-up body in east, north, up."""
    t = 0.2 * np.arange(n)
    yaw = yaw0 + turn * t
    step = 0.2 * speed * np.column_stack([np.cos(yaw), np.sin(yaw)])
    return t, np.cumsum(step, axis=0), quat_from_euler(0.01 * np.sin(t), 0.02 * np.cos(t), yaw)


def tum(path, t, places, q, order, scale=1.0):
    path.write_text("\n".join(
        f"{(1.7e9 + t[i]) * scale:.{6 if scale == 1 else 0}f} {places[i, 0]:.4f} {places[i, 1]:.4f} 0 "
        + " ".join(f"{value:.9f}" for value in q[i, order])
        for i in range(len(t))
    ) + "\n")  # fmt: skip
    return path


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [1, 2, 3, 0]])
@pytest.mark.parametrize("yaw0", [0.0, 0.3, 1.6, 2.5, 3.1, -1.0, -2.0])
@pytest.mark.parametrize("turn", [0.0, 0.02, -0.1])
def test_the_order_of_quaternions_is_recognised_or_the_doubt_told(tmp_path, order, yaw0, turn):
    t, places, q = trajectory(yaw0, turn)
    log = open_log(tum(tmp_path / "ref.txt", t, places, q, order))
    table = log.read(("ref.txt",))["ref.txt"]
    same = np.abs(np.sum(table.columns["q"] * q, axis=1)) > 1 - 1e-6
    assert same.all() or "would fit qw qx qy qz as well" in table.notes[0]
    if turn:
        assert same.all()
    if order[0] == 0 and same.all():
        assert "taken as qw qx qy qz" in table.notes[0]


@pytest.mark.parametrize("scale", [1.0, 1e3, 1e6])
def test_stamps_of_a_trajectory_in_any_unit(tmp_path, scale):
    t, places, q = trajectory(0.5, 0.1)
    log = open_log(tum(tmp_path / "ref.txt", t, places, q, [1, 2, 3, 0], scale))
    stamps = log.read(("ref.txt",))["ref.txt"].columns["stamp"]
    np.testing.assert_allclose(stamps, 1_700_000_000 * 10**9 + 200_000_000 * np.arange(len(t)), atol=1e6)


def inertial(path, gravity, rate=100.0, rows=60):
    path.write_text("".join(f"{252818 + i / rate:.3f} 0.0001 0.0002 -0.0001 0.001 0.002 {-gravity:.6f}\n" for i in range(rows)))
    return path


@pytest.mark.parametrize("rate", [50.0, 100.0, 200.0, 400.0])
def test_increments_are_read_and_their_lookalikes_told_with_a_row(tmp_path, rate):
    settings = InputSettings(gps_week=2288)
    assert open_log(inertial(tmp_path / "imu.txt", 9.8 / rate, rate), settings).channels()[0].type == "kf_gins/imu"
    with pytest.raises(LogError, match=r"g.txt: has the 7 .*'252818.000 .*-0.990000', would be .*input.csv"):
        open_log(inertial(tmp_path / "g.txt", 0.99, rate), settings)
