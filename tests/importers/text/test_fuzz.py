"""Damaged text files: whatever the damage, rows are counted or one clear line is raised, never a traceback."""

import numpy as np
import pytest

from importers.load import load_timeline
from importers.settings import InputSettings
from navreplay.timeline import LogError

IMU_HEAD = "t_gps_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n"
POS_HEAD = "%  GPST  latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio\n"
MAPPING = {
    "gps_week": 2374,
    "utc_date": "2025-07-08",
    "reference": {"origin_deg_m": [40, -105, 0]},
    "csv": [
        {
            "match": "mapped.csv",
            "role": "fix",
            "time": {"column": [1, 2], "base": "datetime_utc"},
            "columns": {"lat": 3, "lon": 4, "height": 5, "status": 6},
            "status": {"1": "fixed"},
        }
    ],
}
LINES = {
    "imu.csv": (IMU_HEAD, lambda i: f"{1436000000_000000000 + i * 10**7},0.1,0.2,0.3,0.1,0.2,-9.8\n"),
    "a.pos": (POS_HEAD, lambda i: f"2025/07/08 19:34:{i:02d}.500 40.{i} -105.1 1600 1 9 .1 .1 .1 0 0 0 0 0\n"),
    "week.pos": (POS_HEAD, lambda i: f"2374 {100 + i}.5 40.{i} -105.1 1600 1 9 .1 .1 .1 0 0 0 0 0\n"),
    "kf.txt": ("", lambda i: f"{100 + i * 0.01:.2f} 1e-4 2e-4 3e-4 0.001 0.002 -0.098\n"),
    "a.tum": ("", lambda i: f"17520000{i:02d}.5 {i} 2 3 0 0 0 1\n"),
    "a.gga": ("", lambda i: f"$GPGGA,1200{i:02d}.00,3725.5,N,12205.6,W,1,12,0.76,4.4,M,-30.0,M,,*00\n"),
    "mapped.csv": ("", lambda i: f"2025-07-08;12:00:{i:02d};40.{i};-105;1600;1\n"),
}


def with_checksums(text):
    def sentence(line):
        body = line[1:].split("*")[0]
        parity = 0
        for letter in body.encode():
            parity ^= letter
        return f"${body}*{parity:02X}"

    return "\n".join(sentence(line) if line.startswith("$") else line for line in text.split("\n"))


def damage(data, random):
    """Bytes changed, lines cut, repeated and garbled, numbers blown up."""
    data = bytearray(data)
    for _ in range(int(random.integers(1, 12))):
        data[int(random.integers(len(data)))] = int(random.integers(256))
    if random.random() < 0.5:
        start = int(random.integers(len(data)))
        del data[start : start + int(random.integers(1, 200))]
    if random.random() < 0.5:
        place = int(random.integers(len(data) + 1))
        data[place:place] = [b"1e300", b"-1e19", b"nan", b"inf", b",,,,", b"\n\n", b"99999999999999999999", b"\x00" * 40][
            int(random.integers(8))
        ]
    return bytes(data[: int(random.integers(1, len(data) + 1))] if random.random() < 0.3 else data)


@pytest.mark.parametrize("name", LINES)
@pytest.mark.parametrize("seed", range(25))
def test_damage_is_told_and_never_a_traceback(tmp_path, name, seed):
    head, line = LINES[name]
    whole = with_checksums(head + "".join(line(i) for i in range(40)))
    path = tmp_path / name
    settings = InputSettings.model_validate(MAPPING)
    path.write_text(whole)
    (use,) = load_timeline([path], settings).provenance.channels
    assert use.used == 40
    path.write_bytes(damage(whole.encode(), np.random.default_rng(seed)))
    told = ""
    try:
        (use,) = load_timeline([path], settings).provenance.channels
    except LogError as error:
        told = str(error)
    assert "\n" not in told
    assert told or use.read > 0
