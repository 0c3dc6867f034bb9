#!/usr/bin/env python3
"""Makes the table of drives of `replay --table` from logs on any file system, on many machines, by Dask.

    fleet.py --table drives.parquet logs
    fleet.py --table drives.parquet --scheduler tcp://192.168.1.10:8786 s3://drives/2026

Needs dask[distributed], fsspec and pyarrow, and for other file systems their fsspec package, as s3fs. Every worker needs the
program replay (`cargo install --path tools --bin replay`), or --replay says where it is. Copies of a
log are left out within a batch only. Only an earlier table of drives is replaced.

Exit codes: 0; 1 if it failed; 2 if nothing could be tried, or there is no row: then nothing is written.
"""

import argparse
import csv
import logging
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

# Marks of replay's: in the metadata of a table, which is kept when tables are put together, and the head of failures.
MARK = b"rover-battmon"
FAILURES_HEADER = ("path", "reason")

# Of a scheduler.
CONNECT_TIMEOUT_S = 10


class Failure(Exception):
    """What was not possible, and the exit code."""


def count(text):
    if int(text) < 1:
        raise argparse.ArgumentTypeError("at least 1")
    return int(text)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", nargs="+", help="logs, and folders with all logs below: paths or URLs of fsspec")
    parser.add_argument("--table", required=True, help="Parquet file to write; FILE.failures.csv has what gave no row")
    parser.add_argument("--param", action="append", default=[], help="as replay's: also what these would have done")
    parser.add_argument("--scheduler", help="of a cluster, as tcp://192.168.1.10:8786; without it this machine works")
    parser.add_argument("--replay", default="replay", help="the program, by its name or path on the workers")
    parser.add_argument("--batch", type=count, default=64, help="logs that a task reads (64)")
    return parser.parse_args()


def logs_of(url):
    """Each log, by a name that fsspec opens on any worker. Raises Failure."""
    try:
        files, path = fsspec.url_to_fs(url)
        if files.isdir(path):
            return [files.unstrip_protocol(found) for found in files.find(path) if found.lower().endswith(LOGS)]
        exists = files.exists(path)
    except Exception as error:
        # Each file system has errors of its own.
        raise Failure(f"{url}: {error}", 2) from error
    if not exists:
        raise Failure(f"{url}: there is no such file or folder", 2)
    return [files.unstrip_protocol(path)]


def fetched(log, folder, number):
    """Path of a log on a worker: its own, or that of a copy. Raises OSError."""
    files, path = fsspec.url_to_fs(log)
    if "file" in files.protocol:
        os.stat(path)
        return path
    copy = os.path.join(folder, f"{number:06}.BIN")
    files.get_file(path, copy)
    return copy


def drives_of(logs, replay, parameters):
    """Table and failures of some logs, as replay gives them; the table is `None` without a row. A text instead if it can't be
    done at all: of an exception Dask would print a traceback."""
    with tempfile.TemporaryDirectory() as folder:
        logs_by_path, failures = {}, []
        for number, log in enumerate(logs):
            try:
                logs_by_path[fetched(log, folder, number)] = log
            except OSError as error:
                failures.append((name_of(log), str(error)))
        if not logs_by_path:
            return None, failures
        written = pathlib.Path(folder, "drives.parquet")
        chosen = [option for parameter in parameters for option in ("--param", parameter)]
        command = [replay, "--table", str(written), *chosen, "--", *logs_by_path]
        try:
            finished = subprocess.run(command, capture_output=True, text=True, check=False)
        except OSError as error:
            return str(error)
        if finished.returncode and not finished.stderr.endswith("error: no row: nothing was written\n"):
            return finished.stderr.strip()
        if finished.returncode:
            lines = finished.stderr.splitlines()
            for path, log in logs_by_path.items():
                reasons = (line.removeprefix(f"{path}: ") for line in lines if line.startswith(f"{path}: "))
                failures.append((name_of(log), next(reasons, "no row")))
            return None, failures
        table = pyarrow.parquet.read_table(written)
        with open(written.with_suffix(".failures.csv"), newline="", encoding="utf-8") as file:
            failures += [(name_of(logs_by_path[failure["path"]]), failure["reason"]) for failure in csv.DictReader(file)]
    field = table.schema.field("path")
    names = [name_of(logs_by_path[path]) for path in table["path"].to_pylist()]
    table = table.set_column(table.schema.get_field_index("path"), field, pyarrow.array(names, field.type))
    return table, failures


def name_of(log):
    """A log as a person knows it."""
    return log.removeprefix("file://")


def in_batches(logs, size):
    return [logs[first : first + size] for first in range(0, len(logs), size)]


def is_table(path):
    """Whether replay wrote a file, or this script what replay had written."""
    try:
        metadata = pyarrow.parquet.read_metadata(path)
    except (OSError, pyarrow.ArrowException):
        return False
    return MARK in (metadata.metadata or {}) or metadata.created_by.startswith(MARK.decode())


def is_failures(path):
    with open(path, encoding="utf-8", errors="replace") as file:
        return file.readline().strip() == ",".join(FAILURES_HEADER)


def check_replaceable(path, is_own):
    """Raises Failure if a file is there that is none of ours."""
    if path.is_file() and (path.stat().st_size == 0 or is_own(path)):
        return
    if path.exists():
        raise Failure(f"{path}: was not written by this program; remove it, or name another file", 2)
    if not path.parent.is_dir():
        raise Failure(f"{path.parent}: there is no such folder", 2)


def tables_and_failures(chosen, logs):
    """Those of each batch, by columns. Raises Failure."""
    try:
        cluster = chosen.scheduler or LocalCluster(dashboard_address=None)
        with Client(cluster, timeout=CONNECT_TIMEOUT_S) as client:
            batches = in_batches(logs, chosen.batch)
            tasks = client.map(drives_of, batches, replay=chosen.replay, parameters=chosen.param, pure=False)
            results = client.gather(tasks)
    except OSError as error:
        # There is no such scheduler.
        raise Failure(str(error), 2) from error
    for result in results:
        if isinstance(result, str):
            raise Failure(result, 2)
    return zip(*results)


def make_table(chosen):
    """Raises Failure, and OSError if a file can't be written."""
    table_path = pathlib.Path(chosen.table)
    failures_path = table_path.with_suffix(".failures.csv")
    check_replaceable(table_path, is_table)
    check_replaceable(failures_path, is_failures)
    # Each once, and in the order of replay.
    logs = sorted({log for url in chosen.logs for log in logs_of(url)})
    if not logs:
        raise Failure("no log (.BIN) there", 2)
    tables, failures = tables_and_failures(chosen, logs)
    tables = [table for table in tables if table is not None]
    failures = [failure for some in failures for failure in some]
    if not tables:
        reasons = "".join(f"{path}: {reason}\n" for path, reason in failures)
        raise Failure(f"{reasons}no row: nothing was written", 2)
    table = pyarrow.concat_tables(tables)
    pyarrow.parquet.write_table(table, table_path)
    with open(failures_path, "w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([FAILURES_HEADER, *failures])
    print(f"{table.num_rows} rows of {len(logs)} logs, {len(failures)} failures")


def main():
    chosen = arguments()
    # Of Ctrl-C it would report each task that Dask has not finished.
    logging.getLogger("asyncio").setLevel(logging.CRITICAL)
    try:
        make_table(chosen)
    except Failure as failure:
        text, code = failure.args
        print(text, file=sys.stderr)
        return code
    except OSError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(1)
