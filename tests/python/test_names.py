# SPDX-License-Identifier: GPL-2.0-or-later
"""Each exported name may be called with anything: it works or raises, and Python goes on."""

import pathlib
import subprocess
import sys
import unittest

import incise
from fixtures import has

# In a process of its own: one that is ended has printed less than all.
PROGRAM = """
import gc, itertools, pathlib, sys
import incise

fis, folder = sys.argv[1:]
some = {"text": fis, "none": None, "zero": 0, "path": pathlib.Path(fis), "object": object(), "nan": float("nan"),
        "bytes": b"x", "list": [1, 2], "folder": folder, "missing": folder + "/none", "empty": "", "big": 1 << 70}
for name in sorted(incise.__all__):
    given = getattr(incise, name)
    if not callable(given):
        continue
    for n in range(3):
        for kinds in itertools.product(some, repeat=n):
            try:
                made = given(*(some[kind] for kind in kinds))
                repr(made)
                made = None
            except Exception as failure:
                str(failure), repr(failure)
            gc.collect(0)
    print(name)
"""


class Names(unittest.TestCase):
    def test_every_name_with_anything(self):
        fis = pathlib.Path(__file__).parents[2] / "scenes" / "liver.fis"
        folder = pathlib.Path(__file__).parent
        done = subprocess.run([sys.executable, "-c", PROGRAM, str(fis), str(folder)], stdout=subprocess.PIPE, text=True)
        self.assertEqual(done.returncode, 0)
        names = [name for name in sorted(incise.__all__) if callable(getattr(incise, name))]
        self.assertEqual(done.stdout.split(), names)

    def test_what_is_public_is_listed(self):
        self.assertEqual(dir(incise), sorted(incise.__all__ + ["ForceRegressor"] * has("sklearn")))
        self.assertEqual(dir(incise.calibrate), sorted(incise.calibrate.__all__))
        self.assertEqual(incise.Model.__module__, "incise")

    def test_a_class_takes_a_path(self):
        fis = str(pathlib.Path(__file__).parents[2] / "scenes" / "liver.fis")
        self.assertEqual(incise.Model(fis)((5, 20)), incise.load(fis)((5, 20)))
        for made_elsewhere in (incise.Wall, incise.Table, incise.Batch):
            with self.assertRaisesRegex(TypeError, "comes of a"):
                made_elsewhere()


if __name__ == "__main__":
    unittest.main()
