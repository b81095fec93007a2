"""The archive in Rerun: one segment per drive, one layer per method, headline figures as properties of the segment."""

import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from navreplay.timeline import LogError
from pipelines.archive.catalogue import read_catalogue
from pipelines.files.remote import local

__all__ = ["open_server", "serve"]

NAME = "navreplay"
_COLUMNS = (
    ("attention", "attention"),
    ("verdict", "verdict"),
    ("horizontal_rms_m", "horizontal rms m"),
    ("horizontal_p95_m", "95 % m"),
    ("position_nees", "NEES"),
    ("position_nis", "NIS"),
    ("std_horizontal_m", "sigma m"),
    ("used_share", "used"),
    ("outages", "outages"),
    ("longest_outage_s", "longest outage s"),
    ("findings", "findings"),
    ("first_finding", "first finding"),
)
_SHARED = (("start_utc", "start UTC"), ("duration_s", "duration s"), ("distance_m", "distance m"))


def open_server(folder: Path, port: int | None = None, host: str = "127.0.0.1") -> Any:
    """A server with all recordings of an archive; its table of segments shows the figures that matter, what asks to be looked
    at first. Raises LogError without the extra, where the archive holds no recordings, or where host and port cannot be
    had."""
    try:
        import datafusion  # noqa: F401 - the client of the catalogue needs it
        from rerun.server import Server
    except ImportError as error:
        raise LogError("serving an archive needs the extra [catalog]: pip install 'navreplay[catalog]'") from error
    table = read_catalogue(folder)
    done = table[table["status"] == "done"]
    paths = [(local(folder, f"drives/{row.drive}/{row.method}/recording.rrd"), row.method) for row in done.itertuples()]
    there = [(path.resolve(), method) for path, method in paths if path.exists()]
    if not there:
        raise LogError(f"{folder}: holds no recordings; was it made with output.recording = false?")
    try:
        server = Server(host=host, port=port, datasets={NAME: []})
    except (ValueError, OSError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        raise LogError(f"--host {host} --port {port}: the archive cannot be served there ({reason}); choose others") from error
    dataset = server.client().get_dataset(NAME)
    uris, layers = [path.as_uri() for path, _ in there], [method for _, method in there]
    dataset.register(uris, layer_name=layers).wait()
    _lay_out(dataset, list(dict.fromkeys(layers)))
    return server


def _lay_out(dataset: Any, methods: Sequence[str]) -> None:
    """What the table of segments shows, and in which order: that of attention by the first method, the worst first."""
    import rerun.blueprint as rrb

    known = set(dataset.segment_table().schema().names)
    wanted = [("rerun_segment_id", "drive"), ("rerun_layer_names", "methods")]
    wanted += [(f"property:{methods[0]}:{key}", title) for key, title in _SHARED]
    wanted += [
        (f"property:{method}:{key}", title if len(methods) == 1 else f"{method}: {title}")
        for method in methods
        for key, title in _COLUMNS
    ]
    columns = [rrb.table.Column(source, name=title) for source, title in wanted if source in known]
    listed = {column.source for column in columns}
    columns += [rrb.table.Column(source, visible=False) for source in sorted(known - listed)]
    order = rrb.table.SortBy(f"property:{methods[0]}:attention", direction="Descending")
    layout = rrb.table.TableBlueprint(table_layout=rrb.table.TableLayout(columns=columns), sort_by=order)
    with TemporaryDirectory() as scratch:
        path = Path(scratch) / "segments.rbl"
        layout.save(NAME, path)
        dataset.register_blueprint(path.as_uri(), segment_table=True)


def serve(folder: Path, port: int, host: str, tell: Callable[[str], None]) -> None:
    """Serves until it is interrupted."""
    server = open_server(folder, port, host)
    try:
        tell(f"{server.url()}: open it with `rerun {server.url()}`; Ctrl-C ends it")
        threading.Event().wait()
    finally:
        server.shutdown()
