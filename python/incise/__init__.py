# SPDX-License-Identifier: LGPL-2.1-or-later
"""incise for Python: recordings, models and scenes of the haptic cutting toolkit.

    rec = incise.open("liver.rec")
    pairs = rec.pairs(depth_bins=12, velocity_bins=10, by_cut=True)

Lengths are millimetres, forces newtons, times seconds, or nanoseconds of CLOCK_MONOTONIC where the
name ends in _ns. Everything is in the C library; this package calls it by ctypes.
"""

import importlib.util
from typing import TYPE_CHECKING, Any, List

from . import calibrate, mujoco
from ._arrow import Batch, Field, Table
from ._capture import capture
from ._columns import Columns
from ._haptic import Haptic, read_log
from ._host import Host, Wrench
from ._library import VERSION as __version__
from ._library import Error, Exists, Invalid, NotFound
from ._model import CompiledModel, Model, TrainReport, TrainStep, Variable, load, train
from ._plan import FLAGS, Plan, Stability, Tick
from ._recording import Frame, Info, Recording, Stream, open
from ._verify import Finding, Report, verify
from ._wall import Wall, WallPoint

if TYPE_CHECKING:
    from ._sklearn import ForceRegressor as ForceRegressor

__all__ = [
    "Batch",
    "Columns",
    "CompiledModel",
    "Error",
    "Exists",
    "FLAGS",
    "Field",
    "Finding",
    "Frame",
    "Haptic",
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
    "TrainStep",
    "Variable",
    "Wall",
    "WallPoint",
    "Wrench",
    "calibrate",
    "capture",
    "load",
    "mujoco",
    "open",
    "read_log",
    "train",
    "verify",
    "__version__",
]

for _name in __all__:
    if hasattr(globals().get(_name), "__module__"):
        globals()[_name].__module__ = "incise"


def __dir__() -> List[str]:
    return __all__ + ["ForceRegressor"] * bool(importlib.util.find_spec("sklearn"))


def __getattr__(name: str) -> Any:
    """ForceRegressor needs scikit-learn, which is imported with it."""
    if name == "ForceRegressor":
        from ._sklearn import ForceRegressor

        return ForceRegressor
    raise AttributeError(f"module 'incise' has no attribute {name!r}")
