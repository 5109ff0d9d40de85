# SPDX-License-Identifier: GPL-2.0-or-later
"""What incise for Python costs: rows a second and memory of a long recording next to sqlite3, a model
at a million points next to the library's own loop, and the import.

    make check-python-speed [ROWS=100000000]

The recording is a short one of the simulated rig whose force table is filled up to ROWS.
"""

import os
import sqlite3
import statistics
import subprocess
import sys
import tempfile
import time

import incise
from incise._library import function

BUILD = os.environ["INCISE_BUILD"]
ROWS = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000_000


def program(*command):
    subprocess.run(
        [os.path.join(BUILD, "bin", "incise"), *command], check=True, stdout=subprocess.DEVNULL
    )


def resident_kB(what):
    with open("/proc/self/status") as file:
        return [int(line.split()[1]) for line in file if line.startswith(what)][0]


def fill(path):
    database = sqlite3.connect(os.path.join(path, "recording.db"))
    have, last = database.execute("SELECT count(*), max(t_ns) FROM force").fetchone()
    database.execute("PRAGMA journal_mode=OFF")
    database.execute("PRAGMA synchronous=OFF")
    database.execute(
        "WITH RECURSIVE n(i) AS (SELECT ? UNION ALL SELECT i + 1 FROM n WHERE i < ?) "
        "INSERT INTO force SELECT i, ? + (i - ? + 1) * 100000, 200 + i % 3000 FROM n",
        (have, ROWS - 1, last, have),
    )
    database.execute("UPDATE meta SET value = ? WHERE key = 'force_rows'", (ROWS,))
    database.commit()
    database.close()


def seconds(call):
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def read_stream(recording):
    assert sum(len(batch) for batch in recording.force.batches()) == ROWS


def read_sqlite(path):
    """The same columns by the program sqlite3, summed up so that no text is written."""
    subprocess.run(
        ["sqlite3", os.path.join(path, "recording.db"),
         "SELECT count(*), sum(seq), sum(t_ns - 1000000000), sum(code) FROM force"],
        check=True, stdout=subprocess.DEVNULL,
    )


def read_sqlite_rows(path):
    database = sqlite3.connect(os.path.join(path, "recording.db"))
    for _ in database.execute("SELECT seq, t_ns, code FROM force"):
        pass
    database.close()


with tempfile.TemporaryDirectory(dir=BUILD) as folder:
    path = os.path.join(folder, "long.rec")
    program("capture", "-o", path, "--rig", "sim:seed=1,clock=simulated", "--duration", "2s")
    fill(path)
    size = os.path.getsize(os.path.join(path, "recording.db")) / 1e6
    print(f"{ROWS:.3g} rows of force, {size:.0f} MB")
    recording = incise.open(path, damaged=True)  # the ledger is not of these rows
    next(recording.events.batches())
    idle = resident_kB("VmRSS")
    rows = []
    for name, call in (
        ("stream", lambda: read_stream(recording)),
        ("sqlite3, the program, sums only", lambda: read_sqlite(path)),
        ("sqlite3, Python's module", lambda: read_sqlite_rows(path)),
    ):
        took = seconds(call)
        rows.append((name, ROWS / took / 1e6))
        if name == "stream":
            print(f"memory above idle: {(resident_kB('VmHWM') - idle) / 1e3:.1f} MB at most")
    for name, rate in rows:
        print(f"{name}: {rate:.2f} million rows/s")

    program("capture", "-o", os.path.join(folder, "liver.rec"), "--rig", "sim:seed=1,clock=simulated")
    model = incise.train(os.path.join(folder, "liver.rec"), group="cut")

import numpy as np

x = np.random.default_rng(1).uniform((0, 0), (20, 50), (1_000_000, 2))
y = np.empty(len(x))
loop = function("incise_model_eval_many")
ratios = []
for _ in range(7):
    c = seconds(lambda: loop(model._pointer, x.ctypes.data, len(x), y.ctypes.data, None))
    ratios.append(seconds(lambda: model(x)) / c)
print(f"model(x) of 10^6 points: {statistics.median(ratios):.3f} of the C batch loop, median of 7 "
      f"({min(ratios):.3f} to {max(ratios):.3f})")
times = [
    float(line.split("|")[1]) / 1e3
    for _ in range(7)
    for line in subprocess.run(
        [sys.executable, "-X", "importtime", "-c", "import incise"], capture_output=True, text=True
    ).stderr.splitlines()
    if line.split("|")[-1].strip() == "incise"
]
print(f"import incise: {statistics.median(times):.0f} ms, median of 7 ({min(times):.0f} to "
      f"{max(times):.0f})")
