# SPDX-License-Identifier: GPL-2.0-or-later
"""Other libraries read the streams in place: pyarrow, polars, DuckDB, pandas 3, by the Arrow PyCapsule
interface; and training reads theirs. Runs in tests/python/venv, which has them."""

import os
import unittest

import duckdb
import numpy
import pandas
import polars
import pyarrow
import pyarrow.parquet

import incise
from fixtures import Case

STREAMS = ("force", "tracker", "depth", "frames", "events")


class Foreign(Case):
    def setUp(self):
        super().setUp()
        self.rec = incise.open(os.path.join(self.shared, "short.rec"))
        self.tables = {name: getattr(self.rec, name) for name in STREAMS}
        self.tables["pairs"] = self.rec.pairs()
        self.tables["bins"] = self.rec.pairs(12, 10, by_cut=True)
        self.tables["resampled"] = self.rec.resample()

    def same(self, arrays, wanted, what):
        """Bit by bit, in all columns."""
        self.assertEqual(list(arrays), list(wanted), what)
        for name, values in wanted.items():
            found = numpy.asarray(arrays[name])
            if values.dtype == object:
                self.assertEqual(found.tolist(), values.tolist(), (what, name))
            else:
                self.assertEqual(found.astype(values.dtype).tobytes(), values.tobytes(), (what, name))

    def test_pyarrow_and_parquet(self):
        for name, table in self.tables.items():
            read = pyarrow.table(table)
            read.validate(full=True)
            self.same({c: read[c].to_numpy() for c in read.column_names}, table.numpy(), name)
            self.assertEqual(read.schema.field(0).metadata[b"unit"] != b"", True)
            path = self.path(name + ".parquet")
            table.parquet(path)
            again = pyarrow.parquet.read_table(path)
            self.assertEqual(again.schema.types, read.schema.types)
            self.same({c: again[c].to_numpy() for c in again.column_names}, table.numpy(), name)
            self.assertTrue(again.schema.equals(read.schema, check_metadata=True), name)
        none = self.rec.pairs().between(0.001, 0.002)
        self.says(Exception, "no cut", none.parquet, self.path("none.parquet"))
        self.assertNotIn("none.parquet", " ".join(os.listdir(self.folder)))

    def test_polars(self):
        for name, table in self.tables.items():
            read = polars.DataFrame(table)
            self.same({c: read[c].to_numpy() for c in read.columns}, table.numpy(), name)

    def test_duckdb(self):
        for name, table in self.tables.items():
            stream = table  # found by its name in the query; "table" is a word of SQL
            for _ in range(2):  # its own streams are used up by the first query
                read = duckdb.sql("SELECT * FROM stream").fetchnumpy()
                self.same(
                    {c: numpy.ma.filled(v.astype("f8"), numpy.nan) if numpy.ma.is_masked(v) else
                     numpy.asarray(v) for c, v in read.items()},
                    table.numpy(), name,
                )

    def test_pandas_3(self):
        self.assertGreaterEqual(int(pandas.__version__.split(".")[0]), 3)
        for name, table in self.tables.items():
            read = pandas.DataFrame.from_arrow(table)
            self.same({c: read[c].to_numpy() for c in read.columns}, table.numpy(), name)

    def test_training_from_their_tables(self):
        stream = table = self.tables["bins"]
        self.assertIs(stream, table)
        options = {"group": "cut", "check": 0.3, "mf": (2, 2), "epochs": 5}
        wanted = incise.train(table, **options)((5, 20))
        for other in (
            pyarrow.table(table),
            polars.DataFrame(table),
            pandas.DataFrame.from_arrow(table),
            duckdb.sql("SELECT * FROM stream").arrow(),
            pyarrow.table(table).set_column(
                0, "cut", pyarrow.table(table)["cut"].dictionary_encode()
            ),
            pyarrow.table(table).slice(3).combine_chunks(),
        ):
            sliced = getattr(other, "num_rows", None) == len(pyarrow.table(table)) - 3
            model = incise.train(other, **options)
            if not sliced:
                self.assertEqual(model((5, 20)), wanted, type(other))

    def test_training_from_a_parquet_file_in_batches(self):
        """The docstring's way; the same pairs by any producer that has the same name."""
        import pyarrow.parquet

        table = self.tables["bins"]
        table.parquet(self.path("bins.parquet"))

        def read():
            file = pyarrow.parquet.ParquetFile(self.path("bins.parquet"))
            return pyarrow.RecordBatchReader.from_batches(
                file.schema_arrow, file.iter_batches(batch_size=100)
            )

        def fails(batches=iter(((), (1,)))):
            reader = read()
            part = next(batches)  # none left in the first pass, a wrong one in the second

            def all_batches():
                yield from reader
                for _ in part:
                    raise RuntimeError("disk on fire")

            return pyarrow.RecordBatchReader.from_batches(reader.schema, all_batches())

        options = {"group": "cut", "check": 0.3, "mf": (2, 2)}
        wanted = incise.train([("bins", table)], **options)((5, 20))
        for other in (read, pyarrow.table(table), polars.DataFrame(table)):
            model = incise.train([("bins", other)], **options)
            self.assertEqual(model((5, 20)), wanted)
        self.says(incise.Error, "bins: Arrow stream", incise.train, [("bins", fails)], mf=(2, 2))
        with self.assertRaises(Exception):  # a reader is used up by the first pass
            incise.train([read()], mf=(2, 2))

    def test_a_consumer_that_stops_early(self):
        for table in self.tables.values():
            reader = pyarrow.RecordBatchReader.from_stream(table)
            if table is not self.tables["frames"]:  # has no rows
                reader.read_next_batch()
            del reader

    def test_damage_is_their_exception(self):
        path = self.copy()
        self.sql(path, "UPDATE force SET t_ns = -1 WHERE seq = 70000")
        table = incise.open(path, damaged=True).force
        with self.assertRaises(Exception) as caught:
            pyarrow.table(table)
        self.assertIn("stream force, block 70: ", str(caught.exception))
        with self.assertRaises(incise.Invalid):
            pyarrow.table(incise.open(path).force)


if __name__ == "__main__":
    unittest.main()
