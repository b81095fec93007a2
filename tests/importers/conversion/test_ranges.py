"""Ranges from tables and from this program's own JSON layout."""

import json
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from importers import InputSettings, LogError, load_timeline
from navreplay.geodesy.earth import EARTH_RATE
from navreplay.timeline import RangeSeries
from tests.helpers.receiver_at_rest import SATS, SPEED_OF_LIGHT, START_NS, received, satellites, turned

COLUMNS = "t,sat,pr,rate,cn0,x,y,z,vx,vy,vz"
CORRECTED = {"satellite_clock": True, "relativity": True, "group_delay": True}


def write_table(path: Path, clock_m: float, sagnac: str, epochs: int = 3, extra: str = "") -> Path:
    """Satellites turned as sagnac says."""
    lines = [COLUMNS]
    for k in range(epochs):
        pseudorange, applied = received(k, clock_m)
        by_pseudorange = turned(satellites(k), EARTH_RATE * pseudorange / SPEED_OF_LIGHT)
        pos = {"none": satellites(k), "applied": applied, "pseudorange": by_pseudorange}[sagnac]
        for sat, pr, (x, y, z) in zip(SATS, pseudorange, pos, strict=True):
            lines.append(f"{START_NS + k * 10**9},{sat},{pr:.4f},10.5,45,{x:.4f},{y:.4f},{z:.4f},1,2,3")
    path.write_text("\n".join(lines) + "\n" + extra)
    return path


def settings(sagnac: str, **more: object) -> InputSettings:
    columns = {"sat": "sat", "pseudorange": "pr", "range_rate": "rate", "cn0": "cn0"}
    columns |= {f"sat_{name}": name for name in ("x", "y", "z", "vx", "vy", "vz")}
    mapping = {
        "match": "*.csv",
        "role": "range",
        "time": {"column": "t", "unit": "ns"},
        "columns": columns,
        "corrections": CORRECTED | {"sagnac": sagnac},
    }
    return InputSettings.model_validate({"csv": [mapping], **more})


def ranges_of(path: Path, options: InputSettings) -> RangeSeries:
    ranges = load_timeline([path], options).ranges
    assert ranges is not None
    return ranges


@pytest.mark.parametrize("sagnac", ["none", "applied", "pseudorange"])
@pytest.mark.parametrize("clock_m", [0.0, -2.12e6])
def test_satellites_are_turned_to_reception_whatever_the_clock(tmp_path: Path, sagnac: str, clock_m: float) -> None:
    ranges = ranges_of(write_table(tmp_path / "a.csv", clock_m, sagnac), settings(sagnac))
    assert len(ranges) == 24
    assert ranges.epoch_starts.tolist() == [0, 8, 16, 24]
    order = np.argsort(SATS)
    assert np.abs(ranges.sat_pos_e[:8] - received(0, clock_m)[1][order]).max() < 2e-3
    assert ranges.sat[:8].tolist() == sorted(SATS)
    assert ranges.signal[:8].tolist() == ["2I", "1C", "1C", "1C", "1C", "1C", "1C", "1C"]
    assert (ranges.range_rate == 10.5).all()


def test_rejections_are_counted_and_balance(tmp_path: Path) -> None:
    bad = [
        f"{START_NS},G01,2.2e7,0,45,1e7,1e7,1e7,1,2,3",
        f"{START_NS},X09,2.2e7,0,45,1e7,1e7,1e7,1,2,3",
        f"{START_NS},G09,9e9,0,45,1e7,1e7,1e7,1,2,3",
        f"{START_NS},G10,,0,45,1e7,1e7,1e7,1,2,3",
        f"{START_NS},G11,2.2e7,0,45,,,,1,2,3",
        f"{START_NS},G12,2.2e7,0,12,1e7,1e7,1e7,1,2,3",
        f"{START_NS},R12,2.2e7,0,45,1e7,1e7,1e7,1,2,3",
        "5,G13,2.2e7,0,45,1e7,1e7,1e7,1,2,3",
    ]
    path = write_table(tmp_path / "a.csv", 0.0, "applied", extra="\n".join(bad) + "\n")
    options = settings("applied", range={"min_cn0_dbhz": 20, "systems": ["G", "E", "C"]})
    timeline = load_timeline([path], options)
    (use,) = timeline.provenance.channels
    assert (use.role, use.read, use.used) == ("range", 32, 24)
    assert use.rejected == {
        "satellite twice in an epoch": 1,
        "no such satellite": 1,
        "absurd pseudorange": 1,
        "no pseudorange": 1,
        "corrected, but without a satellite state": 1,
        "C/N0 below min_cn0_dbhz": 1,
        "system not in input.range.systems": 1,
        "stamp before 1990": 1,
    }


def test_numbers_are_satellites_by_their_blocks(tmp_path: Path) -> None:
    path = write_table(tmp_path / "a.csv", 0.0, "applied", epochs=1)
    text = path.read_text().replace("G0", "").replace("E0", "6").replace("C0", "10")
    path.write_text(text)
    mapping = settings("applied").csv[0].model_copy(update={"satellite_blocks": {"G": 1, "R": 33, "E": 60, "C": 98}})
    ranges = ranges_of(path, InputSettings(csv=(mapping,)))
    assert ranges.sat.tolist() == ["C11", "E06", "E07", "E08", "G01", "G02", "G03", "G04"]


def test_columns_of_corrections_are_added(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"t,sat,pr,clk,rel,tgd,tropo,x,y,z,u,v,w\n{START_NS},5,2.2e7,1e-6,3,4,5,2e7,0,0,0,3e3,0\n")
    columns = {"sat": "sat", "pseudorange": "pr", "sat_clock_s": "clk", "relativity_m": "rel", "group_delay_m": "tgd"}
    columns |= {"troposphere_m": "tropo", "sat_x": "x", "sat_y": "y", "sat_z": "z", "sat_vx": "u", "sat_vy": "v", "sat_vz": "w"}
    mapping = {"match": "*.csv", "role": "range", "time": {"column": "t", "unit": "ns"}, "columns": columns}
    ranges = ranges_of(path, InputSettings.model_validate({"csv": [mapping]}))
    assert ranges.sat.tolist() == ["G05"]
    assert ranges.pseudorange[0] == pytest.approx(2.2e7 + 299.792458 + 3 - 4 - 5, abs=1e-6)
    assert ranges.troposphere_removed
    assert not ranges.ionosphere_removed


def test_a_table_without_satellites_asks_for_a_navigation_file(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"t,sat,pr\n{START_NS},G05,2.2e7\n")
    columns = {"sat": "sat", "pseudorange": "pr"}
    mapping = {"match": "*.csv", "role": "range", "time": {"column": "t", "unit": "ns"}, "columns": columns}
    with pytest.raises(LogError, match=r"no ephemeris 1; add the navigation file .* input\.range\.navigation"):
        load_timeline([path], InputSettings.model_validate({"csv": [mapping]}))


def epoch(k: int, **changed: object) -> dict[str, object]:
    """One message of this program's own layout."""
    pseudorange, pos = received(k, 100.0)
    rows = [
        {"sat": sat, "signal": "1C" if sat[0] in "GE" else "2I", "pseudorange_m": pr, "range_rate_mps": -5.25}
        | {"pseudorange_std_m": 2.0, "range_rate_std_mps": None, "cn0_dbhz": 40.0}
        | {"sat_pos_e_m": list(place), "sat_vel_e_mps": [1.0, 2.0, 3.0]}
        for sat, pr, place in zip(SATS, pseudorange, pos, strict=True)
    ]
    return {"t_gps_ns": START_NS + k * 10**9, "satellites": rows, "corrected": True, "klobuchar": [1e-8] * 8} | changed


def write_epochs(path: Path, messages: list[object]) -> Path:
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("navreplay.GnssRanges", "jsonschema", b"{}")
        channel = writer.register_channel("/ranges", "json", schema)
        for i, message in enumerate(messages):
            writer.add_message(channel, i, json.dumps(message).encode(), i)
        writer.finish()
    return path


def test_own_layout_is_read_as_it_is(tmp_path: Path) -> None:
    ranges = ranges_of(write_epochs(tmp_path / "a.mcap", [epoch(0), epoch(1)]), InputSettings())
    pseudorange, pos = received(1, 100.0)
    order = np.argsort(SATS)
    assert np.array_equal(ranges.pseudorange[8:], pseudorange[order])
    assert np.array_equal(ranges.sat_pos_e[8:], pos[order])
    assert np.isnan(ranges.range_rate_std).all()
    assert (ranges.pseudorange_std == 2).all()
    assert ranges.klobuchar is not None
    assert np.array_equal(ranges.klobuchar, [1e-8] * 8)
    assert ranges.t_ns[8] == START_NS + 10**9


def test_damaged_messages_of_the_own_layout_cost_themselves_only(tmp_path: Path) -> None:
    messages = [
        epoch(0),
        epoch(1, satellites=[]),
        epoch(2, satellites=[{"sat": 7, "pseudorange_m": "x"}, {"sat_pos_e_m": [1]}]),
        epoch(3, satellites="none", klobuchar=None),
        "not an object",
        epoch(4, t_gps_ns="soon"),
    ]
    timeline = load_timeline([write_epochs(tmp_path / "a.mcap", messages)], InputSettings())
    (use,) = timeline.provenance.channels
    assert use.used == 8
    assert use.rejected == {
        "not a JSON object": 1,
        "epoch without satellites": 2,
        "no such satellite": 2,
        "stamp before 1990": 8,
    }


def test_a_message_without_its_fields_is_told(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"channel /ranges says it is navreplay\.GnssRanges but has no field satellites"):
        load_timeline([write_epochs(tmp_path / "a.mcap", [{"t_gps_ns": START_NS}])], InputSettings())
