"""The layout with which a recording opens: track and map on the left, plots and events on the right."""

from typing import NamedTuple

import rerun as rr
import rerun.blueprint as rrb

__all__ = ["Stack", "build_layout"]

Point = tuple[float, float, float]


class Stack(NamedTuple):
    """Plots of one quantity, one per label, one above the other. origin: entity under which the labels lie; without labels the
    one plot is of all that lies under it. unit: may be empty."""

    name: str
    origin: str
    labels: tuple[str, ...]
    unit: str


def _arrange(stack: Stack, whole: rr.TimeRange, under: str) -> rrb.Vertical:
    plots = [(label, f"{under}{stack.origin}/{label}") for label in stack.labels] or [(stack.name, f"{under}{stack.origin}")]
    views = [
        rrb.TimeSeriesView(
            name=f"{name} [{stack.unit}]" if stack.unit else name,
            origin=origin,
            axis_x=rrb.TimeAxis(view_range=whole),
            plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
        )
        for name, origin in plots
    ]
    return rrb.Vertical(contents=views, name=stack.name)


def build_layout(
    stacks: tuple[Stack, ...], duration_s: float, eye: Point, target: Point, zoom: float, sky: bool, under: str = ""
) -> rrb.Blueprint:
    """duration_s: of the drive, all of which the plots show. eye, target [m]: where the 3-D view looks from and at, as east,
    north, up. zoom: of the map, in web Mercator levels. sky: whether there are satellites to show. under: entity that
    all others lie under."""
    margin = 0.02 * duration_s
    whole = rr.TimeRange(
        start=rr.TimeRangeBoundary.absolute(seconds=-margin), end=rr.TimeRangeBoundary.absolute(seconds=duration_s + margin)
    )
    track = rrb.Spatial3DView(
        name="Track (east, north, up)",
        origin=f"{under}/local",
        eye_controls=rrb.EyeControls3D(position=eye, look_target=target, eye_up=(0.0, 0.0, 1.0)),
        line_grid=rrb.LineGrid3D(visible=True),
    )
    chart = rrb.MapView(name="Map", origin=f"{under}/map", zoom=zoom, background=rrb.MapProvider.OpenStreetMap)
    bounds = rrb.VisualBounds2D(x_range=(-1.2, 1.2), y_range=(-1.2, 1.2))
    overhead = (
        [rrb.Spatial2DView(name="Sky (north up, horizon at the rim)", origin=f"{under}/sky", visual_bounds=bounds)]
        if sky
        else []
    )
    plots = rrb.Tabs(contents=[_arrange(stack, whole, under) for stack in stacks], active_tab=0, name="Plots")
    columns = [rrb.encodings.TextLogColumn(kind, visible=kind != "entitypath") for kind in ("entitypath", "loglevel", "body")]
    events = rrb.TextLogView(name="Events", origin=f"{under}/events", columns=rrb.TextLogColumns(text_log_columns=columns))
    verdict = rrb.TextDocumentView(name="Verdict", origin=f"{under}/verdict")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(track, rrb.Horizontal(chart, *overhead), row_shares=[3, 2]),
            rrb.Vertical(plots, rrb.Horizontal(verdict, events), row_shares=[3, 1]),
            column_shares=[1, 1],
        ),
        rrb.TimePanel(state="collapsed", timeline="elapsed"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
    )
