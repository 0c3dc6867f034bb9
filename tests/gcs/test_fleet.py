"""Many logs by Dask: the same table as on one machine, also if a worker dies meanwhile."""

import csv
import functools
import http.server
import os
import signal
import subprocess
import sys
import threading
import time

import duckdb
import pyarrow.parquet
import pytest
from dask.distributed import LocalCluster

from conftest import REPOSITORY

FLEET = REPOSITORY / "examples/fleet.py"
REPLAY = REPOSITORY / "target/debug/replay"

# Of twenty drives each.
PACKS = 2
LOGS = 20 * PACKS


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    command = ["cargo", "test", "--quiet", "--test", "fleet", "--", "--ignored", "writes_a_fleet"]
    environment = {**os.environ, "FLEET_FOLDER": str(folder), "FLEET_PACKS": str(PACKS)}
    subprocess.run(command, cwd=REPOSITORY, env=environment, check=True, capture_output=True)
    (folder / "text.BIN").write_text("This is a text.\n")
    subprocess.run(["cargo", "build", "--quiet", "--bin", "replay"], cwd=REPOSITORY, check=True)
    return folder


def failures_of(table):
    with open(table.with_suffix(".failures.csv"), newline="", encoding="utf-8") as file:
        return list(csv.reader(file))


def on_this_machine(logs, table):
    subprocess.run([REPLAY, "--table", table, logs], check=True, capture_output=True)
    return table


def wait_for(condition, seconds=60):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_a_worker_that_dies_changes_no_row(logs, tmp_path):
    expected = on_this_machine(logs, tmp_path / "expected.parquet")
    table = tmp_path / "drives.parquet"
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        command = [sys.executable, FLEET, "--table", table, "--replay", REPLAY, "--batch", "1"]
        fleet = subprocess.Popen([*command, "--scheduler", cluster.scheduler_address, logs], stdout=subprocess.PIPE, text=True)
        tasks = cluster.scheduler.tasks
        wait_for(lambda: sum(task.state == "memory" for task in list(tasks.values())) >= 4)
        killed = cluster.workers[0].pid
        os.kill(killed, signal.SIGKILL)
        printed, _ = fleet.communicate(timeout=120)
        assert fleet.returncode == 0
        assert cluster.workers[0].pid != killed, "it was killed while there was work"
    assert printed == f"{LOGS} rows of {LOGS + 1} logs, 1 failures\n"
    assert pyarrow.parquet.read_table(table).equals(pyarrow.parquet.read_table(expected))
    assert failures_of(table) == failures_of(expected)


def test_ctrl_c_ends_it_without_a_table_or_a_traceback(logs, tmp_path):
    table = tmp_path / "drives.parquet"
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        command = [sys.executable, FLEET, "--table", table, "--replay", REPLAY, "--batch", "1"]
        arguments = [*command, "--scheduler", cluster.scheduler_address, logs]
        fleet = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        tasks = cluster.scheduler.tasks
        wait_for(lambda: any(task.state == "memory" for task in list(tasks.values())))
        fleet.send_signal(signal.SIGINT)
        _, errors = fleet.communicate(timeout=30)
    assert fleet.returncode == 1 and "Traceback" not in errors, errors
    assert not table.exists()


@pytest.fixture
def address(logs):
    """Where the logs of the first pack are on the network."""
    folder = next(logs.rglob("00000001.BIN")).parent
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=folder)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


def test_logs_elsewhere_are_fetched_and_keep_their_names(address, tmp_path):
    table = tmp_path / "drives.parquet"
    logs = [f"{address}{number:08}.BIN" for number in (2, 1)]
    subprocess.run([sys.executable, FLEET, "--table", table, "--replay", REPLAY, *logs], check=True)
    assert pyarrow.parquet.read_table(table)["path"].to_pylist() == [logs[1], logs[0]]
    assert failures_of(table) == [["path", "reason"]]


def test_duckdb_reads_the_table(logs, tmp_path):
    table = on_this_machine(logs, tmp_path / "drives.parquet")
    query = f"SELECT pack_id, count(*), max(sag_max_v) > 0 FROM '{table}' GROUP BY pack_id ORDER BY pack_id"
    rows = duckdb.sql(query).fetchall()
    assert [row[1:] for row in rows] == [(20, True)] * PACKS


def fleet(table, *arguments):
    return subprocess.run(
        [sys.executable, FLEET, "--table", table, "--replay", REPLAY, *arguments], capture_output=True, text=True, timeout=100
    )


def test_without_logs_the_table_of_before_stays(logs, address, tmp_path):
    first = next(logs.rglob("00000001.BIN"))
    table = on_this_machine(first, tmp_path / "drives.parquet")
    before = table.read_bytes()
    (tmp_path / "unmounted").mkdir()
    text = logs / "text.BIN"
    for named, said in [
        ([first, tmp_path / "gone"], f"{tmp_path}/gone: there is no such file or folder\n"),
        ([first, f"{address}99.BIN"], f"{address}99.BIN: there is no such file or folder\n"),
        ([tmp_path / "unmounted"], "no log (.BIN) there\n"),
        ([text], "\nno row: nothing was written\n"),
        ([first, "--scheduler", "tcp://127.0.0.1:1"], "\n"),
        ([first, "--replay", "no-such-program"], "No such file or directory: 'no-such-program'\n"),
        ([first, "--param", "SR0_EXTRA1=4"], "error: SR0_EXTRA1 is not of a pack\n"),
        ([first, "--batch", "0"], "at least 1\n"),
    ]:
        ended = fleet(table, *named)
        assert ended.returncode == 2 and ended.stderr.endswith(said) and "Traceback" not in ended.stderr, ended
        assert table.read_bytes() == before


def test_nothing_but_a_table_is_replaced_and_replay_replaces_it_too(logs, tmp_path):
    first = next(logs.rglob("00000001.BIN"))
    for name in ["note", "log"]:
        (tmp_path / name).write_bytes(b"a note" if name == "note" else first.read_bytes())
        before = (tmp_path / name).read_bytes()
        ended = fleet(tmp_path / name, first)
        assert ended.returncode == 2 and "was not written by this program" in ended.stderr, ended
        assert (tmp_path / name).read_bytes() == before
    table = tmp_path / "drives.parquet"
    on_this_machine(first, table)
    # A batch without a row is none of the table's.
    ended = fleet(table, "--batch", "1", first, logs / "text.BIN")
    assert (ended.returncode, ended.stdout) == (0, "1 rows of 2 logs, 1 failures\n"), ended
    expected = pyarrow.parquet.read_table(table)
    on_this_machine(first, table)
    assert pyarrow.parquet.read_table(table).equals(expected)
    assert fleet(table, first).returncode == 0
