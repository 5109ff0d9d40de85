# SPDX-License-Identifier: LGPL-2.1-or-later
"""incise for Python: recordings, models and scenes of the haptic cutting toolkit.

    rec = incise.open("liver.rec")
    pairs = rec.pairs(depth_bins=12, velocity_bins=10, by_cut=True)

Lengths are millimetres, forces newtons, times seconds, or nanoseconds of CLOCK_MONOTONIC where the
name ends in _ns. Everything is in the C library; this package calls it by ctypes.
"""

from ._library import VERSION as __version__
from ._library import Error, Invalid, NotFound
from .arrow import Batch, Field, Table
from .model import CompiledModel, Model, TrainReport, Variable, load, train
from .recording import Info, Recording, Stream, open
from .verify import Finding, Report, verify

__all__ = [
    "Batch",
    "CompiledModel",
    "Error",
    "Field",
    "Finding",
    "Info",
    "Invalid",
    "Model",
    "NotFound",
    "Recording",
    "Report",
    "Stream",
    "Table",
    "TrainReport",
    "Variable",
    "load",
    "open",
    "train",
    "verify",
    "__version__",
]
