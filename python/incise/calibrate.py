# SPDX-License-Identifier: LGPL-2.1-or-later
"""Calibrations as pure functions: force from weights, depth from lengths, the tip from a pivot.

Uncertainties ``u`` are standard ones; U is 2 u (k = 2). Nothing is written: `incise calibrate` keeps
the history in calibration.conf.
"""

from __future__ import annotations

import ctypes
import errno
import math
from typing import Any, Dict, List, NamedTuple, Sequence, Tuple

from . import _library
from ._library import Invalid, Struct, c_bool, c_char, c_double, c_int, c_int64
from ._library import call, function, text


class ForcePairStruct(Struct, of="struct incise_calibrate_force_pair"):
    _fields_ = [
        ("mass_g", c_double),
        ("force_N", c_double),
        ("reading_mV", c_double),
        ("series", c_int),
        ("descending", c_bool),
    ]


class ForceSetupStruct(Struct, of="struct incise_calibrate_force_setup"):
    _fields_ = [
        ("gravity_m_s2", c_double),
        ("gravity_u_m_s2", c_double),
        ("air_kg_m3", c_double),
        ("air_u_kg_m3", c_double),
        ("weight_kg_m3", c_double),
        ("weight_u_kg_m3", c_double),
        ("scale_g", c_double),
        ("low_mV", c_double),
        ("high_mV", c_double),
        ("step_mV", c_double),
        ("dithered", c_bool),
        ("nominal_mV_N", c_double),
        ("tolerance", c_double),
    ]


class PartStruct(Struct, of="struct incise_calibration_part"):
    _fields_ = [
        ("source", ctypes.c_char_p),
        ("type", c_char),
        ("u", c_double),
        ("unit", ctypes.c_char_p),
        ("sensitivity", c_double),
        ("contribution", c_double),
    ]


class BudgetStruct(Struct, of="struct incise_calibration_budget"):
    _fields_ = [("n", c_int), ("part", PartStruct * 6)]


class ForceStruct(Struct, of="struct incise_calibrate_force"):
    _fields_ = [
        ("sensitivity_mV_N", c_double),
        ("sensitivity_u_mV_N", c_double),
        ("zero_mV", c_double),
        ("zero_u_mV", c_double),
        ("covariance", c_double),
        ("residual_sd_mV", c_double),
        ("scatter_sd_mV", c_double),
        ("freedom", c_int),
        ("misfit", c_double),
        ("linearity", c_double),
        ("hysteresis", c_double),
        ("repeatability", c_double),
        ("zero_return", c_double),
        ("resolution_N", c_double),
        ("low_N", c_double),
        ("high_N", c_double),
        ("clips_N", c_double),
        ("pairs", c_int),
        ("used", c_int),
        ("saturated", c_int),
        ("outliers", c_int),
        ("loads", c_int),
        ("series", c_int),
        ("passed", c_bool),
        ("budget", BudgetStruct),
    ]
    c_fields = {"passed": "pass"}  # a word of Python


class DepthFitStruct(Struct, of="struct incise_depth_fit"):
    _fields_ = [
        ("mm_px", c_double),
        ("u_mm_px", c_double),
        ("full_px", c_double),
        ("u_full_px", c_double),
        ("covariance", c_double),
        ("n", c_int),
        ("inliers", c_int),
        ("effective", c_int),
        ("sd_mm", c_double),
        ("largest_mm", c_double),
        ("low_px", c_double),
        ("high_px", c_double),
        ("bend_mm", c_double),
        ("bend_sd_mm", c_double),
        ("budget", BudgetStruct),
    ]


class DepthLengthsStruct(Struct, of="struct incise_depth_lengths"):
    _fields_ = [
        ("depth_mm", ctypes.POINTER(c_double)),
        ("length_px", ctypes.POINTER(c_double)),
        ("n", c_int),
        ("u_scale", c_double),
        ("u_depth_mm", c_double),
    ]


class TipPoseStruct(Struct, of="struct incise_tip_pose"):
    _fields_ = [("t_ns", c_int64), ("position_mm", c_double * 3), ("quaternion", c_double * 4)]


class TipFitStruct(Struct, of="struct incise_tip_fit"):
    _fields_ = [
        ("tip_mm", c_double * 3),
        ("covariance", c_double * 9),
        ("pivot_mm", c_double * 3),
        ("rms_mm", c_double),
        ("largest_mm", c_double),
        ("held_out_mm", c_double),
        ("cone_deg", c_double),
        ("least_deg", c_double),
        ("least", c_double * 3),
        ("condition", c_double),
        ("moved_mm", c_double),
        ("moved_sd_mm", c_double),
        ("n", c_int),
        ("inliers", c_int),
        ("block", c_int),
        ("blocks", c_int),
    ]


_library.prototypes(
    "libincise-learn",
    """
    void incise_calibrate_force_init(struct incise_calibrate_force_setup *setup);
    double incise_calibrate_gravity(double latitude_deg, double altitude_m);
    int incise_calibrate_force(const struct incise_calibrate_force_pair *pairs, int n,
        const struct incise_calibrate_force_setup *setup, struct incise_calibrate_force *result,
        enum incise_calibrate_force_state *states, struct incise_error *err);
    int incise_calibrate_depth_line(const struct incise_depth_lengths *pairs, bool *inlier,
        struct incise_depth_fit *fit, struct incise_error *err);
    int incise_calibrate_tip(const struct incise_tip_pose *poses, int n, bool *inlier,
        struct incise_tip_fit *fit, struct incise_error *err);
    """,
)


class Part(NamedTuple):
    """A line of a budget of uncertainty."""

    source: str
    type: str  #: A by statistics of the readings, B otherwise
    u: float  #: standard uncertainty of the source, in unit
    unit: str
    sensitivity: float  #: change of the result per unit


def _parts(budget: BudgetStruct) -> Tuple[Part, ...]:
    return tuple(
        Part(text(p.source), text(p.type), p.u, text(p.unit), p.sensitivity)
        for p in budget.part[: budget.n]
    )


class Force(NamedTuple):
    """The line through loads and readings, with its uncertainty."""

    sensitivity_mV_N: float
    sensitivity_u_mV_N: float
    zero_mV: float
    zero_u_mV: float
    residual_sd_mV: float
    linearity: float  #: percent of full scale, as those that follow; NaN: not stated
    hysteresis: float
    repeatability: float
    zero_return: float
    low_N: float
    high_N: float
    used: int
    outliers: int
    saturated: int
    passed: bool  #: within tolerance of the nominal sensitivity
    budget: Tuple[Part, ...]


def gravity(latitude_deg: float, altitude_m: float = 0) -> float:
    """Gravity at a place, m/s²; standard uncertainty 5e-4 m/s²."""
    return function("incise_calibrate_gravity")(latitude_deg, altitude_m)


def _numbers(name: str, values: Any) -> List[float]:
    try:
        return [float(value) for value in values]
    except (TypeError, ValueError) as failure:
        raise Invalid(errno.EINVAL, f"{name}: {failure}") from None


def _same_length(**columns: List[float]) -> int:
    lengths = {len(values) for values in columns.values()}
    if len(lengths) != 1:
        raise Invalid(
            errno.EINVAL,
            "columns of different lengths: "
            + ", ".join(f"{name} {len(values)}" for name, values in columns.items()),
        )
    return lengths.pop()


def force(
    mass_g: Sequence[float],
    reading_mV: Sequence[float],
    *,
    series: Sequence[int] = (),
    descending: Sequence[bool] = (),
    **setup: float,
) -> Force:
    """Sensitivity of the force channel from weights and readings (after ISO 376).

    series: number of the run of each pair (default: all of one). descending: whether a load was
    reached by taking weight off. Further settings by name: gravity_m_s2, gravity_u_m_s2, air_kg_m3,
    air_u_kg_m3, weight_kg_m3, weight_u_kg_m3, scale_g, low_mV, high_mV, step_mV, dithered,
    nominal_mV_N, tolerance.
    """
    masses, readings = _numbers("mass_g", mass_g), _numbers("reading_mV", reading_mV)
    runs = [int(s) for s in _numbers("series", series)] or [0] * len(masses)
    down = [bool(d) for d in descending] or [False] * len(masses)
    n = _same_length(mass_g=masses, reading_mV=readings, series=runs, descending=down)
    given = ForceSetupStruct()
    function("incise_calibrate_force_init")(given)
    names = [name for name, _ in ForceSetupStruct._fields_]
    for name, value in setup.items():
        if name not in names:
            raise Invalid(errno.EINVAL, f"{name}: no such setting; there are: {', '.join(names)}")
        setattr(given, name, value)
    pairs = (ForcePairStruct * max(n, 1))(
        *(
            ForcePairStruct(mass, math.nan, reading, run, is_down)
            for mass, reading, run, is_down in zip(masses, readings, runs, down)
        )
    )
    result = ForceStruct()
    call("incise_calibrate_force", pairs, n, given, result, None)
    return Force(*(getattr(result, name) for name in Force._fields[:-1]), _parts(result.budget))


class Depth(NamedTuple):
    """Scale of the camera in the plane of the scalpel."""

    mm_px: float
    u_mm_px: float
    full_px: float  #: exposed length at depth 0
    u_full_px: float
    n: int
    inliers: int
    sd_mm: float  #: of residuals
    bend_mm: float  #: distance of a parabola from the line at its ends
    budget: Tuple[Part, ...]


def depth(
    depth_mm: Sequence[float],
    length_px: Sequence[float],
    *,
    u_scale: float = 0,
    u_depth_mm: float = 0,
) -> Depth:
    """mm per pixel from pairs of depth (by a gauge or the tracker) and exposed length."""
    depths, lengths = _numbers("depth_mm", depth_mm), _numbers("length_px", length_px)
    n = _same_length(depth_mm=depths, length_px=lengths)
    kind = c_double * max(n, 1)
    pairs = DepthLengthsStruct(kind(*depths), kind(*lengths), n, u_scale, u_depth_mm)
    fit = DepthFitStruct()
    call("incise_calibrate_depth_line", pairs, None, fit)
    return Depth(*(getattr(fit, name) for name in Depth._fields[:-1]), _parts(fit.budget))


class Tip(NamedTuple):
    """The blade's tip in the sensor's frame, from a tool that turned about it."""

    tip_mm: Tuple[float, float, float]
    u_mm: Tuple[float, float, float]
    pivot_mm: Tuple[float, float, float]  #: in the tracker's frame
    rms_mm: float  #: of the residuals
    cone_deg: float
    n: int
    inliers: int


def tip(poses: Any) -> Tip:
    """Pivot calibration from poses: a table such as ``rec.tracker``, or {t_ns, x_mm, y_mm, z_mm, qw,
    qx, qy, qz}."""
    from ._plan import _columns

    columns: Dict[str, Any] = _columns(poses)
    missing = [name for name in ("qw", "qx", "qy", "qz") if name not in columns]
    if missing:
        raise Invalid(errno.EINVAL, f"poses have no column {', '.join(missing)}")
    names = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
    values = {name: _numbers(name, columns[name]) for name in names}
    times = [int(t) for t in columns["t_ns"]]
    n = _same_length(t_ns=[float(t) for t in times], **values)
    made = (TipPoseStruct * max(n, 1))()
    for i in range(n):
        made[i].t_ns = times[i]
        made[i].position_mm[:] = [values[name][i] for name in names[:3]]
        made[i].quaternion[:] = [values[name][i] for name in names[3:]]
    fit = TipFitStruct()
    call("incise_calibrate_tip", made, n, None, fit)
    u = [math.sqrt(max(fit.covariance[4 * i], 0)) for i in range(3)]
    return Tip(
        (fit.tip_mm[0], fit.tip_mm[1], fit.tip_mm[2]),
        (u[0], u[1], u[2]),
        (fit.pivot_mm[0], fit.pivot_mm[1], fit.pivot_mm[2]),
        fit.rms_mm,
        fit.cone_deg,
        fit.n,
        fit.inliers,
    )
