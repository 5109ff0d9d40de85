# SPDX-License-Identifier: GPL-2.0-or-later
# ---
# jupyter:
#   jupytext:
#     text_representation: {extension: .py, format_name: percent}
# ---

# %% [markdown]
# # Which forces does a device hold?
#
# A scene whose forces are larger than its device can hold is refused, with the largest safe gain. Here the
# margin over the tracker's rate and lateness, and the force of a stroke by trackers of two rates.

# %%
import matplotlib
import numpy as np

import incise

matplotlib.rcParams.update({"figure.figsize": (7, 4), "svg.hashsalt": "incise"})
import matplotlib.pyplot as plt

wall = incise.Plan("wall")
print(f"wall: {wall.stability.stiffness_N_mm:.3f} N/mm, margin {wall.stability.margin:.2f}")
print("left out:", ", ".join(wall.left_out))

# %% [markdown]
# ## The margin
# With so many times its forces the scene would swing. A tracker that is slower or later leaves less. A plan that
# would be unstable raises
# `incise.Invalid`, whose line has the largest gain.

# %%
rates = (120, 240, 480)
latencies = np.linspace(1, 20, 20)
figure, axis = plt.subplots(layout="constrained")
for rate in rates:
    margins = []
    for latency in latencies:
        try:
            margins.append(incise.Plan("wall", tracker_hz=rate, latency_ms=latency).stability.margin)
        except incise.Invalid as refused:
            margins.append(np.nan)
            last = str(refused)
    axis.plot(latencies, margins, label=f"{rate} Hz")
axis.axhline(1, color="0.5", linestyle="--")
axis.set(title="Margin of wall.scene", xlabel="lateness of the tracker / ms", ylabel="margin")
axis.legend(title="tracker")
print("beyond a curve's end:", last.split(": ", 1)[-1])

# %% [markdown]
# ## A stroke
# The same motion by a tracker of 120 Hz and one of 480 Hz: what the slower one costs in force.

# %%
def stroke(rate: float) -> incise.Columns:
    """Force of a stroke of 5 mm that takes half a second, at each ms."""
    t = np.arange(0, 2, 1 / rate)
    poses = {
        "t_ns": np.rint(1e9 + t * 1e9).astype("i8"),
        "x_mm": 60 + 0 * t, "y_mm": 0 * t, "z_mm": 3 - 5 * np.sin(2 * np.pi * t) ** 2,
    }
    return incise.Plan("neck", tracker_hz=rate, latency_ms=2).run(poses)


slow, fast = stroke(120), stroke(480)
n = min(len(slow["t_ns"]), len(fast["t_ns"]))
t = (slow["t_ns"][:n] - slow["t_ns"][0]) * 1e-9
difference = slow["command_N"][:n, 2] - fast["command_N"][:n, 2]
figure, axes = plt.subplots(2, sharex=True, layout="constrained")
axes[0].plot(t, fast["command_N"][:n, 2])
axes[0].set(title="A stroke into the neck, and what a tracker of 120 Hz changes", ylabel="force / N")
axes[1].plot(t, difference * 1e3)
axes[1].set(xlabel="time / s", ylabel="difference / mN")
print(f"largest force {fast['command_N'][:, 2].max():.3f} N, "
      f"largest difference {np.abs(difference).max() * 1e3:.1f} mN")
assert np.isfinite(slow["command_N"]).all()
