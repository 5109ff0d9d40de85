# SPDX-License-Identifier: GPL-2.0-or-later
"""Recordings in Python: values, metadata, damage, closed and moved files, threads, fork."""

import gc
import hashlib
import math
import os
import signal
import sqlite3
import struct
import subprocess
import sys
import threading
import time
import unittest
import unittest.mock

import incise
import read_blocks
from fixtures import SANITIZED, SHORT, SOURCE, Case, has, run

STREAMS = ("force", "tracker", "depth", "frames", "events")


def rows(table):
    """A column-wise table without any other package, {column: list}."""
    columns = {field.name: [] for field in table.fields}
    for batch in table.batches():
        for field in batch.fields:
            if field.format == "u":
                values = batch.texts(field.name)
            elif field.format == "b":
                values = batch.flags(field.name)
            else:
                values = batch.column(field.name).tolist()
            columns[field.name] += values
    return columns


class Recordings(Case):
    def setUp(self):
        super().setUp()
        self.rec = incise.open(os.path.join(self.shared, "short.rec"))
        self.addCleanup(self.rec.close)

    def test_info_is_that_of_the_tool(self):
        info = self.rec.info
        self.assertTrue(info.complete)
        self.assertEqual(info.cuts, 14)
        self.assertEqual([[str(info.force)]], self.sql(self.rec.path, "SELECT count(*) FROM force"))
        self.assertEqual(info.force_mV_N, 1240)
        self.assertIs(info.newtons, False)
        self.assertEqual([s.name for s in info.streams], ["force", "tracker"])
        self.assertEqual(info.streams[1].lost, 0)
        self.assertEqual(info.surface_normal, (0, 0, 1))

    def test_parts_are_rows_of_the_whole(self):
        """A part has the rows of each stream whose times are in it, a cut those from its first pair
        to its last; next to a filter in Python."""
        start_ns = self.rec.info.start_ns
        cut = rows(self.rec.pairs().cut(3))["t_s"]
        for name in ("force", "tracker", "depth", "events"):
            table = getattr(self.rec, name)
            whole = rows(table)
            for part, from_s, to_s in (
                (table.between(10, 11.5), 10, 11.5),
                (table.between(0, 0.5), 0, 0.5),
                (table.between(42.5), 42.5, math.inf),
                (table.cut(3), cut[0], cut[-1] + 1e-9),
                (getattr(self.rec.cut(3), name), cut[0], cut[-1] + 1e-9),
                (table.cut(3).between(cut[0] + 0.3), cut[0] + 0.3, cut[-1] + 1e-9),
                (table.between(8, 10).between(0, 8.5).between(1), 8, 8.5),
            ):
                inside = [from_s <= round(t - start_ns) * 1e-9 < to_s for t in whole["t_ns"]]
                wanted = {c: [v for v, i in zip(values, inside) if i] for c, values in whole.items()}
                self.assertEqual(repr(rows(part)), repr(wanted), (name, from_s))
                self.assertEqual(len(part), sum(inside))
        self.assertEqual(rows(self.rec.pairs().between(10, 20).cut(5)), rows(self.rec.pairs().cut(5).between(10, 20)))

    def test_parquet_needs_pyarrow(self):
        with unittest.mock.patch.dict(sys.modules, {"pyarrow": None}):
            path = self.path("force.parquet")
            self.says(incise.NotFound, "pip install pyarrow", self.rec.force.parquet, path)
        self.assertEqual(os.listdir(self.folder), [])

    def test_streams_are_the_blocks(self):
        stored = {}
        for stream, _, columns in read_blocks.blocks(self.rec.path):
            for name, values in columns.items():
                stored.setdefault(stream, {}).setdefault(name, []).extend(values)
        force, codes = rows(self.rec.force), stored["force"]["code"]
        self.assertEqual(force["seq"], stored["force"]["seq"])
        self.assertEqual(force["code"], codes)
        info = self.rec.info
        scale = info.full_scale_V * 1e3 / 2**info.bits / info.force_mV_N
        zero = (info.zero_mV - info.offset_V * 1e3) / info.force_mV_N
        self.assertEqual(force["force_N"], [code * scale - zero for code in codes])
        self.assertFalse(any(force["clipped"]))
        self.assertTrue(all(b > a for a, b in zip(force["t_ns"], force["t_ns"][1:])))
        tracker = rows(self.rec.tracker)
        for name in ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz", "status", "station"):
            self.assertEqual(tracker[name], stored["tracker"][name], name)
        # the surface is z = 0, and the tip is the sensor
        depth = rows(self.rec.depth)
        self.assertEqual(depth["depth_mm"], [-z for z in tracker["z_mm"]])
        self.assertEqual(depth["t_ns"], tracker["t_ns"])
        self.assertEqual(rows(self.rec.frames)["seq"], [])
        self.assertEqual([[kind] for kind in rows(self.rec.events)["kind"]], self.sql(
            self.rec.path, "SELECT kind FROM events ORDER BY t_ns, rowid"))

    def test_pairs_are_those_of_the_tool(self):
        """CSV has nine digits of a mean; 5e-9 of the value is half a unit of the last."""
        pairs = rows(self.rec.pairs(depth_bins=12, velocity_bins=10, by_cut=True))
        with open(os.path.join(self.shared, "pairs.csv")) as file:
            names, *lines = [line.strip().split(",") for line in file if not line.startswith("#")]
        self.assertEqual(list(pairs), names)
        self.assertEqual(pairs["cut"], [line[0] for line in lines])
        for i, name in enumerate(names[1:], 1):
            for value, line in zip(pairs[name], lines):
                self.assertLessEqual(abs(value - float(line[i])), 5e-9 * abs(value), name)

    def test_fields_and_metadata(self):
        fields = {field.name: field for field in self.rec.force.fields}
        self.assertEqual(fields["force_N"].unit, "N")
        self.assertEqual(fields["force_N"].metadata["force_mV_N"], "1240")
        self.assertEqual(fields["t_ns"].unit, "ns")
        metadata = self.rec.pairs().metadata
        self.assertEqual(metadata["source"], self.rec.path)
        self.assertEqual(metadata["options"], "raw, every force sample")

    def test_another_calibration(self):
        path = self.path("calibration.conf")
        with open(path, "w") as file:
            file.write("force_mV_N = 2480.0;\n")
        half = incise.open(self.rec.path, calibration=path)
        a, b = rows(self.rec.force)["force_N"], rows(half.force)["force_N"]
        self.assertTrue(all(abs(x - 2 * y) < 1e-12 for x, y in zip(a, b)))
        self.says(incise.Invalid, "syntax error", incise.open, self.rec.path, calibration=__file__)

    def test_a_table_is_read_again_and_again(self):
        table = self.rec.depth
        first = rows(table)
        self.assertEqual(rows(table), first)
        a, b = table.batches(), table.batches()  # by turns, too
        self.assertEqual(next(a).column("seq").tolist(), next(b).column("seq").tolist())
        views = [batch.column("depth_mm") for batch in table.batches()]
        gc.collect()  # views keep their batches
        self.assertEqual(sum((view.tolist() for view in views), []), first["depth_mm"])

    def test_closed(self):
        table = self.rec.depth
        n = len(rows(table)["seq"])
        self.rec.close()
        self.rec.close()
        self.says(incise.Invalid, "is closed; open it again", lambda: self.rec.force)
        self.says(incise.Invalid, "is closed; open it again", lambda: self.rec.info)
        self.assertEqual(len(rows(table)["seq"]), n)  # by a connection of its own
        with incise.open(self.rec.path) as rec:
            pass
        self.says(incise.Invalid, "is closed", lambda: rec.info)

    def test_moved_and_foreign_files(self):
        self.says(incise.NotFound, "no such recording", incise.open, self.path("none.rec"))
        self.says(FileNotFoundError, "no such recording", incise.open, self.path("none.rec"))
        self.says(incise.Error, "recording", incise.open, self.folder)
        self.says(incise.Error, "", incise.open, __file__)
        self.says(ValueError, "NUL", incise.open, "a\0b")
        self.assertRaises(TypeError, incise.open, 5)
        path = self.copy()
        table = incise.open(path).force
        os.rename(path, self.path("moved.rec"))
        self.says(incise.NotFound, "no such recording", rows, table)
        with open(self.path("text.rec"), "w") as file:
            file.write("no recording\n")
        self.says(incise.Error, "", incise.open, self.path("text.rec"))

    def test_damaged(self):
        path = self.copy()
        self.sql(path, "UPDATE force SET code = code + 1 WHERE seq = 5000")
        self.says(incise.Invalid, "is not what was recorded", rows, incise.open(path).force)
        self.assertEqual(len(rows(incise.open(path, damaged=True).force)["seq"]),
                         len(rows(self.rec.force)["seq"]))
        report = incise.verify(path)
        self.assertFalse(report.intact)
        self.assertEqual(report.findings[0].kind, "altered")
        self.sql(path, "UPDATE force SET t_ns = -1 WHERE seq = 70500")
        table = incise.open(path, damaged=True).force
        self.says(incise.Invalid, "table force, row 70500: ", rows, table)
        with open(os.path.join(path, "recording.db"), "r+b") as file:
            file.truncate(100000)
        self.says(incise.Error, "damaged", lambda: rows(incise.open(path, damaged=True).force))

    def test_verify(self):
        report = incise.verify(self.rec.path)
        self.assertTrue(report.complete and report.intact)
        self.assertEqual(report.findings, ())
        self.assertEqual(report.streams[0].present, self.rec.info.force)
        self.assertEqual(report.seals[0][1:], (False, 0, ()))
        self.says(incise.NotFound, "no such recording", incise.verify, self.path("none.rec"))

    def test_verify_signers(self):
        path, key, signers = self.copy(), self.path("kim"), self.path("signers")
        run("ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", key)
        run("incise", "sign", path, "--key", key)
        with open(key + ".pub") as public, open(signers, "w") as file:
            file.write("kim@lab " + public.read())
        seal, = incise.verify(path, signers=signers).seals
        self.assertTrue(seal.vouched)
        self.assertEqual([(one.verdict, one.by) for one in seal.vouchers], [("good", "kim@lab")])
        seal, = incise.verify(path, signers=signers, revoked=key + ".pub").seals
        self.assertFalse(seal.vouched)
        self.assertIn("revoked", seal.vouchers[0].why)
        self.assertEqual(incise.verify(path).seals[0].vouchers[0].verdict, "unchecked")
        self.says(incise.Error, "none: ", incise.verify, path, signers=self.path("none"))
        # rows and ledger that agree with each other, and not with the seal
        self.sql(path, "UPDATE seal SET t_ns = t_ns + 1 WHERE number = 1")
        report = incise.verify(path, signers=signers)
        self.assertEqual(report.findings[0].kind, "seal")
        self.assertFalse(report.seals[0].vouched)

    def test_wrong_arguments(self):
        self.says(incise.Invalid, "expected 1 to 1000 each", rows, self.rec.pairs(12))
        self.says(incise.Invalid, "depth_bins", self.rec.pairs, "many")
        self.says(incise.Invalid, "rate", rows, self.rec.resample(rate_hz=-1))
        self.says(KeyError, "no column 'x'", next(self.rec.force.batches()).column, "x")
        self.says(incise.Invalid, "is text", next(self.rec.events.batches()).column, "text")

    def test_no_copies_of_what_is_open(self):
        import copy
        import pickle

        for thing in (self.rec, next(self.rec.force.batches()), incise.Plan("wall")):
            for call in (copy.copy, copy.deepcopy, pickle.dumps):
                self.assertRaises(TypeError, call, thing)

    def test_threads(self):
        wanted, found = rows(self.rec.depth), []

        def read():
            found.append(rows(self.rec.depth) == wanted and self.rec.info.cuts == 14)

        threads = [threading.Thread(target=read) for _ in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(found, [True] * 8)

    def test_fork(self):
        """A child may not use what its parent has opened, and nothing hangs or crashes."""
        batches = self.rec.resample().batches()
        next(batches)
        pid = os.fork()
        if pid == 0:
            status = 1
            try:
                with self.assertRaises(incise.Invalid) as failure:
                    next(batches)
                assert "before a fork" in str(failure.exception)
                with self.assertRaises(incise.Invalid):
                    self.rec.info
                with incise.open(self.rec.path) as again:
                    assert len(rows(again.depth)["seq"]) > 0
                status = 0
            finally:
                os._exit(status)
        self.assertEqual(os.waitpid(pid, 0)[1], 0)
        self.assertGreater(sum(len(batch) for batch in batches), 0)

    def test_unreleased_streams_are_released(self):
        """Open files of a hundred streams that nobody has read to the end: none is left."""
        count = lambda: len(os.listdir("/proc/self/fd"))
        next(self.rec.pairs().batches())
        gc.collect()
        before = count()
        for _ in range(100):
            self.rec.pairs().__arrow_c_stream__()
            next(self.rec.force.batches())
        gc.collect()
        self.assertLessEqual(count(), before)

    @unittest.skipIf(SANITIZED, "a sanitizer keeps freed memory")
    def test_memory_is_bounded(self):
        """10 times the rows take no more: batches are 65536 rows, 25 bytes each, and SQLite's cache
        is 2 MB. 20 MB is ten times both."""
        path = self.path("long.rec")
        run("incise", "capture", "-o", path, "--rig", SHORT.replace("cut_s=2", "cut_s=5"))
        with incise.open(path) as rec:
            self.assertGreater(rec.info.force, 1.9 * self.rec.info.force)
            stored = rec.info.force
        script = (
            "import incise, sys\n"
            "def peak(): return [int(l.split()[1]) for l in open('/proc/self/status') "
            "if l.startswith('VmHWM')][0]\n"
            "rec = incise.open(sys.argv[1])\n"
            "next(rec.force.batches())\n"
            "before = peak()\n"
            "n = sum(len(batch) for _ in range(5) for batch in rec.force.batches())\n"
            "print(n, peak() - before)\n"
        )
        out = subprocess.run(
            [sys.executable, "-c", script, path], check=True, capture_output=True, text=True
        ).stdout
        n, grown = map(int, out.split())
        self.assertEqual(n, 5 * stored)
        self.assertLess(grown, 20000)

    def test_a_recording_that_is_being_written(self):
        """Up to its last commit: commits come every 100 ms, and the reader waits for one."""
        environment = {**os.environ}
        environment["PATH"] = os.path.join(
            os.environ.get("INCISE_BUILD", os.path.join(SOURCE, "build")), "bin"
        ) + ":" + os.environ["PATH"]
        environment.pop("LD_PRELOAD", None)
        capture = subprocess.Popen(
            ["incise", "capture", "-o", self.path("live.rec"), "--rig", "sim:"],
            env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        try:
            n = 0
            while n < 5000:  # half a second of samples
                self.assertIsNone(capture.poll())
                try:
                    with incise.open(self.path("live.rec")) as rec:
                        self.assertFalse(rec.info.complete)
                        force = rows(rec.force)
                        n = len(force["seq"])
                        self.assertEqual(force["seq"], list(range(n)))
                except incise.Error as failure:  # not there yet, or before its first commit
                    self.assertIn("live.rec", str(failure))
        finally:
            capture.terminate()
            capture.wait()
        with incise.open(self.path("live.rec")) as rec:
            self.assertTrue(rec.info.complete)

    @unittest.skipUnless(has("numpy"), "numpy is not installed")
    def test_frames(self):
        """By time, in any order; the simulated camera is 640 x 480 pixels over liver."""
        self.says(incise.Error, "camera.mkv", self.rec.frame, 0.5)
        path = self.path("seen.rec")
        run("incise", "capture", "-o", path, "--rig", SHORT, "--camera", "frames",
            "--duration", "2s")
        rec = incise.open(path)
        table = rows(rec.frames)
        start = rec.info.start_ns
        if not table["seq"]:
            self.skipTest("no module writes frames here")
        seen = {}
        for i in (5, 40, 41, 3, len(table["seq"]) - 1, 5):
            frame = rec.frame((table["t_ns"][i] - start) * 1e-9)
            self.assertEqual(frame.seq, table["seq"][i])
            self.assertEqual(frame.image.shape, (480, 640, 3))
            seen.setdefault(i, frame.image.tobytes())
            self.assertEqual(frame.image.tobytes(), seen[i])
        self.assertEqual(len(set(seen.values())), 5)
        self.assertEqual(rec.frame(-1e9).seq, table["seq"][0])
        self.assertEqual(rec.frame(1e9).seq, table["seq"][-1])
        rec.close()
        self.says(incise.Invalid, "is closed", rec.frame, 0)

    @unittest.skipUnless(has("numpy"), "numpy is not installed")
    def test_numpy(self):
        import numpy

        for name in STREAMS:
            table = getattr(self.rec, name)
            arrays, lists = table.numpy(), rows(table)
            self.assertEqual(list(arrays), list(lists))
            for column, values in lists.items():
                self.assertEqual(arrays[column].tolist(), values, (name, column))
        self.assertEqual(self.rec.frames.numpy()["quality"].dtype, numpy.float64)
        batch = next(self.rec.force.batches())
        array = batch.numpy()["force_N"]
        self.assertFalse(array.flags.owndata)  # no copy
        first = array[0]
        del batch
        gc.collect()
        self.assertEqual(array[0], first)

    @unittest.skipUnless(has("numpy"), "numpy is not installed")
    def test_values_of_an_export_as_hdf5(self):
        """Every column of every kind of table is the exported one, bit by bit."""
        if not has("h5py"):
            self.skipTest("h5py is not installed")
        import h5py
        import numpy

        kinds = (
            ([], self.rec.pairs()),
            (["--rate", "200"], self.rec.pairs(rate_hz=200)),
            (["--average", "12x10"], self.rec.pairs(12, 10)),
            (["--average", "12x10,by-cut"], self.rec.pairs(12, 10, by_cut=True)),
            (
                ["--rate", "200", "--uncertainty", "parts"],
                self.rec.pairs(rate_hz=200, uncertainty="parts"),
            ),
            (["--resample"], self.rec.resample()),
            (["--resample", "--rate", "500"], self.rec.resample(500)),
        )
        for i, (options, table) in enumerate(kinds):
            path = self.path(f"{i}.h5")
            run("incise", "export", self.rec.path, "-o", path, *options)
            arrays = table.numpy()
            with h5py.File(path) as file:
                names = [n for n in file if not n.endswith("_names")]
                self.assertEqual(sorted(arrays), sorted(names))
                for name in names:
                    stored = file[name][:]
                    if name + "_names" in file:
                        texts = [t.decode() for t in file[name + "_names"][:]]
                        self.assertEqual(arrays[name].tolist(), [texts[k - 1] for k in stored])
                    elif stored.dtype.kind == "f":
                        self.assertEqual(arrays[name].dtype, stored.dtype)
                        self.assertEqual(arrays[name].tobytes(), stored.tobytes(), name)
                    else:
                        self.assertTrue(numpy.array_equal(arrays[name], stored), name)

    def test_uncertainties_are_named(self):
        table = self.rec.pairs(rate_hz=20, uncertainty="parts")
        fields = {field.name: field for field in table.fields}
        names = fields["force_N"].metadata["uncertainty_variables"].split()
        self.assertEqual(names[:2], ["force_u_N", "force_u_gain_N"])
        for name in names:
            self.assertEqual(fields[name].metadata["uncertainty_of"], "force_N")
        self.assertEqual(fields["force_u_noise_N"].metadata["correlation"], "independent")
        self.assertIn("force_mV_N not stated", table.metadata["calibration_u"])
        self.assertNotIn("uncertainty_variables", self.rec.pairs(rate_hz=20).fields[4].metadata)
        self.says(incise.Invalid, "none, total or parts", self.rec.resample, 20, False, "all")

    @unittest.skipUnless(has("numpy", "pandas"), "pandas is not installed")
    def test_pandas(self):
        frame = self.rec.pairs(12, 10, by_cut=True).to_pandas()
        self.assertEqual(frame.columns[0], "cut")
        self.assertEqual(frame.attrs["units"]["force_N"], "N")
        self.assertEqual(frame.cut.nunique(), 14)
        lists = rows(self.rec.pairs(12, 10, by_cut=True))
        for name in frame.columns:
            self.assertEqual(frame[name].tolist(), lists[name])


class Blocks(Case):
    """Another reader of the format, read_blocks."""

    def setUp(self):
        super().setUp()
        self.rec = self.path("all.rec")
        run("incise", "capture", "-o", self.rec, "--rig", SHORT, "--duration", "5s", "--camera",
            "frames", "--clock-source", "sim:1.8e9,50,3", stderr=subprocess.DEVNULL)

    def change(self, sql, *values):
        """SQL on what is stored, without rows of samples."""
        with sqlite3.connect(os.path.join(self.rec, "recording.db")) as database:
            found = database.execute(sql, values).fetchall()
        database.close()
        return found

    def same(self):
        """Each column is what incise reads, bit by bit."""
        read = list(read_blocks.blocks(self.rec))
        for stream, (names, kinds) in read_blocks.COLUMNS.items():
            table = "frames" if stream == "camera" else stream
            quoted = [f"quote({name})" if kind in "rnh" else name
                      for name, kind in zip(names.split(), kinds)]
            expected = self.sql(self.rec, f"SELECT {', '.join(quoted)} FROM {table} ORDER BY seq")
            found = [row for s, _, columns in read if s == stream for row in zip(*columns.values())]
            self.assertEqual(len(found), len(expected))
            self.assertTrue(found or stream == "camera")  # without a module that writes frames
            for row, texts in zip(found, expected):
                for value, text, kind in zip(row, texts, kinds):
                    if kind in "rn":
                        real = math.nan if text == "NULL" else float(text)
                        self.assertEqual(struct.pack("<d", value), struct.pack("<d", real))
                    else:
                        wanted = f"X'{value.hex().upper()}'" if kind == "h" else str(value)
                        self.assertEqual(wanted, text)

    def test_all_columns(self):
        self.same()
        # and of each width, to the ends of what a column can hold
        self.sql(self.rec, """
            UPDATE force SET code = CASE seq % 3 WHEN 0 THEN -9223372036854775807 - 1
                WHEN 1 THEN 9223372036854775807 ELSE seq END WHERE seq BETWEEN 2000 AND 2999;
            UPDATE force SET code = seq * 1000003 WHERE seq BETWEEN 4000 AND 4999;
            UPDATE force SET code = 7 WHERE seq BETWEEN 6000 AND 6999;
            UPDATE tracker SET x_mm = seq / 4.0, y_mm = 1e300 / (seq + 1), z_mm = -0.1,
                qw = 5e-324, status = char(65 + seq % 7), arrival_ns = -arrival_ns;
            UPDATE wall SET tai_ns = -9223372036854775807 - 1, source = 'a' || seq,
                uncertainty_ns = CASE seq % 2 WHEN 0 THEN seq / 8.0 END""")
        for stream, block, data in self.change("SELECT stream, block, data FROM blocks"):
            self.change("UPDATE blocks SET sha256 = ? WHERE stream = ? AND block = ?",
                        hashlib.sha256(data).digest(), stream, block)
        self.same()

    def test_a_byte_that_changed(self):
        at = "WHERE stream = ? AND block = 1"
        for stream, in self.change("SELECT DISTINCT stream FROM blocks"):
            (data,), = self.change(f"SELECT data FROM blocks {at}", stream)
            flipped = bytearray(data)
            flipped[len(data) // 2] ^= 16
            self.change(f"UPDATE blocks SET data = ? {at}", bytes(flipped), stream)
            self.says(ValueError, f"{stream}, block 1 is not", list, read_blocks.blocks(self.rec))
            self.assertFalse(incise.verify(self.rec).intact)
            self.change(f"UPDATE blocks SET data = ? {at}", data, stream)
        self.assertTrue(incise.verify(self.rec).intact)


class Capture(Case):
    def test_records_what_the_command_records(self):
        path, other = self.path("python.rec"), self.path("command.rec")
        with incise.capture(SHORT, path, duration_s=3, cuts=True) as recording:
            self.assertTrue(incise.verify(path).complete)
            here = rows(recording.force), rows(recording.tracker)
        run("incise", "capture", "-o", other, "--rig", SHORT, "--duration", "3s", "--cuts")
        with incise.open(other) as recording:
            self.assertEqual(here, (rows(recording.force), rows(recording.tracker)))

    def test_a_trigger_starts_a_second_before(self):
        with incise.capture(SHORT, self.path("a.rec"), duration_s=1, trigger_force_N=0.2) as recording:
            info = recording.info
        self.assertLess(abs(info.end_ns - info.start_ns - 2e9), 5e7)

    def test_refusals(self):
        path = self.path("b.rec")
        self.says(incise.Error, "never triggered", incise.capture, SHORT, path, trigger_force_N=100)
        self.assertFalse(os.path.exists(path))
        self.says(incise.NotFound, "none.conf", incise.capture, "none.conf", path)
        self.says(incise.Invalid, "duration_s", incise.capture, SHORT, path, duration_s=-1)
        self.says(incise.Invalid, "clock source", incise.capture, SHORT, path, clock_source="moon")

    def test_interrupt_keeps_the_recording(self):
        path = self.path("c.rec")
        program = f"import incise; incise.capture('sim:', {path!r})"
        child = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.PIPE, text=True)
        n = 0
        while n < 1000:
            self.assertIsNone(child.poll())
            time.sleep(0.05)
            try:
                with incise.open(path) as recording:
                    n = recording.info.force
            except incise.Error:  # not there yet, or before its first commit
                pass
        child.send_signal(signal.SIGINT)
        self.assertIn("KeyboardInterrupt", child.communicate()[1])
        self.assertTrue(incise.verify(path).intact)


class WallTime(Case):
    def test_wall_time_and_columns(self):
        path = self.path("wall.rec")
        command = ["incise", "capture", "-o", path, "--rig", SHORT, "--duration", "5s"]
        run(*command, "--clock-source", "sim:1.8e9,50,3")
        with incise.open(path) as recording:
            wall = recording.wall
            table = recording.resample(rate_hz=10, tai=True)
            start_ns = recording.info.start_ns
        self.assertEqual(table.columns[-2:], ["tai_ns", "tai_u_ns"])
        self.assertEqual(table.metadata["wall_source"], "simulated, time of TAI")
        self.assertEqual([p.source for p in wall.points], ["simulated"] * 6)
        t_ns = 2_500_000_000
        tai_ns, bound_ns = wall.tai(t_ns)
        # 50 ppm of 2.5 s; a point is rounded to 1 ns
        self.assertLessEqual(abs(tai_ns - (1_800_000_000_000_000_000 + t_ns + 125_000)), 2)
        self.assertTrue(3000 <= bound_ns <= 3010)
        self.assertLessEqual(abs(wall.monotonic(tai_ns)[0] - t_ns), 2)
        self.assertTrue(wall.utc(t_ns).startswith("2027-01-15T07:59:25.500125"))
        self.says(incise.Invalid, "more than 60 s", wall.tai, 10**12)
        self.assertEqual(rows(table)["tai_ns"][0], wall.tai(start_ns)[0])
        with incise.open(os.path.join(self.shared, "short.rec")) as recording:
            self.assertIsNone(recording.wall)
            without = recording.resample(tai=True)
            self.says(incise.Invalid, "has no wall time", rows, without)


class Import(Case):
    def test_maps_no_library(self):
        """Importing loads no library of incise, nor numpy, pandas or scikit-learn."""
        script = (
            "import incise, sys\n"
            "maps = open('/proc/self/maps').read()\n"
            "print('libincise' in maps, [m for m in ('numpy', 'pandas', 'sklearn', 'sqlite3') "
            "if m in sys.modules])\n"
        )
        out = subprocess.run(
            [sys.executable, "-c", script], check=True, capture_output=True, text=True
        ).stdout
        self.assertEqual(out, "False []\n")

    def test_reading_maps_no_heavy_library(self):
        script = (
            "import incise, sys\n"
            "list(incise.open(sys.argv[1]).pairs().batches())\n"
            "maps = open('/proc/self/maps').read()\n"
            "print([m for m in ('lapack', 'opencv', 'hdf5', 'avformat', 'SDL2') if m in maps])\n"
        )
        out = subprocess.run(
            [sys.executable, "-c", script, os.path.join(self.shared, "short.rec")],
            check=True, capture_output=True, text=True,
        ).stdout
        self.assertEqual(out, "[]\n")

    def test_missing_libraries(self):
        out = subprocess.run(
            [sys.executable, "-c", "import incise; incise.load('a.fis')"],
            env={**os.environ, "INCISE_LIBDIR": self.folder}, capture_output=True, text=True,
        )
        self.assertEqual(out.returncode, 1)
        self.assertIn("libincise.so.2: cannot be loaded", out.stderr.splitlines()[-1])
        self.assertIn("mend INCISE_LIBDIR", out.stderr.splitlines()[-1])

    def test_names(self):
        for name in incise.__all__:
            self.assertTrue(hasattr(incise, name), name)
        self.assertRaises(AttributeError, lambda: incise.nothing)
        for name in incise.__all__:
            thing = getattr(incise, name)
            self.assertTrue(isinstance(thing, str) or thing.__doc__, name)
            for key, value in vars(thing).items() if isinstance(thing, type) else ():
                if not key.startswith("_") and (callable(value) or isinstance(value, property)):
                    self.assertTrue(value.__doc__, f"{name}.{key}")
        with open(os.path.join(SOURCE, "lib/include/incise/version.h")) as file:
            self.assertIn(f'#define INCISE_VERSION "{incise.__version__}"', file.read())


if __name__ == "__main__":
    unittest.main()
