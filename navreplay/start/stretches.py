"""Stretches of the IMU between long gaps: what the epoch loop runs over one after the other."""

import numpy as np

from navreplay.mechanisation.strapdown import find_gaps, split_at_long_gaps
from navreplay.options import GapOptions
from navreplay.timeline import ImuSeries, LogError, Times
from navreplay.update.record import Recorder

__all__ = ["cut_at_gaps", "tell_unreached"]


def cut_at_gaps(imu: ImuSeries, options: GapOptions, recorder: Recorder) -> list[ImuSeries]:
    """The stretches, each gap recorded. Raises LogError on a gap that the options refuse, or when nothing is left."""
    dt = np.diff(imu.t_ns)
    longest = int(options.bridge_s * 1e9)
    bridged = np.flatnonzero(find_gaps(imu.t_ns) & (dt <= longest))
    if len(bridged):
        total, worst = dt[bridged].sum() / 1e9, dt[bridged].max() / 1e9
        text = f"gaps of the IMU that are bridged: {len(bridged)}, {total:.3f} s in all, the longest {worst:.3f} s"
        recorder.tell(int(imu.t_ns[bridged[0]]), "warning", text)
    for i in np.flatnonzero(dt > longest).tolist():
        seconds = f"{dt[i] / 1e9:.3f} s"
        if options.longer == "refuse":
            raise LogError(
                f"imu: a gap of {seconds} is longer than gaps.bridge_s = {options.bridge_s:g}; raise that, or set "
                "gaps.longer = 'reset' to align anew behind it"
            )
        text = f"the IMU is silent for {seconds}; the filter aligns anew behind the gap"
        recorder.tell(int(imu.t_ns[i]), "warning", text)
    stretches = split_at_long_gaps(imu, longest)
    if not stretches:
        raise LogError("imu: no two samples lie closer together than gaps.bridge_s; is the time base of the IMU right?")
    return stretches


def tell_unreached(t_ns: Times, name: str, stretches: list[ImuSeries], recorder: Recorder) -> None:
    """Records how many of the epochs t_ns (e,), called name, no stretch covers."""
    reached = np.zeros(len(t_ns), dtype=bool)
    for imu in stretches:
        reached |= (t_ns >= imu.t_ns[0]) & (t_ns <= imu.t_ns[-1])
    if not reached.all():
        count = int((~reached).sum())
        first = int(t_ns[np.argmin(reached)])
        text = f"{count} of {len(t_ns)} {name} lie outside the IMU's time span or in its gaps; they are not used"
        recorder.tell(first, "warning", text)
