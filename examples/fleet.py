#!/usr/bin/env python3
"""Makes the table of drives of `replay --table` from logs on any file system, on many machines, by Dask.

    fleet.py --table drives.parquet logs
    fleet.py --table drives.parquet --scheduler tcp://192.168.1.10:8786 s3://drives/2026

Needs dask[distributed], fsspec and pyarrow, and for other file systems their fsspec package, as s3fs. Every worker needs the
program replay (`cargo install --path tools --bin replay`), or --replay says where it is. Copies of a
log are left out within a batch only.
"""

import argparse
import csv
import os
import pathlib
import subprocess
import sys
import tempfile

import fsspec
import pyarrow
import pyarrow.parquet
from dask.distributed import Client, LocalCluster

# Ends of the names of logs.
LOGS = (".bin", ".log", ".tlog", ".ulg")


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", nargs="+", help="logs, and folders with all logs below: paths or URLs of fsspec")
    parser.add_argument("--table", required=True, help="Parquet file to write; FILE.failures.csv has what gave no row")
    parser.add_argument("--param", action="append", default=[], help="as replay's: also what these would have done")
    parser.add_argument("--scheduler", help="of a cluster, as tcp://192.168.1.10:8786; without it this machine works")
    parser.add_argument("--replay", default="replay", help="the program, by its name or path on the workers")
    parser.add_argument("--batch", type=int, default=64, help="logs that a task reads (64)")
    return parser.parse_args()


def logs_of(url):
    """Each log, by a name that fsspec opens on any worker."""
    files, path = fsspec.url_to_fs(url)
    if not files.isdir(path):
        return [files.unstrip_protocol(path)]
    return [files.unstrip_protocol(found) for found in files.find(path) if found.lower().endswith(LOGS)]


def local_path(log, folder, number):
    """Where a worker finds a log: itself, or a copy."""
    files, path = fsspec.url_to_fs(log)
    if "file" in files.protocol:
        return path
    copy = os.path.join(folder, f"{number:06}.BIN")
    try:
        files.get_file(path, copy)
    except OSError as error:
        # Replay reports that it is not there.
        print(f"{log}: {error}", file=sys.stderr)
    return copy


def drives_of(logs, replay, parameters):
    """Table and failures of some logs, as replay gives them."""
    with tempfile.TemporaryDirectory() as folder:
        logs_by_path = {local_path(log, folder, number): log for number, log in enumerate(logs)}
        written = pathlib.Path(folder, "drives.parquet")
        chosen = [option for parameter in parameters for option in ("--param", parameter)]
        command = [replay, "--table", str(written), *chosen, "--", *logs_by_path]
        finished = subprocess.run(command, capture_output=True, text=True, check=False)
        if finished.returncode:
            raise RuntimeError(finished.stderr)
        table = pyarrow.parquet.read_table(written)
        with open(written.with_suffix(".failures.csv"), newline="", encoding="utf-8") as file:
            failures = list(csv.DictReader(file))
    field = table.schema.field("path")
    names = [name_of(logs_by_path[path]) for path in table["path"].to_pylist()]
    table = table.set_column(table.schema.get_field_index("path"), field, pyarrow.array(names, field.type))
    return table, [(name_of(logs_by_path[failure["path"]]), failure["reason"]) for failure in failures]


def name_of(log):
    """A log as a person knows it."""
    return log.removeprefix("file://")


def in_batches(logs, size):
    return [logs[first : first + size] for first in range(0, len(logs), size)]


def main():
    chosen = arguments()
    # Each once, and in the order of replay.
    logs = sorted({log for url in chosen.logs for log in logs_of(url)})
    if not logs:
        sys.exit("no log (.BIN) there")
    with Client(chosen.scheduler or LocalCluster(dashboard_address=None)) as client:
        batches = in_batches(logs, chosen.batch)
        tasks = client.map(drives_of, batches, replay=chosen.replay, parameters=chosen.param, pure=False)
        tables, failures = zip(*client.gather(tasks))
    table = pyarrow.concat_tables(tables)
    pyarrow.parquet.write_table(table, chosen.table)
    failures = [failure for some in failures for failure in some]
    with open(pathlib.Path(chosen.table).with_suffix(".failures.csv"), "w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("path", "reason"), *failures])
    print(f"{table.num_rows} rows of {len(logs)} logs, {len(failures)} failures")


if __name__ == "__main__":
    main()
