# SPDX-License-Identifier: GPL-2.0-or-later
# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # A force model from recorded cuts
#
# The path of Song, Yuan and Fu (2006): record cuts into tissue, average force over depth and velocity, learn
# a fuzzy model, and compare it with simple baselines on cuts that it has not seen. The rig is simulated.

# %%
import os
import tempfile

import matplotlib
import numpy as np

import incise

matplotlib.rcParams.update({"figure.figsize": (7, 4), "svg.hashsalt": "incise"})

folder = tempfile.mkdtemp()
path = os.path.join(folder, "liver.rec")
rec = incise.capture("sim:seed=1,clock=simulated", path)
print(f"{rec.info.cuts} cuts, {rec.info.force} force samples, {rec.info.force_lost} lost")

# %% [markdown]
# ## One cut
# Tables have units, and are cut by time and by the number of the cut.

# %%
first = rec.pairs(rate_hz=200).cut(1)
first.plot("depth_mm", "force_N")
first

# %% [markdown]
# ## Training
# Pairs are averaged in bins by cut, so that cross-validation and the check keep whole cuts together.

# %%
pairs = rec.pairs(depth_bins=12, velocity_bins=10, by_cut=True)
model = incise.train(pairs, group="cut", check=0.3)
report = model.report
print(f"rms error on unseen cuts: {report.check_rms_error:.3f} N")
for name, error in report.baselines.items():
    print(f"    {name}: {error:.3f} N")
assert report.check_rms_error < min(report.baselines.values())

# %% [markdown]
# ## Force over depth, with the interval of a new cut
# The bands are ± 1.96 standard deviations; below, the residuals of the pairs.

# %%
model.plot(pairs)
model

# %% [markdown]
# ## Fixed point
# The haptic loop evaluates integers; the certified bound holds for every input.

# %%
compiled = model.compile(budget_mN=0.1)
x = np.random.default_rng(1).uniform((0, 0), (20, 50), (10_000, 2))
largest = np.abs(compiled(x) - model(x)).max()
print(f"certified {compiled.bound * 1e6:.1f} µN, largest of {len(x)} points {largest * 1e6:.1f} µN")
assert largest <= compiled.bound
