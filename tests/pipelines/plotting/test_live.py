"""What a page holds for a browser to draw: the points of the plots, thinned but with their extremes."""

import base64
import gzip
import json

import numpy as np
import pytest

from pipelines.plotting.live import Clock, pack_plots, unpack_array
from pipelines.plotting.plot import Live, Plot
from pipelines.plotting.svg import Layer, Panel
from pipelines.plotting.track import Course, Shading, Track, thin_course


def _pack(*layers: Layer) -> tuple[list[dict], bytes]:
    described, data = pack_plots([Plot("p", "", (), "<svg/>", Live((Panel("x [m]", layers),)))], Clock(0.0, 10.0))
    return json.loads(described)["plots"][0]["panels"][0]["layers"], gzip.decompress(base64.b64decode(data))


def test_points_come_back_to_five_digits_and_a_tenth_of_a_millisecond() -> None:
    rng = np.random.default_rng(2)
    x = np.sort(rng.uniform(0, 4000, 900))
    y = 1234.5 + rng.standard_normal(900) * 10.0 ** rng.integers(-3, 3, 900)
    (layer,), block = _pack(Layer("dots", x, y, "c1", "n"))
    np.testing.assert_allclose(unpack_array(block, layer["x"]), x, atol=0.51e-4)
    np.testing.assert_allclose(unpack_array(block, layer["y"]) - 1234.5, y - 1234.5, rtol=1e-5, atol=0.02)


@pytest.mark.parametrize("kind", ["line", "dots", "band"])
def test_extremes_of_a_million_points_stay(kind: str) -> None:
    x = np.arange(1_000_000) / 200.0
    y = np.sin(x / 50)
    y[[123_456, 777_777]] = 40.0, -30.0
    (layer,), block = _pack(Layer(kind, x, y, "c1", "n", y + 1 if kind == "band" else None))  # type: ignore[arg-type]
    shown = unpack_array(block, layer["y"])
    assert len(shown) < 50_000
    assert np.nanmin(shown) == pytest.approx(-30.0, rel=1e-4)
    highest = unpack_array(block, layer["high"]) - 1 if kind == "band" else shown
    assert np.nanmax(highest) == pytest.approx(40.0, rel=1e-4)
    if kind != "band":
        assert unpack_array(block, layer["x"])[np.nanargmax(shown)] == pytest.approx(123_456 / 200.0, abs=1e-4)


def test_no_line_leads_across_a_gap() -> None:
    x = np.concatenate([np.arange(100) * 0.1, 500 + np.arange(100) * 0.1])
    (layer,), block = _pack(Layer("line", x, np.ones(200), "c1", "n"))
    times, values = unpack_array(block, layer["x"]), unpack_array(block, layer["y"])
    behind = np.searchsorted(times, 400.0)
    assert np.isnan(values[behind - 1])
    assert np.isfinite(values).sum() == 200


def test_plots_that_nobody_can_zoom_into_and_empty_layers_are_left_out() -> None:
    empty = Layer("dots", np.zeros(0), np.zeros(0), "c1", "nothing")
    plots = [Plot("a", "", (), "<svg/>"), Plot("b", "", (), "<svg/>", Live((Panel("x", (empty,)),)))]
    described = json.loads(pack_plots(plots, Clock(5.0, 1.0))[0])
    assert described["plots"][0] is None
    assert described["plots"][1]["panels"][0]["layers"] == []
    assert (described["start_ms"], described["duration_s"]) == (5.0, 1.0)


def test_a_track_keeps_its_worst_points_and_its_values() -> None:
    n = 100_000
    t, worst = np.arange(n) / 10.0, np.zeros(n)
    worst[54_321] = 9.0
    kept = thin_course(t, t, t, worst)
    assert 54_321 in kept
    assert len(kept) <= 12_001
    shade = Shading(worst[kept], "m")
    course = Course("line", t[kept], t[kept], -t[kept], "c1", "solution", {"error": shade})
    described, data = pack_plots([Plot("t", "", (), "", Live(track=Track(1.0, 2.0, (course,))))], Clock(0.0, t[-1]))
    packed = json.loads(described)["plots"][0]["track"]["courses"][0]
    block = gzip.decompress(base64.b64decode(data))
    np.testing.assert_allclose(unpack_array(block, packed["north"]), -t[kept], atol=0.006)
    assert unpack_array(block, packed["values"]["error"]["data"]).max() == pytest.approx(9.0)


def test_texts_of_a_log_cannot_end_the_script() -> None:
    layer = Layer("line", np.arange(3.0), np.arange(3.0), "c1", "</script><b>")
    described, _ = pack_plots([Plot("<x>", "", (), "", Live((Panel("y", (layer,)),)))], Clock(0.0, 1.0))
    assert "<" not in described
    assert json.loads(described)["plots"][0]["panels"][0]["layers"][0]["name"] == "</script><b>"
