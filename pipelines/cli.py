"""The command line. Nothing heavy is imported before a command is known to be wanted and its arguments to be right."""

import argparse
import os
import sys
from collections.abc import Sequence
from datetime import datetime
from importlib import import_module, metadata
from pathlib import Path

__all__ = ["EXPORT_FORMATS", "main"]

# As pipelines.trajectory.export has them; not imported from there, so that --help stays quick.
EXPORT_FORMATS = ("csv", "parquet", "tum", "kitti", "kml", "geojson", "pos", "sbet", "smrmsg", "nmea", "gpx")

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command and returns the exit code: 0, 1 for input that cannot be used, 2 for wrong usage, 3 for a
    poor verdict where --strict was given, 130 for Ctrl-C."""
    arguments = _build_parser().parse_args(argv)
    for name in _THREADS:  # matrices of a filter are far too small for threads, which wait for each other
        os.environ.setdefault(name, "1")
    try:
        return _run(arguments)
    except KeyboardInterrupt:
        print("navreplay: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader of our output has gone; without this the interpreter would complain while it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def _run(arguments: argparse.Namespace) -> int:
    command = import_module(f"pipelines.commands.{arguments.module}")
    from navreplay.timeline import LogError

    try:
        code: int = command.run(arguments) or 0
        sys.stdout.flush()
    except LogError as error:
        print(f"navreplay: error: {error}", file=sys.stderr)
        return 1
    return code


class _Version(argparse.Action):
    """Looks the version up only when asked."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(f"navreplay {metadata.version('navreplay')}")
        parser.exit()


def _build_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="navreplay",
        description="Replays navigation logs: a drive's IMU and GNSS data in; trajectory, accuracy report and recording out.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for add in _COMMANDS:
        add(commands)
    return parser


def _add_command(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]", name: str, text: str, module: str = ""
) -> argparse.ArgumentParser:
    parser = commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
    parser.set_defaults(module=module or name)
    return parser


def _add_logs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("logs", metavar="LOG", nargs="+", help="log files, bag folders or addresses; several are merged")
    parser.add_argument("-c", "--config", metavar="FILE", type=Path, help="configuration in TOML")
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="append", default=[], dest="sets", help="override one key, e.g. imu.grade=tactical"
    )


def _add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="print the result as JSON on standard output")


def _add_out(parser: argparse.ArgumentParser, metavar: str, text: str, required: bool = True) -> None:
    parser.add_argument("-o", "--out", metavar=metavar, type=Path, required=required, help=text)
    parser.add_argument("--force", action="store_true", help=f"overwrite {metavar} if it exists")


def _add_processing(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--reference", metavar="FILE", type=Path, help="reference solution to compare with")
    parser.add_argument("--rate", metavar="HZ", type=float, help="rows of the solution between GNSS epochs")
    parser.add_argument("--smooth", action="store_true", help="smooth: every row from the measurements before and behind it")
    parser.add_argument("--quiet", action="store_true", help="no progress bar, no summary")
    _add_json(parser)
    _add_out(parser, "OUT", "folder for the results")


def _add_inspect(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = _add_command(commands, "inspect", "show channels, rates, gaps, time base and what looks wrong in logs")
    _add_logs(parser)
    _add_json(parser)


def _add_init(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = _add_command(commands, "init", "write a commented configuration filled with what the logs show")
    _add_logs(parser)
    _add_out(parser, "FILE", "configuration to write")


def _add_run(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = _add_command(commands, "run", "process a drive: solution, report and recording")
    _add_logs(parser)
    parser.add_argument("--filter", metavar="NAME", help="method, see 'navreplay filters'")
    parser.add_argument("--strict", action="store_true", help="exit with 3 where the verdict is poor")
    parser.add_argument("--quick", action="store_true", help="do not try which setting would help most")
    _add_processing(parser)


def _add_compare(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = _add_command(commands, "compare", "process a drive with several methods: one report")
    _add_logs(parser)
    parser.add_argument(
        "--filters",
        metavar="A,B,...",
        required=True,
        help="methods, see 'navreplay filters'; all: every one but the slow ml-ga and mlckf-ga",
    )
    parser.add_argument(
        "--vary", metavar="KEY=A,B,...", help="every method with each value of one key, e.g. gnss.noise_scale=0.25,1,4"
    )
    _add_processing(parser)


def _add_synth(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = _add_command(commands, "synth", "write a synthetic log and its truth")
    parser.add_argument("scenario", metavar="SCENARIO", help="name of a scenario; 'list' lists them")
    parser.add_argument("--seed", metavar="N", type=int, default=0, help="seed of all randomness (default 0)")
    parser.add_argument("-o", "--out", metavar="FILE", type=Path, help="log to write; its extension names the format")
    parser.add_argument("--force", action="store_true", help="overwrite files that exist")


def _add_experiment(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = _add_command(commands, "experiment", "compare methods with each other and with a paper, over many seeds")
    parser.add_argument("experiment", metavar="NAME", help="name of an experiment; 'list' lists them")
    parser.add_argument("--seeds", metavar="N", type=int, default=20, help="how many seeds (default 20)")
    parser.add_argument("--jobs", metavar="J", type=int, default=0, help="processes (default: one per core)")
    parser.add_argument("--quiet", action="store_true", help="no progress bar, no summary")
    _add_out(parser, "OUT", "folder for the results", required=False)


def _add_export(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = _add_command(commands, "export", "write the trajectory of a finished run in another format")
    parser.add_argument("folder", metavar="OUT", type=Path, help="folder written by 'navreplay run'")
    parser.add_argument("--format", required=True, choices=EXPORT_FORMATS, help="format of the trajectory")
    _add_out(parser, "FILE", "file to write (default: OUT/trajectory.FORMAT)", required=False)


def _add_filters(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    _add_json(_add_command(commands, "filters", "list the methods, a line each"))


def _add_formats(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    _add_json(_add_command(commands, "formats", "list the log formats that are read, a line each"))


def _add_batch(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = _add_command(commands, "batch", "process an archive of drives, with a catalogue of all")
    parser.add_argument(
        "sources", metavar="SOURCE", nargs="+", help="folders, logs, addresses, patterns, or lists of them (.lst)"
    )
    parser.add_argument("-o", "--out", metavar="DEST", type=Path, required=True, help="folder or address for the results")
    parser.add_argument("-c", "--config", metavar="FILE", type=Path, help="configuration in TOML for all drives")
    parser.add_argument(
        "--rules", metavar="FILE", type=Path, help="TOML with what the archive cannot tell: configurations, joins"
    )
    parser.add_argument("--filters", metavar="A,B,...", help="methods (default: that of the configuration)")
    parser.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], dest="sets", help="override one key")
    parser.add_argument("--workers", metavar="N", type=int, default=0, help="processes (default: one per core)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="a running Dask scheduler, or 'local' for a cluster here")
    parser.add_argument("--resume", action="store_true", help="go on with a batch: only what is new or changed")
    parser.add_argument("--retry-failed", action="store_true", help="the same, and what failed before")
    parser.add_argument("--match", metavar="GLOB", default="*", help="only files of this pattern")
    parser.add_argument("--since", metavar="TIME", type=datetime.fromisoformat, help="only files changed since then")
    parser.add_argument("--until", metavar="TIME", type=datetime.fromisoformat, help="only files changed until then")
    parser.add_argument("--dry-run", action="store_true", help="show the drives that were found, and why, and do nothing")
    parser.add_argument("--quiet", action="store_true", help="no progress bar, no summary")
    _add_json(parser)


def _add_catalog(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = _add_command(commands, "catalog", "search the catalogue of an archive, or open it in Rerun")
    parser.add_argument("folder", metavar="DEST", type=Path, help="folder written by 'navreplay batch'")
    parser.add_argument("--where", metavar="CONDITION", help='such as "horizontal_rms_m > 0.1 and distance_m > 1000"')
    parser.add_argument("--sort", metavar="COLUMN", help="smallest first; -COLUMN: largest first (write --sort=-COLUMN)")
    parser.add_argument("--columns", metavar="A,B,...", help="columns to show")
    parser.add_argument("--format", choices=("table", "csv", "json", "parquet"), default="table", help="how to show them")
    parser.add_argument("-o", "--out", metavar="FILE", type=Path, help="file for --format parquet")
    parser.add_argument("--serve", action="store_true", help="serve the archive to the Rerun viewer")
    parser.add_argument("--host", default="127.0.0.1", help="address to serve on (default: this machine alone)")
    parser.add_argument("--port", type=int, default=51234, help="port to serve on")


def _add_diff(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = _add_command(commands, "diff", "show what changed between two reprocessings of an archive")
    parser.add_argument("before", metavar="DEST_A", type=Path, help="folder written by 'navreplay batch'")
    parser.add_argument("after", metavar="DEST_B", type=Path, help="another one, later")
    parser.add_argument(
        "--tolerance", metavar="M", type=float, default=0.01, help="exit 1 beyond this separation (default 0.01 m)"
    )
    parser.add_argument("--html", metavar="FILE", type=Path, help="write it as a page, with the separations drawn")
    _add_json(parser)


def _add_summary(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    parser = _add_command(
        commands, "summary", "tell of an archive as a whole: errors over drives and road, outages, what to look at"
    )
    parser.add_argument("folder", metavar="DEST", type=Path, help="folder written by 'navreplay batch'")
    _add_json(parser)


_COMMANDS = (
    _add_inspect,
    _add_init,
    _add_run,
    _add_compare,
    _add_synth,
    _add_experiment,
    _add_export,
    _add_batch,
    _add_catalog,
    _add_diff,
    _add_summary,
    _add_filters,
    _add_formats,
)
"""What the command line knows, in the order of its help; docs/recipes.md says how to add one."""


if __name__ == "__main__":
    sys.exit(main())
