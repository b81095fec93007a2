"""Android raw measurements (device_gnss.csv)."""

from pathlib import Path

import numpy as np
import pytest

from importers import LogError, load_timeline
from tests.helpers.receiver_at_rest import START_NS, received, satellites

HEAD = (
    "MessageType,utcTimeMillis,Svid,Cn0DbHz,PseudorangeRateMetersPerSecond,ConstellationType,ArrivalTimeNanosSinceGpsEpoch,"
    "RawPseudorangeMeters,RawPseudorangeUncertaintyMeters,SignalType,SvPositionXEcefMeters,SvPositionYEcefMeters,"
    "SvPositionZEcefMeters,SvVelocityXEcefMetersPerSecond,SvVelocityYEcefMetersPerSecond,SvVelocityZEcefMetersPerSecond,"
    "SvClockBiasMeters,SvClockDriftMetersPerSecond,IsrbMeters"
)
KINDS = (("GPS_L1_CA", 0), ("GPS_L1_CA", 0), ("GPS_L1", 0), ("QZS_L1_CA", 192))
KINDS += (("GAL_E1_C_P", 0), ("GAL_E1", 0), ("GLO_G1_CA", 0), ("BDS_B1_I", 0))


def row(kind: str, number: int, pseudorange: float, place: np.ndarray | None, start_ns: int = START_NS) -> str:
    state = ",,,,,,,," if place is None else f"{place[0]:.4f},{place[1]:.4f},{place[2]:.4f},1,2,3,150.5,0.25,"
    return f"Raw,1,{number},35.5,-10.5,1,{start_ns},{pseudorange:.4f},12.5,{kind},{state}"


def test_measurements_are_corrected_as_the_description_says(tmp_path: Path) -> None:
    pseudorange, applied = received(0, 3000.0)
    rows = [row(kind, i + 1 + added, pseudorange[i], satellites(0)[i]) for i, (kind, added) in enumerate(KINDS)]
    path = tmp_path / "device_gnss.csv"
    path.write_text("\n".join([HEAD, *rows]) + "\n")
    ranges = load_timeline([path]).ranges
    assert ranges is not None
    names = ["G01", "G02", "G03", "J04", "E05", "E06", "R07", "C08"]
    order = np.argsort(names)
    assert ranges.sat.tolist() == sorted(names)
    assert set(ranges.signal) == {"1C", "2I"}
    np.testing.assert_allclose(ranges.pseudorange, pseudorange[order] + 150.5, atol=1e-4)
    np.testing.assert_allclose(ranges.sat_pos_e, applied[order], atol=5e-3)
    assert (ranges.range_rate == -10.25).all()
    assert (ranges.pseudorange_std == 12.5).all()
    assert not ranges.ionosphere_removed


def test_what_cannot_be_used_is_counted(tmp_path: Path) -> None:
    pseudorange, _ = received(0, 0.0)
    rows = [row("GPS_L1_CA", i + 1, pseudorange[i], satellites(0)[i]) for i in range(6)]
    rows.append(row("GPS_L5_Q", 1, pseudorange[0], satellites(0)[0]))
    rows.append(row("GLO_G1_CA", 101, pseudorange[0], satellites(0)[0]))
    rows.append(row("SBS_L1", 120, pseudorange[0], satellites(0)[0]))
    rows.append(row("GPS_L1_CA", 20, pseudorange[0], None))
    rows.append(row("GPS_L1_CA", 21, pseudorange[0], satellites(0)[0]).replace("150.5", "x"))
    path = tmp_path / "device_gnss.csv"
    path.write_text("\n".join([HEAD, *rows]) + "\n")
    (use,) = load_timeline([path]).provenance.channels
    assert (use.read, use.used) == (11, 6)
    assert use.rejected == {
        "not a number": 1,
        "no such satellite": 2,
        "signal not in input.range.signals": 1,
        "no ephemeris": 1,
    }


def test_an_older_table_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "device_gnss.csv"
    path.write_text(HEAD.replace("SignalType", "Other") + "\n" + row("GPS_L1", 1, 2e7, None) + "\n")
    with pytest.raises(LogError, match=r"has no column SignalType.*device_gnss\.csv of 2022 or later"):
        load_timeline([path])
