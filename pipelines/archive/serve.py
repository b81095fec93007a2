"""The archive in Rerun: one segment per drive, one layer per method, headline figures as properties of the segment."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from navreplay.timeline import LogError
from pipelines.archive.catalogue import read_catalogue

__all__ = ["open_server", "serve"]

NAME = "navreplay"


def open_server(folder: Path, port: int | None = None, host: str = "127.0.0.1") -> Any:
    """A server with all recordings of an archive. Raises LogError without the extra, or where the archive holds none."""
    try:
        import datafusion  # noqa: F401 - the client of the catalogue needs it
        from rerun.server import Server
    except ImportError as error:
        raise LogError("serving an archive needs the extra [catalog]: pip install 'navreplay[catalog]'") from error
    table = read_catalogue(folder)
    done = table[table["status"] == "done"]
    paths = [(folder / "drives" / row.drive / row.method / "recording.rrd", row.method) for row in done.itertuples()]
    there = [(path.resolve(), method) for path, method in paths if path.exists()]
    if not there:
        raise LogError(f"{folder}: holds no recordings; was it made with output.recording = false?")
    server = Server(host=host, port=port, datasets={NAME: []})
    dataset = server.client().get_dataset(NAME)
    uris, layers = [path.as_uri() for path, _ in there], [method for _, method in there]
    dataset.register(uris, layer_name=layers).wait()
    return server


def serve(folder: Path, port: int, host: str, tell: Callable[[str], None]) -> None:
    """Serves until it is interrupted."""
    import threading

    server = open_server(folder, port, host)
    try:
        tell(f"{server.url()}: open it with `rerun {server.url()}`; Ctrl-C ends it")
        threading.Event().wait()
    finally:
        server.shutdown()
