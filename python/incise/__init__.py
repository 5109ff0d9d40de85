# SPDX-License-Identifier: LGPL-2.1-or-later
"""incise for Python: recordings, models and scenes of the haptic cutting toolkit.

    rec = incise.open("liver.rec")
    pairs = rec.pairs(depth_bins=12, velocity_bins=10, by_cut=True)

Lengths are millimetres, forces newtons, times seconds, or nanoseconds of CLOCK_MONOTONIC where the
name ends in _ns. Everything is in the C library; this package calls it by ctypes.
"""

from . import calibrate, mujoco
from ._host import Host, Wrench
from ._library import VERSION as __version__
from ._library import Error, Invalid, NotFound
from .arrow import Batch, Field, Table
from .capture import capture
from .model import CompiledModel, Model, TrainReport, Variable, load, train
from .plan import Plan, Stability, Tick
from .recording import Frame, Info, Recording, Stream, open
from .verify import Finding, Report, verify
from .wall import Wall, WallPoint

__all__ = [
    "Batch",
    "CompiledModel",
    "Error",
    "Field",
    "Finding",
    "Frame",
    "Host",
    "Info",
    "Invalid",
    "Model",
    "NotFound",
    "Plan",
    "Recording",
    "Report",
    "Stability",
    "Stream",
    "Table",
    "Tick",
    "TrainReport",
    "Variable",
    "Wall",
    "WallPoint",
    "Wrench",
    "calibrate",
    "capture",
    "load",
    "mujoco",
    "open",
    "train",
    "verify",
    "__version__",
]


def __getattr__(name):
    """ForceRegressor needs scikit-learn, which is imported with it."""
    if name == "ForceRegressor":
        from .sklearn import ForceRegressor

        return ForceRegressor
    raise AttributeError(f"module 'incise' has no attribute {name!r}")
