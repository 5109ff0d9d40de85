# SPDX-License-Identifier: GPL-2.0-or-later
"""Lines that researchers type: each works, or raises one line that says what to do."""

import contextlib
import os
import re
import warnings

import incise
from fixtures import Case, has

# A line of Python, then -> and a part of the result's repr(), or !! and a part of the exception's line.
# Both end at two blanks, behind which may be a comment.
TYPED = """
rec                                                 -> short.rec: 14 cuts in 43.000 s
rec._repr_html_()                                   -> <td>force</td>
rec.force                                           -> <incise.Table force of
len(rec.force)                                      -> 430000
rec.force["force_N"].shape                          -> (430000,)
rec.force[10:20]["force_N"].shape                   -> (10,)
rec.force[::1000]["seq"][:3]                        -> 1000, 2000
rec.force[-3:]["seq"]                               -> 429997, 429998, 429999
rec.force[[ "t_ns", "force_N"]]                     -> 430000 rows of t_ns, force_N
rec.force[7]["seq"]                                 -> 7
rec.force[-1]["seq"]                                -> 429999
rec.force[500000]                                   !! row 500000: there are 430000 rows
rec.force["force"]                                  !! no column 'force'; the columns are: seq, t_ns,
rec.force[None]                                     !! a table takes a column's name
rec.force[::-1]                                     !! give a step above 0
list(rec.force)                                     -> ['seq', 't_ns', 'code', 'force_N', 'clipped']
"force_N" in rec.force                              -> True
rec.force.units()["force_N"]                        -> 'N'
rec.force.between(10, 20)                           -> short.rec, 10 s to 20 s: seq
len(rec.force.between(10, 20))                      -> 100000
len(rec.force.between(42))                          -> 10000
len(rec.tracker.between(1000, 2000))                -> 0
rec.force.between(20, 10)                           !! between(20, 10): expected seconds
rec.force.between("a")                              !! between('a', None): expected seconds
rec.force.between(nan)                              !! between(nan, None): expected seconds
set(rec.pairs().cut(3)["cut"]) == set([name(3)])    -> True
len(rec.force.cut(3)) == len(rec.pairs().cut(3))    -> True
len(rec.cut(3).force) == len(rec.force.cut(3))      -> True
rec.cut(3).resample(rate_hz=100)["cut"].min()       -> 3
rec.between(1, 2).depth                             -> depth of
rec.between(1, 2).cut(3).pairs().between(0)._about  -> 1 s to 2 s, cut 3
rec.between(5, 10).cut(1)                           -> short.rec, 5 s to 10 s, cut 1; the whole: 14 cuts
rec.cut(3).between(8)._repr_html_()                 -> short.rec, cut 3, 8 s to its end; the whole: 14 cuts
rec.cut(3).between(0, 5).force["seq"]               !! the end is not behind the beginning
len(rec.cut(3).between(8).force) == len(rec.force.cut(3).between(8))  -> True
len(rec.between(8).cut(3).force) == len(rec.force.cut(3).between(8))  -> True
rec.cut(0)                                          !! cut 0: cuts have numbers from 1
rec.force.cut(99)                                   !! has no cut 99, but 14
rec.pairs().cut(99)["cut"]                          !! has no cut 99, but 14
rec.force.to_pandas().index.name                    -> 't'
rec.force.between(1, 2).to_pandas().index[0]        -> 0 days 00:00:01
rec.pairs(12, 10).to_pandas().attrs["units"]        -> 'force_N': 'N'
rec.force.cut(3).to_pandas().resample("10ms").mean().shape  -> , 5)
rec.force.between(1, 2).xarray().force_N.units      -> 'N'
rec.tracker.xarray().sizes                          -> 't': 5160
rec.plot()                                          -> Axes
rec.force.plot()                                    -> Axes
rec.force.plot("code", ax=axis())                   -> Axes
rec.force.plot("force")                             !! none of the columns; the columns are: seq
rec.pairs(12, 10).plot()                            -> Axes
model.plot()                                        -> Axes
model.plot(rec.pairs(12, 10))                       -> Axes
plan.run(rec.tracker).plot("position_mm")           -> Axes
incise.open("none.rec")                             !! none.rec: no such recording
incise.open(fis)                                    !! is a model; incise.load() reads it
incise.load(rec.path)                               !! is a recording; incise.open() reads it
incise.load("none.fis")                             !! none.fis
incise.Model(fis)                                   -> <incise.Model force_N of depth_mm, velocity_mm_s
model.compile()                                     -> <incise.CompiledModel force_N of depth_mm
model((5, 20)) == model([5, 20])                    -> True
model(5, 20)                                        !! takes 2 positional arguments but 3 were given
model({"velocity_mm_s": 20, "depth_mm": 5}) == model((5, 20))  -> True
model(frame[["velocity_mm_s", "depth_mm"]])[0] == model(frame)[0]  -> True
model(frame[["depth_mm"]])                          !! inputs have no column velocity_mm_s
model((nan, 20))                                    !! nan is not finite
model((5, inf))                                     !! inf is not finite
model((500, 20)) > 0                                ?? 1 of 1 points are outside the training range
model((5, 20, 1))                                   !! the model has 2 inputs
model(None)                                         !! inputs
model((5, 20), sd=True)                             !! no standard deviation; train it here, or load
model.report                                        !! a report comes of incise.train()
model.save(fis)                                     !! exists; give another name, or overwrite=True
model.save("model.txt")                             !! model.txt: expected a name that ends in .fis
model.save("a.fis") or model.save("a.fis", overwrite=True)  -> None
model.compile().save("a.fis")                       !! a.fis: expected a name that ends in .fx
rec.force.parquet("force.csv")                      !! force.csv: expected a name that ends in .parquet
train(X, y)                                         -> force_N of depth_mm, velocity_mm_s
train(X, y, inputs=("a", "b"), target="F")          -> F of a, b
train(X[:, 0], y)                                   !! name its columns by inputs=
train(X, y[:-1])                                    !! different lengths
train(X, y, group="cut")                            !! train(X, y): X has no column 'cut'
train(X, y, group=cut)                              -> force_N of depth_mm, velocity_mm_s
train(X, y, sample_weight=1)((5, 20)) == train(X, y)((5, 20))  -> True
train(X, y, sample_weight=weight)                   -> force_N of depth_mm, velocity_mm_s
train({"advancing": y > 1, "x": X[:, 0]}, y, sample_weight=weight).report.pairs == len(y)  -> True
train(X, y, sample_weight=0 * y)                    !! sample_weight: all are zero
train(X, y, sample_weight=[1, 2])                   !! sample_weight: expected one for each row, found 2
train(X, y, sample_weight=-1)                       !! sample_weight: expected finite numbers, 0 or more
train(columns, sample_weight=weight)                !! only of rows of X and y
train(X, y, group=[n // 20 for n in range(len(y))])  -> force_N of depth_mm, velocity_mm_s
train({**columns, "hand": (y > 1).astype(int)}, group="hand")  -> force_N of depth_mm, velocity_mm_s
train(X, None)                                      !! a ndarray is no table
train(columns)                                      -> force_N of depth_mm, velocity_mm_s
train(columns, target="force")                      !! no column 'force'
train(frame)                                        -> force_N of depth_mm, velocity_mm_s
train(frame[["velocity_mm_s", "depth_mm"]], frame["force_N"])  -> force_N of velocity_mm_s, depth_mm
train(X, y, progress=1 .fromhex)                    !! has no attribute
train(X, y, progress=steps.append) and steps[-1].epoch  -> 1
regressor(frame[["depth_mm", "velocity_mm_s"]], frame["force_N"]).model_  -> force_N of depth_mm, velocity
regressor(X, y).model_                              -> y of x0, x1
incise.Plan("liver", model=model)                   -> liver.scene: pose predict contact
incise.Plan("liver", model=model.compile())         -> liver.scene: pose predict contact
incise.Plan("liver", model=5)                       !! model: expected a path or a model, found a int
incise.Plan("lver")                                 !! lver: no such scene; give the path
plan.run(rec.tracker)                               -> <incise.Columns ticks of
plan.step(100, (1, 2))                              !! a pose is (x, y, z) in mm
incise.capture("sim:clock=simulated", "b.rec", duration_s=2)  -> b.rec: 
incise.capture("sim:clock=simulated", rec.path)     !! exists; give another name
incise.capture("sim:clok=simulated", "c.rec")       !! did you mean clock?
incise.capture("sim:", "c")                         !! c: expected a name that ends in .rec
loop(duration_s=1).wait()                           -> <incise.Columns ticks of neck: 1000 rows
loop("lver", duration_s=1).wait()                   !! lver
loop("neck", duration_s=1, tool="knife").wait()     !! expected auto, blade, handle or tube
loop("liver", duration_s=1, model=model).wait()     -> ticks of liver: 1000 rows
incise.read_log("none.csv")                         !! none.csv: No such file
incise.read_log(rec.path + "/recording.db")         !! no .session, and no CSV with a row of names
incise.verify(rec.path).complete                    -> True
incise.nothing                                      !! module 'incise' has no attribute 'nothing'
"""

# The packages that lines need: without one, a method says so, and lines with a DataFrame are left out.
PACKAGES = {
    "pandas": r"to_pandas",
    "xarray": r"xarray\(",
    "matplotlib": r"\.plot\(",
    "sklearn": r"regressor",
}


class Typed(Case):
    def names(self):
        """The names that the lines use."""
        rec = incise.open(os.path.join(self.shared, "short.rec"))
        fis = os.path.join(self.shared, "bare.fis")
        if not os.path.exists(fis):
            with contextlib.suppress(incise.Exists):
                quick = {"mf": (2, 2), "epochs": 1}
                trained = incise.train(rec.pairs(12, 10, by_cut=True), **quick)
                trained.save(fis)
                os.remove(fis + ".sd")
        columns = dict(rec.pairs(12, 10, by_cut=True).numpy())

        def train(*data, **options):
            return incise.train(*data, mf=(2, 2), epochs=1, **options)

        def loop(scene="neck", **options):
            return incise.Haptic(scene, "sim:clock=simulated", **options)

        import numpy

        found = {
            "incise": incise, "rec": rec, "fis": fis, "model": incise.Model(fis), "columns": columns,
            "plan": incise.Plan("liver"), "train": train, "loop": loop, "steps": [],
            "X": numpy.column_stack((columns["depth_mm"], columns["velocity_mm_s"])),
            "y": columns["force_N"], "cut": columns["cut"], "weight": numpy.where(columns["force_N"] < 1, 10.0, 0.1), "nan": numpy.nan, "inf": numpy.inf,
            "name": lambda n: list(dict.fromkeys(rec.pairs()["cut"]))[n - 1],
            "axis": lambda: None,
            "regressor": lambda X, y: incise.ForceRegressor(mf=(2, 2)).fit(X, y),
        }
        if has("pandas"):
            import pandas

            found["frame"] = pandas.DataFrame(columns)
        if has("matplotlib"):
            import matplotlib

            matplotlib.use("Agg")
            import matplotlib.pyplot

            found["axis"] = lambda: matplotlib.pyplot.subplots()[1]
            self.addCleanup(matplotlib.pyplot.close, "all")
        return found

    def lacks(self, line):
        """The package that a line needs and that is not there."""
        for name, pattern in PACKAGES.items():
            if re.search(pattern, line) and not has(name):
                return name
        return None

    def test_each_line(self):
        if not has("numpy"):
            self.skipTest("numpy is not installed")
        names = self.names()
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(self.folder)
        lines = TYPED.strip().splitlines()
        self.assertGreaterEqual(len(lines), 60)
        for line in lines:
            code, sign, wanted = re.fullmatch(r"(.*?) +(->|!!|\?\?) (.*)", line).groups()
            if "frame" in code and not has("pandas"):
                continue
            lacks = self.lacks(code)
            with self.subTest(code), warnings.catch_warnings(record=True) as warned:
                warnings.simplefilter("always")
                if lacks or sign == "!!":
                    with self.assertRaises(Exception) as caught:
                        eval(code, names)
                    also = "install|" if lacks else ""
                    self.assertRegex(str(caught.exception), also + re.escape(wanted))
                    self.assertEqual(len(str(caught.exception).splitlines()), 1)
                    continue
                result = repr(eval(code, names))
                self.assertIn(wanted, result if sign == "->" else str(warned[0].message))


if __name__ == "__main__":
    import unittest

    unittest.main()
