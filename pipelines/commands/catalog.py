"""``navreplay catalog``: rows of an archive's catalogue, or the archive in the Rerun viewer."""

import argparse
import json
import sys

from navreplay.timeline import LogError
from pipelines.archive.catalogue import as_rows, read_catalogue, select_rows

__all__ = ["run"]

_USUAL = "drive,method,status,duration_s,distance_m,horizontal_rms_m,horizontal_p95_m,position_nees,findings"


def run(arguments: argparse.Namespace) -> None:
    """Prints the rows that are asked for, or serves. Raises LogError for what is no condition or no column."""
    if arguments.serve:
        from pipelines.archive.serve import serve

        serve(arguments.folder, arguments.port, arguments.host, lambda text: print(text, flush=True))
        return
    columns = arguments.columns or (_USUAL if arguments.format == "table" else None)
    table = select_rows(read_catalogue(arguments.folder), arguments.where, arguments.sort, columns)
    if arguments.format == "parquet":
        if arguments.out is None:
            raise LogError("--format parquet needs -o FILE; a terminal cannot show it")
        table.to_parquet(arguments.out)
    elif arguments.format == "json":
        json.dump(as_rows(table), sys.stdout, indent=2)
        print()
    elif arguments.format == "csv":
        table.to_csv(sys.stdout, index=False)
    elif len(table):
        print(table.to_string(index=False, na_rep="", float_format=lambda value: f"{value:.4g}"))
    else:
        print("no row fits")
