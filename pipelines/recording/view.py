"""recording.rrd: a run for the Rerun viewer, on the timelines ``elapsed`` (since the first row) and ``time`` (UTC)."""

import errno
import hashlib
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from navreplay.geodesy.earth import SEMI_MAJOR_AXIS, ned_between
from navreplay.geodesy.rotation import enu_from_ned, frd_ned_from_flu_enu, quat_from_matrix, scalar_last_from_first
from navreplay.solution import Solution
from navreplay.timeline import FixStatus, Floats
from pipelines.drive.result import RunResult
from pipelines.recording.layer import LayerStream, send_outages, send_properties
from pipelines.recording.layout import build_layout
from pipelines.recording.paint import BLUE, GREY, PALE, RED, time_columns
from pipelines.recording.series import list_stacks, send_biases, send_errors, send_innovations, send_weights
from pipelines.recording.sky import send_sky
from pipelines.report.content import outage_errors
from pipelines.report.verdict import describe_verdict

__all__ = ["recording_id", "write_recording"]

_APPLICATION = "navreplay"
_ELLIPSOIDS = 200
_ROOM = 1 << 20
"""Bytes below which a disk counts as full."""
_ASPECT, _MAP_ASPECT = 1.5, 2.1
"""Width over height of the two views, for the track to fit into."""
_GRADE_LEVELS = {"good": "info", "fair": "warning", "poor": "error"}
_FIX_COLORS = {
    FixStatus.UNKNOWN: GREY,
    FixStatus.SINGLE: (235, 130, 40),
    FixStatus.DIFFERENTIAL: (220, 185, 50),
    FixStatus.FLOAT: (160, 110, 245),
    FixStatus.FIXED: (60, 200, 100),
    FixStatus.DEAD_RECKONING: (120, 120, 120),
}


def recording_id(result: RunResult) -> str:
    """The same for the same input files and configuration."""
    digest = hashlib.sha256(result.config.model_dump_json().encode())
    for file in result.timeline.provenance.files:
        digest.update(file.sha256.encode())
    return digest.hexdigest()[:32]


def write_recording(path: Path, result: RunResult, layer: tuple[str, str] | None = None) -> None:
    """Writes the recording with its layout. layer: the segment that it belongs to and its name there; its entities then lie
    under that name, and its identity is the segment's instead of that of files and configuration. Raises OSError."""
    try:
        _write(path, result, layer)
    except RuntimeError as error:  # the writer's thread tells of a full disk in no other way
        full = shutil.disk_usage(path.parent).free < _ROOM
        raise OSError(
            errno.ENOSPC if full else errno.EIO, f"the recording: {os.strerror(errno.ENOSPC) if full else error}"
        ) from error


def _write(path: Path, result: RunResult, layer: tuple[str, str] | None) -> None:
    solution, described = result.solution, describe_verdict(result)
    origin = solution.lla[0]
    track = _local(origin, solution.lla)
    identity, under = (recording_id(result), "") if layer is None else (layer[0], f"/{layer[1]}")
    with LayerStream(_APPLICATION, identity, under) as recording:
        recording.set_log_time_enabled(False)
        recording.set_log_tick_enabled(False)
        recording.save(path, default_blueprint=_layout(result, track, under))
        recording.send_recording_name(identity if layer else f"{_APPLICATION}: {solution.method}")
        _send_verdict(recording, described)
        send_properties(recording, result, layer[1] if layer else "run", described["summary"])
        send_outages(recording, result)
        _send_track(recording, solution, track)
        _send_reference_and_fixes(recording, result, origin)
        _send_outage_tracks(recording, result, track)
        _send_ellipsoids(recording, solution, track)
        send_errors(recording, result)
        if result.sky is not None:
            send_sky(recording, result.sky, solution)
        send_innovations(recording, solution)
        send_weights(recording, solution)
        send_biases(recording, solution)
        _send_events(recording, result, described)
        recording.flush()
        recording.disconnect()


def _local(origin: Floats, lla: Floats) -> Floats:
    return enu_from_ned(ned_between(origin, lla))


def _layout(result: RunResult, track: Floats, under: str) -> Any:
    low, high = track.min(axis=0), track.max(axis=0)
    middle, (wide, tall, _) = (low + high) / 2, np.maximum(high - low, 10.0)
    eye = middle + np.array([0.0, -0.5, 0.75]) * max(wide, _ASPECT * tall)
    circumference = 2 * np.pi * SEMI_MAJOR_AXIS * np.cos(result.solution.lla[0, 0])
    zoom = np.clip(np.log2(circumference / (0.5 * max(wide, _MAP_ASPECT * tall))), 1, 18)
    duration_s = float(result.solution.t_ns[-1] - result.solution.t_ns[0]) / 1e9
    stacks, sky = list_stacks(result), result.sky is not None
    return build_layout(stacks, duration_s, tuple(eye.tolist()), tuple(middle.tolist()), float(zoom), sky, under)


def _send_track(recording: rr.RecordingStream, solution: Solution, track: Floats) -> None:
    recording.log("/local", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log("/local/solution", rr.LineStrips3D([track], colors=BLUE, radii=rr.Radius.ui_points(1.5)), static=True)
    length = max(2.0, 0.04 * float(np.ptp(track[:, :2], axis=0).max()))
    recording.log("/local/body", rr.TransformAxes3D(axis_length=length), static=True)
    times = time_columns(solution.t_ns, solution)
    attitude = scalar_last_from_first(frd_ned_from_flu_enu(solution.q_nb))
    recording.send_columns("/local/body", indexes=times, columns=rr.Transform3D.columns(translation=track, quaternion=attitude))
    degrees = np.degrees(solution.lla[:, :2])
    recording.log("/map/solution", rr.GeoLineStrings(lat_lon=[degrees], colors=BLUE, radii=rr.Radius.ui_points(2)), static=True)
    recording.log("/map/position", rr.GeoPoints.from_fields(colors=BLUE, radii=rr.Radius.ui_points(6)), static=True)
    recording.send_columns("/map/position", indexes=times, columns=rr.GeoPoints.columns(positions=degrees))


def _send_reference_and_fixes(recording: rr.RecordingStream, result: RunResult, origin: Floats) -> None:
    timeline, solution = result.timeline, result.solution
    if timeline.reference is not None:
        within = (timeline.reference.t_ns >= solution.t_ns[0]) & (timeline.reference.t_ns <= solution.t_ns[-1])
        lla = timeline.reference.lla[within]
        thin = rr.Radius.ui_points(1)
        degrees = np.degrees(lla[:, :2])
        recording.log("/local/reference", rr.LineStrips3D([_local(origin, lla)], colors=GREY, radii=thin), static=True)
        recording.log("/map/reference", rr.GeoLineStrings(lat_lon=[degrees], colors=GREY, radii=thin), static=True)
    fixes = result.used.fixes
    if fixes is None:
        return
    size = rr.Radius.ui_points(2.5)
    for status, color in _FIX_COLORS.items():
        rows = fixes.has_position & (fixes.status == status)
        if rows.any():
            name, lla = status.name.lower(), fixes.lla[rows]
            points = rr.Points3D(_local(origin, lla), colors=color, radii=size)
            recording.log(f"/local/fixes/{name}", points, static=True)
            recording.log(
                f"/map/fixes/{name}", rr.GeoPoints(lat_lon=np.degrees(lla[:, :2]), colors=color, radii=size), static=True
            )


def _send_outage_tracks(recording: rr.RecordingStream, result: RunResult, track: Floats) -> None:
    solution = result.solution
    inside = [(solution.t_ns >= e.outage.start_ns) & (solution.t_ns <= e.outage.end_ns) for e in outage_errors(result)]
    strips = [track[rows] for rows in inside if rows.sum() > 1]
    if strips:
        recording.log(
            "/local/solution_in_outages", rr.LineStrips3D(strips, colors=RED, radii=rr.Radius.ui_points(2)), static=True
        )
        degrees = [np.degrees(solution.lla[rows, :2]) for rows in inside if rows.sum() > 1]
        recording.log(
            "/map/solution_in_outages",
            rr.GeoLineStrings(lat_lon=degrees, colors=RED, radii=rr.Radius.ui_points(2.5)),
            static=True,
        )


def _send_ellipsoids(recording: rr.RecordingStream, solution: Solution, track: Floats) -> None:
    """3-sigma ellipsoids of position, now and then along the track."""
    rows = np.arange(0, len(solution), max(1, len(solution) // _ELLIPSOIDS))
    turn = enu_from_ned(np.eye(3))
    cov = turn @ solution.cov[rows, :3, :3] @ turn
    variances, axes = np.linalg.eigh(cov)
    axes[:, :, 2] *= np.sign(np.linalg.det(axes))[:, None]
    ellipsoids = rr.Ellipsoids3D(
        centers=track[rows],
        half_sizes=3 * np.sqrt(np.maximum(variances, 0)),
        quaternions=scalar_last_from_first(quat_from_matrix(axes)),
        colors=PALE,
        line_radii=rr.Radius.ui_points(0.5),
    )
    recording.log("/local/ellipsoids", ellipsoids, static=True)


def _send_verdict(recording: rr.RecordingStream, described: Mapping[str, Any]) -> None:
    """As a document beside the events."""
    text = "\n".join([f"**Verdict: {described['summary']}**\n", *(f"- {line}" for line in described["lines"])])
    recording.log("/verdict", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)


def _send_events(recording: rr.RecordingStream, result: RunResult, described: Mapping[str, Any]) -> None:
    solution = result.solution
    begin = int(solution.t_ns[0])
    # the cursor opens at the first time there is, and that should be one with something to see
    rows = [(begin, _GRADE_LEVELS[described["grade"]], f"verdict: {described['summary']}")]
    rows += [(max(event.t_ns, begin), event.level, event.text) for event in solution.events]
    rows += [(begin, finding.level, finding.text) for finding in result.findings]
    for errors in outage_errors(result):
        end = "" if np.isnan(errors.end_horizontal) else f", horizontal error at its end {errors.end_horizontal:.2f} m"
        rows.append((errors.outage.start_ns, "info", f"outage of {errors.length_s:.1f} s ({errors.outage.cause}) begins{end}"))
    rows.sort(key=lambda row: row[0])
    t_ns, levels, texts = zip(*rows, strict=True)
    columns = rr.TextLog.columns(text=list(texts), level=[_level(level) for level in levels])
    recording.send_columns("/events", indexes=time_columns(np.array(t_ns, dtype=np.int64), solution), columns=columns)


def _level(level: str) -> str:
    return {"warning": "WARN", "error": "ERROR"}.get(level, "INFO")
