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
from .recording import Info, Recording, Stream, open
from .verify import Finding, Report, verify

__all__ = [
    "Batch",
    "Error",
    "Field",
    "Finding",
    "Info",
    "Invalid",
    "NotFound",
    "Recording",
    "Report",
    "Stream",
    "Table",
    "open",
    "verify",
    "__version__",
]
