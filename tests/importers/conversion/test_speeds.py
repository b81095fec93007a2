"""Speeds of wheels, and barometers: of messages that are named, of tables, of counters; never an antenna's velocity."""

import numpy as np
import pytest

from importers.rows.log import Table
from navreplay.timeline import LogError
from pipelines import cli
from synthetic_logs import SCENARIOS, simulate, truth_at
from tests.helpers.memory_log import fix_table, imu_table, load_tables, stamps

N = 50


def odometry_table():
    """Forward at 3 m/s, turning left at 0.2 rad/s, in REP 103."""
    t = stamps(N, 10)
    columns = {
        "header.stamp": t,
        "pose.pose.position": np.zeros((N, 3)),
        "pose.pose.orientation": np.tile([0.0, 0.0, 0.0, 1.0], (N, 1)),
        "pose.covariance": np.zeros((N, 36)),
        "twist.twist.linear": np.tile([3.0, 0.1, 0.0], (N, 1)),
        "twist.twist.angular": np.tile([0.0, 0.0, 0.2], (N, 1)),
    }
    return Table(t, columns, N)


def twist_table():
    t = stamps(N, 10)
    linear, angular = np.tile([3.0, 0.0, 0.0], (N, 1)), np.zeros((N, 3))
    return Table(t, {"header.stamp": t, "twist.linear": linear, "twist.angular": angular}, N)


def load(folder, tables, channel=None):
    logs = {"/imu": ("sensor_msgs/Imu", imu_table()), "/fix": ("sensor_msgs/NavSatFix", fix_table())} | tables
    return load_tables(folder, logs, {} if channel is None else {"speed": {"channel": channel}})


def test_odometry_that_is_named_tells_speed_and_turn(tmp_path):
    speed = load(tmp_path, {"/odom": ("nav_msgs/Odometry", odometry_table())}, "/odom").speed
    np.testing.assert_allclose(speed.speed, 3.0)
    np.testing.assert_allclose(speed.turn, -0.2)


def test_odometry_that_nobody_names_is_not_used(tmp_path):
    timeline = load(tmp_path, {"/odom": ("nav_msgs/Odometry", odometry_table())})
    assert timeline.speed is None
    assert not timeline.fixes.has_velocity.any()


def test_a_twist_told_to_be_of_the_wheels_is_no_velocity_of_the_antenna(tmp_path):
    timeline = load(tmp_path, {"/wheels": ("geometry_msgs/TwistStamped", twist_table())}, "/wheels")
    np.testing.assert_allclose(timeline.speed.speed, 3.0)
    assert not timeline.fixes.has_velocity.any()
    use = next(use for use in timeline.provenance.channels if use.name == "/wheels")
    assert (use.role, use.read, use.used) == ("speed", N, N)


def test_a_drive_of_ackermann_tells_its_speed(tmp_path):
    t = stamps(N, 10)
    table = Table(t, {"header.stamp": t, "drive.speed": np.full(N, 2.5), "drive.steering_angle": np.zeros(N)}, N)
    timeline = load(tmp_path, {"/drive": ("ackermann_msgs/AckermannDriveStamped", table)}, "/drive")
    np.testing.assert_allclose(timeline.speed.speed, 2.5)


def test_what_is_not_finite_is_counted(tmp_path):
    table = odometry_table()
    table.columns["twist.twist.linear"][:7] = np.nan
    timeline = load(tmp_path, {"/odom": ("nav_msgs/Odometry", table)}, "/odom")
    use = next(use for use in timeline.provenance.channels if use.name == "/odom")
    assert (use.read, use.used, use.rejected["not finite"]) == (N, N - 7, 7)
    table.columns["twist.twist.linear"][:] = np.nan
    with pytest.raises(LogError, match="none of its 50 speeds"):
        load(tmp_path, {"/odom": ("nav_msgs/Odometry", table)}, "/odom")


def test_a_barometer_that_is_named_tells_height(tmp_path):
    t = stamps(N, 10)
    pressure = np.full(N, 89_874.6)
    pressure[3] = 0.0
    table = Table(t, {"header.stamp": t, "fluid_pressure": pressure, "variance": np.zeros(N)}, N)
    logs = {"/imu": ("sensor_msgs/Imu", imu_table()), "/fix": ("sensor_msgs/NavSatFix", fix_table())}
    logs["/baro"] = ("sensor_msgs/FluidPressure", table)
    assert load_tables(tmp_path, logs).baro is None
    timeline = load_tables(tmp_path, logs, {"baro": {"channel": "/baro"}})
    np.testing.assert_allclose(timeline.baro.height, 1000.0, atol=0.5)
    use = next(use for use in timeline.provenance.channels if use.name == "/baro")
    assert (use.read, use.used) == (N, N - 1)


TABLE = """
[[input.csv]]
match = "wheels.csv"
role = "speed"
time = { column = "time", base = "gps" }
columns = { COLUMNS }
UNITS
"""


@pytest.mark.parametrize(
    ("columns", "units"), [('speed = "kmh"', 'units = { speed = "km/h" }'), ('ticks_left = "left", ticks_right = "right"', "")]
)
def test_tables_of_speeds_and_ticks_through_the_command_line(tmp_path, capsys, columns, units):
    """Counters of 16 bits, a tick being 2 cm, told 0.2 s late."""
    assert cli.main(["synth", "car-short", "--seed", "1", "-o", str(tmp_path / "car.mcap")]) == 0
    drive = simulate(SCENARIOS["car-short"], 1)
    t_ns = drive.imu.t_ns[10:-40:10]
    speed = np.linalg.norm(truth_at(drive.scenario.journey, t_ns).vel_n, axis=1)
    ticks = (np.cumsum(speed * 0.1) / 0.02).astype(int) % 65536
    rows = [f"{t / 1e9 + 0.2:.3f},{3.6 * v:.2f},{n},{n}" for t, v, n in zip(t_ns, speed, ticks, strict=True)]
    (tmp_path / "wheels.csv").write_text("\n".join(["time,kmh,left,right", *rows]) + "\n")
    (tmp_path / "c.toml").write_text(TABLE.replace("COLUMNS", columns).replace("UNITS", units))
    logs = [str(tmp_path / name) for name in ("car.mcap", "wheels.csv")]
    told = ["-c", str(tmp_path / "c.toml"), "-o", str(tmp_path / "out"), "--quick", "--set", "output.recording=false"]
    assert cli.main(["run", *logs, *told]) == 0
    report = (tmp_path / "out" / "report.md").read_text()
    assert "wheel speeds: 11" in capsys.readouterr().out
    assert "with a scale of" in report
    assert "are added to their stamps" in report
