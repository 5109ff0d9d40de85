# SPDX-License-Identifier: GPL-2.0-or-later
"""Models in Python: values against the tools', forms of inputs, training from any table, errors."""

import copy
import ctypes
import math
import os
import pickle
import random
import signal
import subprocess
import sys
import unittest
import warnings

import incise
from fixtures import SANITIZED, SOURCE, Case, has, run

OPTIONS = {"group": "cut", "check": 0.3}
QUICK = {"mf": (2, 2), "epochs": 5}
QUICK_TOOL = ("--mf", "2,2", "--epochs", "5")


class Models(Case):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.csv = os.path.join(cls.shared, "pairs.csv")
        cls.fis = os.path.join(cls.shared, "tool.fis")
        if not os.path.exists(cls.fis):
            run("incise", "train", cls.csv, "--group", "cut", "--check", "0.3", "-o", cls.fis)
        cls.model = incise.load(cls.fis)

    def test_values_are_those_of_the_tool(self):
        points = [(0, 0), (5, 20), (12.5, 3), (30, 100), (-1, 5)]
        text = "".join(f"{x} {y}\n" for x, y in points)
        for line, force, sd in zip(
            run("incise", "eval", self.fis, "--uncertainty", "total", input=text).splitlines(),
            *self.model(points, sd=True),
        ):
            told = [float(word) for word in line.split()]
            # ten and nine digits
            self.assertLessEqual(abs(told[0] - force), 5e-10 * abs(force) + 1e-15)
            # outside the data neither has a standard deviation
            self.assertEqual(math.isnan(told[1]), math.isnan(sd))
            self.assertFalse(abs(told[1] - sd) > 5e-9 * sd)

    def test_forms_of_inputs(self):
        one = self.model((5, 20))
        self.assertIsInstance(one, float)
        self.assertEqual(self.model([5, 20]), one)
        self.assertEqual(self.model([[5, 20], [6, 20]])[0], one)
        self.assertEqual(len(self.model([])) if self.model.inputs == () else 0, 0)
        self.assertEqual(self.model((5, 20), sd=True)[0], one)
        slope = (self.model((5.0001, 20)) - self.model((4.9999, 20))) / 2e-4
        # the second difference of a force over 2e-4 mm is below 1e-7 of it
        self.assertAlmostEqual(self.model.gradient((5, 20))[0], slope, delta=1e-6)
        self.assertEqual(self.model.gradient((500, 20))[0], 0)

    @unittest.skipUnless(has("numpy"), "numpy is not installed")
    def test_arrays(self):
        import numpy

        x = numpy.random.RandomState(1).rand(7, 3, 2) * (10, 30) + (2, 5)
        y = self.model(x)
        self.assertEqual(y.shape, (7, 3))
        self.assertEqual(y[4, 2], self.model(x[4, 2]))
        self.assertEqual(y[4, 2], self.model(tuple(x[4, 2].tolist())))
        self.assertEqual(self.model.gradient(x).shape, (7, 3, 2))
        self.assertEqual(self.model(x.astype("f4")).shape, (7, 3))
        self.assertEqual(self.model(x[::2, ::-1])[1, 0], y[2, 2])  # strides
        self.assertEqual(self.model(numpy.empty((0, 2))).shape, (0,))
        self.assertEqual(self.model(numpy.array([5.0, 20])), self.model((5, 20)))
        value, sd = self.model(x, sd=True)
        same, total, parts = self.model(x, sd=True, parts=True)
        self.assertTrue((same == value).all() and (total == sd).all())
        self.assertEqual(parts.shape, (7, 3, 5))
        self.assertLess(abs((parts[..., :4] ** 2).sum(-1) - sd**2).max(), 1e-12)
        one = self.model((5, 20), sd=True, parts=True)
        self.assertEqual(one[:2], self.model((5, 20), sd=True))
        self.assertAlmostEqual(sum(p * p for p in one[2][:4]), one[1] ** 2, places=12)
        self.says(incise.Invalid, "parts", self.model, (5, 20), parts=True)
        self.assertTrue((sd > 0).all() and (value == y).all())

    def test_wrong_inputs(self):
        for bad, said in (
            ((1, 2, 3), "the model has 2 inputs"),
            ([[1, 2], [3]], "inputs"),
            ("ab", "inputs of a model"),
            ([["a", 2]], "inputs of a model"),
            (None, "inputs"),
            ({"depth_mm": 5}, "inputs have no column velocity_mm_s; the columns are depth_mm"),
            ({"depth_mm": [5, 6], "velocity_mm_s": [20]}, "inputs of a model"),
        ):
            self.says(incise.Invalid, said, self.model, bad)
        if has("numpy"):
            import numpy

            self.says(incise.Invalid, "(4, 3)", self.model, numpy.zeros((4, 3)))
            self.says(incise.Invalid, "inputs", self.model, numpy.zeros(()))
            self.says(incise.Invalid, "inputs", self.model, numpy.array(["a", "b"]))
            self.says(incise.Invalid, "inputs", self.model, numpy.zeros((1, 2), complex) * 1j)

    def test_values_that_are_not_finite(self):
        """At any place of any form, with the point and the input in the message."""
        chance = random.Random(41)
        names = [variable.name for variable in self.model.inputs]
        for thing in (self.model, self.model.compile()):
            for bad in (math.nan, math.inf, -math.inf, None) * 5:
                n = chance.randrange(1, 9)
                point, at = chance.randrange(n), chance.randrange(2)
                rows = [[5.0, 20.0] for _ in range(n)]
                rows[point][at] = bad
                forms = [rows, tuple(map(tuple, rows)), rows[point]]
                forms.append({names[i]: [row[i] for row in rows] for i in (1, 0)})
                for form in forms:
                    said = "inputs of a model" if bad is None else f"({names[at]}): {bad} is not finite"
                    if bad is None and has("numpy"):
                        said = ""
                    self.says(incise.Invalid, said, thing, form)
                if not has("numpy"):
                    continue
                import numpy

                masked = numpy.ma.masked_array(numpy.full((n, 2), 5.0), mask=False)
                masked[point, at] = numpy.ma.masked
                said = f"column {at + 1} ({names[at]}): nan is not finite"
                said = f"point {point + 1} of {n}: {said}" if n > 1 else said
                self.says(incise.Invalid, said, thing, masked)
                self.says(incise.Invalid, said, thing, {k: masked[:, i] for i, k in enumerate(names)})
        self.says(incise.Invalid, "not finite", self.model.gradient, (math.nan, 20))
        self.says(incise.Invalid, "not finite", self.model, (5, math.nan), sd=True)

    def test_columns_by_name(self):
        """Any order of the columns, and others beside them, as of the ordered pairs."""
        rows = [(chance.uniform(1, 20), chance.uniform(5, 50)) for chance in [random.Random(5)] * 20]
        expected = list(self.model(rows))
        table = {"cut": ["a"] * 20, "velocity_mm_s": [v for _, v in rows], "depth_mm": [d for d, _ in rows]}
        self.assertEqual(list(self.model(table)), expected)
        self.assertEqual(list(self.model.compile()(table)), list(self.model.compile()(rows)))
        one = self.model({"velocity_mm_s": rows[3][1], "depth_mm": rows[3][0]})
        self.assertEqual(one, expected[3])
        forms = []
        if has("pandas"):
            import pandas

            forms += [pandas.DataFrame(table), pandas.DataFrame(table)[["velocity_mm_s", "depth_mm"]]]
            self.says(incise.Invalid, "no column depth_mm", self.model, forms[0][["velocity_mm_s"]])
            self.assertEqual(float(self.model(forms[0].iloc[3])), expected[3])
        if has("numpy"):
            import numpy

            forms.append(numpy.zeros(20, dtype=[("velocity_mm_s", "f8"), ("depth_mm", "f4")]))
            for name in ("velocity_mm_s", "depth_mm"):
                forms[-1][name] = table[name]
        if has("pyarrow"):
            import pyarrow

            forms.append(pyarrow.table(table))
        for form in forms:
            for value, wanted in zip(self.model(form), expected):
                self.assertAlmostEqual(float(value), wanted, places=5)

    def test_options_have_names(self):
        for call in (lambda: self.model(5, 20), lambda: self.model((5, 20), True)):
            self.assertRaises(TypeError, call)
        self.assertRaises(TypeError, self.model.compile, 0.1)

    def test_points_outside_are_counted(self):
        low, high = self.model.inputs[0].min, self.model.inputs[0].max
        for thing in (self.model, self.model.compile()):
            with self.assertWarnsRegex(UserWarning, "^2 of 4 points are outside .*depth_mm"):
                values = thing([(low - 1, 20), (5, 20), (high + 500, 20), (7, 20)])
            self.assertEqual(values[1], thing((5, 20)))
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                thing([(5, 20), (7, 20)])
        with self.assertWarns(UserWarning):
            sd = self.model([(low - 1, 20), (5, 20)], sd=True)[1]
        self.assertTrue(math.isnan(sd[0]))
        self.assertEqual(sd[1], self.model((5, 20), sd=True)[1])

    def test_files(self):
        self.model.save(self.path("a.fis"))
        again = incise.load(self.path("a.fis"))
        self.assertEqual(again((5, 20), sd=True), self.model((5, 20), sd=True))
        os.remove(self.path("a.fis.sd"))
        bare = incise.load(self.path("a.fis"))
        self.assertTrue(math.isnan(bare.noise))
        self.says(incise.Invalid, "no standard deviation", bare, (5, 20), sd=True)
        self.says(incise.NotFound, "none.fis", incise.load, self.path("none.fis"))
        self.says(incise.Error, "", incise.load, self.csv)
        self.says(incise.Error, "", self.model.save, self.path("no/folder/a.fis"))
        self.assertEqual([v.name for v in self.model.inputs], ["depth_mm", "velocity_mm_s"])
        self.assertEqual(self.model.output.name, "force_N")

    def test_compiled(self):
        run("incise", "compile", self.fis, "--budget", "0.1mN", "-o", self.path("tool.fx"))
        compiled = self.model.compile(budget_mN=0.1)
        compiled.save(self.path("a.fx"))
        with open(self.path("a.fx"), "rb") as a, open(self.path("tool.fx"), "rb") as b:
            self.assertEqual(a.read(), b.read())
        self.assertLessEqual(compiled.bound, 1e-4)
        self.assertEqual(incise.load(self.path("a.fx"))((5, 20)), compiled((5, 20)))
        for k in range(200):
            x = (k % 20, k / 5)
            self.assertLessEqual(abs(compiled(x) - self.model(x)), compiled.bound)
        self.says(incise.Invalid, "allow more", self.model.compile, budget_mN=1e-9)

    def test_copies(self):
        """Copies and pickles give the same numbers, and each is freed once."""
        for thing in (self.model, self.model.compile()):
            for again in (
                copy.copy(thing),
                copy.deepcopy(thing),
                pickle.loads(pickle.dumps(thing)),
            ):
                self.assertEqual(again((5, 20)), thing((5, 20)))
                del again

    def test_training_is_that_of_the_tool(self):
        model = incise.train(self.csv, **OPTIONS)
        model.save(self.path("a.fis"))
        for end in ("", ".sd"):
            with open(self.path("a.fis") + end) as a, open(self.fis + end) as b:
                # the tool also notes its sources
                self.assertEqual(a.readlines(), [x for x in b if not x.startswith("%")])
        self.assertLess(model.report.check_rms_error, model.report.baselines["linear"])

    def test_training_from_any_table(self):
        """Pairs of a recording have all digits; from all forms the model is the same."""
        rec = incise.open(os.path.join(self.shared, "short.rec"))
        table = rec.pairs(depth_bins=12, velocity_bins=10, by_cut=True)
        wanted = incise.train(rec, **OPTIONS, **QUICK)((5, 20))
        columns = {field.name: [] for field in table.fields}
        for batch in table.batches():
            for field in batch.fields:
                columns[field.name] += (
                    batch.texts(field.name)
                    if field.format == "u"
                    else batch.flags(field.name)
                    if field.format == "b"
                    else batch.column(field.name).tolist()
                )
        forms = [table, columns, rec.path]
        if has("numpy"):
            forms.append(table.numpy())
        if has("numpy", "pandas"):
            forms.append(table.to_pandas())
        for form in forms:
            self.assertEqual(incise.train(form, **OPTIONS, **QUICK)((5, 20)), wanted, type(form))

    def test_wrong_training(self):
        good = {"depth_mm": [1.0, 2], "velocity_mm_s": [1, 2], "force_N": [1, 2]}
        for data, said in (
            (5, "is no table"),
            ([1, 2], "is no table"),
            ({}, "columns"),
            ({"depth_mm": [1.0]}, "no column 'velocity_mm_s'"),
            ({**good, "force_N": [1]}, "different lengths"),
            ({**good, "force_N": ["a", "b"]}, "is not a column of numbers"),
            ({**good, "force_N": [1, math.nan]}, "row 1, column force_N: is not finite"),
            (good, "2 training pairs"),
            (self.path("none.csv"), "none.csv"),
            (self.path("none.rec"), "no such recording"),
        ):
            self.says(incise.Error, said, incise.train, data)
        for options, said in (
            ({"group": "hand"}, "no column 'hand'"),
            ({"check": 2}, "a share"),
            ({"mf": (0, 3)}, "a count from 1 to 32"),
            ({"mf": "many"}, "'auto'"),
            ({"mf_type": "trimf"}, "gaussmf or gbellmf"),
            ({"epochs": 0}, "at least 1 epoch"),
            ({"inputs": ("depth_mm",), "mf": (3, 3)}, "a count"),
        ):
            self.says(incise.Invalid, said, incise.train, self.csv, **options)

    def same_files(self, model, wanted):
        model.save(self.path("list.fis"), overwrite=True)
        for end in ("", ".sd"):
            with open(self.path("list.fis") + end) as a, open(wanted + end) as b:
                self.assertEqual(a.read(), b.read())

    def test_training_from_many_sources_is_that_of_the_tool(self):
        """Two CSV files and a recording; then recordings alone, which have groups by default."""
        rec = os.path.join(self.shared, "short.rec")
        with open(self.csv) as file:
            head, *rows = [line for line in file if not line.startswith("#")]
        for name, part in (("a.csv", rows[::2]), ("b.csv", rows[1::2])):
            with open(self.path(name), "w") as file:
                file.writelines([head, *part])
        paths = [self.path("a.csv"), rec, self.path("b.csv")]
        wanted = self.path("tool.fis")
        grouped = ("--group", "cut", "--check", "0.3")
        run("incise", "train", *paths, *grouped, *QUICK_TOOL, "-o", wanted)
        with incise.open(rec) as opened:
            model = incise.train((paths[2], opened, paths[0]), **OPTIONS, **QUICK)
        self.same_files(model, wanted)
        self.same_files(pickle.loads(pickle.dumps(model)), wanted)
        self.assertGreater(model.report.pairs, 20000)
        self.assertGreater(model.report.left_out, 0)
        self.assertLess(model.report.check_rms_error, model.report.baselines["mean"])
        for options, arguments in (
            ({}, ()),
            ({"group": "rig", "all_rows": True}, ("--group", "rig", "--all-rows")),
        ):
            run("incise", "train", rec, *arguments, *QUICK_TOOL, "--overwrite", "-o", wanted)
            self.same_files(incise.train([rec], **options, **QUICK), wanted)

    def test_training_from_tables_that_are_read_twice(self):
        rec = incise.open(os.path.join(self.shared, "short.rec"))
        table = rec.pairs(depth_bins=12, velocity_bins=10, by_cut=True)
        calls = []

        def anew():
            calls.append(1)
            return table

        sources = [("bins", anew), ("all", rec.pairs(rate_hz=100))]
        model = incise.train(sources, **OPTIONS, **QUICK)
        self.assertEqual(len(calls), 2)
        again = incise.train(sources[::-1], **OPTIONS, **QUICK)
        self.assertEqual(again((5, 20)), model((5, 20)))
        model.save(self.path("a.fis"))
        self.assertIn("bins\n", run("incise", "info", self.path("a.fis")))
        # pairs that are not sampled, in one source: the grid and its consequents are those of a table
        few = {"group": "cut", "epochs": 5}
        one = incise.train([table], **few)
        self.assertAlmostEqual(one((5, 20)), incise.train(table, **few)((5, 20)), places=9)

    def test_wrong_sources(self):
        good = {"depth_mm": [1.0, 2], "velocity_mm_s": [1, 2], "force_N": [1, 2]}
        passes = []

        def fails():
            passes.append(1)
            if len(passes) > 1:
                raise RuntimeError("no second pass")
            return incise.open(os.path.join(self.shared, "short.rec")).pairs(rate_hz=50)

        def shrinks():
            passes.append(1)
            return incise.open(os.path.join(self.shared, "short.rec")).pairs(
                rate_hz=50 * len(passes)
            )

        self.says(RuntimeError, "no second pass", incise.train, [fails], **QUICK)
        self.assertEqual(len(passes), 2)
        passes.clear()
        self.says(incise.Error, "source 1: has changed", incise.train, [shrinks], **QUICK)
        os.mkfifo(self.path("pipe"))
        for data, said in (
            ([], "no rows"),
            ([self.csv, good, lambda: 5], "a int is no table"),
            ([("a", good), ("a", good)], "name 'a': is given twice"),
            ([("", good)], "a name of one line"),
            ([("a\nb", good)], "a name of one line"),
            ([("a", self.csv)], "leave the name out"),
            ([self.csv, self.csv], "has the same content"),
            ([self.path("none.csv")], "none.csv"),
            ([self.path("none.rec")], "no such recording"),
            ([self.path("pipe")], "is no file"),
            ([("a", {**good, "force_N": [1, math.nan]})], "a: Arrow stream, row 1, column force_N"),
            ([{"depth_mm": [1.0]}], "source 1: Arrow stream: no column 'velocity_mm_s'"),
        ):
            self.says(incise.Error, said, incise.train, data)
        self.says(incise.Invalid, "classic", incise.train, [self.csv], classic=True)

    def interrupt(self, script, wanted):
        # A shell starts what it puts in the background with SIGINT ignored.
        process = subprocess.Popen(
            [sys.executable, "-c", script],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        self.assertEqual(process.stdout.readline(), "ready\n")
        process.send_signal(signal.SIGINT)
        # Its standard input ends once the signal is sent.
        out, _ = process.communicate(timeout=300)
        self.assertEqual((out, process.returncode), (wanted, 0))

    def test_ctrl_c_ends_the_reading_of_a_source(self):
        """A table without end; the signal comes when its rows are being read."""
        script = (
            "import incise, sys\n"
            "from incise import _producer\n"
            "class Endless(_producer.ColumnStream):\n"
            "    def _get_next(self, stream, out):\n"
            "        print('ready', flush=True) if not self._given else None\n"
            "        super()._get_next(stream, out)\n"
            "        return 0 if out.contents.length else self.again(stream, out)\n"
            "    def again(self, stream, out):\n"
            "        self._given = False\n"
            "        super()._get_next(stream, out)\n"
            "        self._given = True\n"
            "        return 0\n"
            "_producer.ColumnStream = Endless\n"
            "data = {'depth_mm': [1.0, 2], 'velocity_mm_s': [1, 2], 'force_N': [1, 2]}\n"
            "try:\n"
            "    incise.train([data])\n"
            "except KeyboardInterrupt:\n"
            "    print('stopped')\n"
        )
        self.interrupt(script, "stopped\n")

    def test_ctrl_c_waits_for_what_is_in_use(self):
        """A source that cannot be stopped is at its end before anything is freed; two signals, of which
        the first comes as soon as it is read, and so before anybody waits for it."""
        script = (
            "import incise, signal, sys, threading\n"
            "ended = []\n"
            "reading = threading.Event()\n"
            "start = threading.Thread.start\n"
            "def start_and_signal(thread):\n"
            "    start(thread)\n"
            "    reading.wait()\n"
            "    signal.raise_signal(signal.SIGINT)\n"
            "threading.Thread.start = start_and_signal\n"
            "def slow():\n"
            "    reading.set()\n"
            "    print('ready', flush=True)\n"
            "    sys.stdin.read()\n"
            "    ended.append(1)\n"
            "try:\n"
            "    incise.train([slow])\n"
            "except KeyboardInterrupt:\n"
            "    print('stopped', len(ended))\n"
        )
        self.interrupt(script, "stopped 1\n")

    def test_ctrl_c_ends_a_training(self):
        """A training of minutes ends by KeyboardInterrupt, and leaves nothing behind."""
        script = (
            "import incise, math, sys\n"
            "n = 40000\n"
            "data = {'a': [i * 37 % 101 for i in range(n)], 'b': [i * 53 % 97 for i in range(n)],\n"
            "        'c': [i * 71 % 89 for i in range(n)],\n"
            "        'y': [math.sin(i) for i in range(n)]}\n"
            "training = sys.modules['incise._model']._Training\n"
            "run = training.run\n"
            "def tell_and_run(*arguments):\n"
            "    print('ready', flush=True)\n"
            "    return run(*arguments)\n"
            "training.run = tell_and_run\n"
            "try:\n"
            "    incise.train(data, inputs=('a', 'b', 'c'), target='y', mf=(6, 6, 6), epochs=1000, classic=True)\n"
            "except KeyboardInterrupt:\n"
            "    print('stopped')\n"
        )
        self.interrupt(script, "stopped\n")

    @unittest.skipIf(SANITIZED, "a sanitizer keeps freed memory")
    def test_nothing_leaks(self):
        """Five hundred models of 100 KB or more each would be 50 MB; 10 MB is noise."""

        def resident():
            with open("/proc/self/statm") as file:
                return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

        def use():
            model = incise.load(self.fis)
            model([(5, 20)] * 100, sd=True)
            pickle.dumps(compiled)

        compiled = self.model.compile()
        for _ in range(20):
            use()
        before = resident()
        for _ in range(500):
            use()
        self.assertLess(resident() - before, 10e6)


@unittest.skipUnless(has("sklearn"), "scikit-learn is not installed")
class Estimator(Case):
    def test_cross_validation_by_cut(self):
        import numpy
        from sklearn.model_selection import GroupKFold, cross_val_score

        rec = incise.open(os.path.join(self.shared, "short.rec"))
        pairs = rec.pairs(12, 10, by_cut=True).numpy()
        use = pairs["advancing"]
        x = numpy.column_stack((pairs["depth_mm"], pairs["velocity_mm_s"]))[use]
        scores = cross_val_score(
            incise.ForceRegressor(mf=(3, 2)),
            x,
            pairs["force_N"][use],
            groups=pairs["cut"][use],
            cv=GroupKFold(3),
        )
        self.assertGreater(scores.min(), 0.9)

    def test_its_protocol(self):
        """scikit-learn's own checks. Those that need ten features cannot pass: a model has eight
        inputs at most. They are named, and they fail for that reason."""
        import warnings

        from sklearn.utils import estimator_checks

        passed, refused = set(), {}
        make = getattr(estimator_checks, "estimator_checks_generator", None)
        estimator = incise.ForceRegressor()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            checks = (
                make(estimator)
                if make
                else estimator_checks.check_estimator(estimator, generate_only=True)
            )
            for tried, check in checks:
                name = getattr(check, "func", check).__name__
                try:
                    check(tried)
                    passed.add(name)
                except unittest.SkipTest:
                    pass
                except Exception as failure:
                    refused[name] = str(failure)
        self.assertGreater(len(passed), 25)
        for name, why in refused.items():
            self.assertIn("at most 8 inputs", why, name)
        self.assertLessEqual(
            set(refused),
            {
                "check_dtype_object",
                "check_regressors_train",
                "check_regressor_data_not_an_array",
                "check_regressors_int",
                "check_estimators_dtypes",
                "check_supervised_y_2d",
                "check_regressors_no_decision_function",
                "check_all_zero_sample_weights_error",
                "check_sample_weight_equivalence_on_dense_data",
            },
        )


if __name__ == "__main__":
    unittest.main()
