# SPDX-License-Identifier: GPL-2.0-or-later
"""Sums of incise next to numpy.linalg.lstsq on the same design: make check-corpus [PAIRS=1000000].

Runs tests/bench/corpus, reads its pairs and its model, and prints the time of lstsq, and the
largest difference of the predictions in standard deviations of the force.
"""

import os
import re
import subprocess
import sys
import tempfile
import time

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
try:
    import numpy
except ImportError:
    sys.exit("corpus.py: skipped: numpy is missing")

pairs = sys.argv[2] if len(sys.argv) > 2 else "1000000"
with tempfile.TemporaryDirectory() as folder:
    rows, fis = os.path.join(folder, "rows.bin"), os.path.join(folder, "m.fis")
    print(subprocess.run([sys.argv[1], pairs, rows, fis], check=True, capture_output=True,
                         text=True).stdout, end="")
    data = numpy.fromfile(rows).reshape(-1, 3)
    text = open(fis, encoding="utf-8").read()
gauss = re.findall(r"'gaussmf',\[(\S+) (\S+)\]", text)
linear = numpy.array([[float(x) for x in line.split()]
                      for line in re.findall(r"'linear',\[(.*?)\]", text)])


def degrees(x, mfs):
    all_mfs = numpy.stack([numpy.exp(-0.5 * ((x - float(c)) / float(s)) ** 2) for s, c in mfs], 1)
    return all_mfs / all_mfs.sum(1, keepdims=True)


weights = (degrees(data[:, 0], gauss[:5])[:, :, None] *
           degrees(data[:, 1], gauss[5:])[:, None, :]).reshape(len(data), -1)
ones = numpy.stack([numpy.ones(len(data)), data[:, 0] / 20, data[:, 1] / 50], 1)
design = (weights[:, :, None] * ones[:, None, :]).reshape(len(data), -1)
begin = time.monotonic()
x = numpy.linalg.lstsq(design, data[:, 2], rcond=None)[0]
took = time.monotonic() - begin
ours = numpy.stack([linear[:, 2], linear[:, 0] * 20, linear[:, 1] * 50], 1).reshape(-1)
difference = numpy.abs(design @ (x - ours)).max() / data[:, 2].std()
print(f"numpy {numpy.__version__} lstsq: {1e9 * took / len(data):.1f} ns a pair; "
      f"largest difference of a prediction {difference:.2g} sd; "
      f"of the consequents {numpy.abs(x - ours).max() / numpy.abs(x).max():.2g} of the largest")
