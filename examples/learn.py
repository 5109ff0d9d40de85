#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Learn a model from a recording, and print how its force grows with the depth.

    examples/learn.py liver.rec liver.fis
"""

import sys

import incise

if len(sys.argv) != 3:
    sys.exit("usage: learn.py RECORDING.rec MODEL.fis")
try:
    recording = incise.open(sys.argv[1])
    pairs = recording.pairs(depth_bins=12, velocity_bins=10, by_cut=True)
    model = incise.train(pairs, group="cut", check=0.3)
    model.save(sys.argv[2])
except incise.Error as error:
    sys.exit(f"learn.py: {error}")

report = model.report
print(f"rms error on unseen cuts {report.check_rms_error:.3f} N, "
      f"of linear regression {report.baselines['linear']:.3f} N")
for depth_mm in (5, 10, 15):
    force, sd = model((depth_mm, 20), sd=True)
    print(f"{depth_mm:2d} mm, 20 mm/s: {force:.2f} N, 95 % of new cuts within {1.96 * sd:.2f} N")
