# SPDX-License-Identifier: LGPL-2.1-or-later
"""Calibrations as pure functions: force from weights, depth from lengths, the tip from a pivot.

Uncertainties ``u`` are standard ones; U is 2 u (k = 2). Nothing is written: `incise calibrate` keeps
the history in calibration.conf.
"""

from __future__ import annotations

import errno
import math
from typing import Any, Dict, List, NamedTuple, Sequence, Tuple

from . import _library
from ._library import Invalid, c_double, call, function, values

(
    ForcePairStruct,
    ForceSetupStruct,
    PartStruct,
    BudgetStruct,
    ForceStruct,
    DepthFitStruct,
    DepthLengthsStruct,
    TipPoseStruct,
    TipFitStruct,
) = _library.structs(
    """
    struct incise_calibrate_force_pair {
        double mass_g, force_N, reading_mV;
        int series;
        bool descending;
    };
    struct incise_calibrate_force_setup {
        double gravity_m_s2, gravity_u_m_s2, air_kg_m3, air_u_kg_m3, weight_kg_m3;
        double weight_u_kg_m3, scale_g, low_mV, high_mV, step_mV;
        bool dithered;
        double nominal_mV_N, tolerance;
    };
    struct incise_calibration_part {
        const char *source;
        char type;
        double u;
        const char *unit;
        double sensitivity, contribution;
    };
    struct incise_calibration_budget {
        int n;
        struct incise_calibration_part part[6];
    };
    struct incise_calibrate_force {
        double sensitivity_mV_N, sensitivity_u_mV_N, zero_mV, zero_u_mV, covariance;
        double residual_sd_mV, scatter_sd_mV;
        int freedom;
        double misfit, linearity, hysteresis, repeatability, zero_return, resolution_N, low_N;
        double high_N, clips_N;
        int pairs, used, saturated, outliers, loads, series;
        bool pass;
        struct incise_calibration_budget budget;
    };
    struct incise_depth_fit {
        double mm_px, u_mm_px, full_px, u_full_px, covariance;
        int n, inliers, effective;
        double sd_mm, largest_mm, low_px, high_px, bend_mm, bend_sd_mm;
        struct incise_calibration_budget budget;
    };
    struct incise_depth_lengths {
        double *depth_mm, *length_px;
        int n;
        double u_scale, u_depth_mm;
    };
    struct incise_tip_pose {
        int64_t t_ns;
        double position_mm[3], quaternion[4];
    };
    struct incise_tip_fit {
        double tip_mm[3], covariance[9], pivot_mm[3], rms_mm, largest_mm, held_out_mm, cone_deg;
        double least_deg, least[3], condition, moved_mm, moved_sd_mm;
        int n, inliers, block, blocks;
    };
    """
)


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
    return tuple(Part(*values(part, Part._fields)) for part in budget.part[: budget.n])


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
    names = [{"passed": "pass"}.get(name, name) for name in Force._fields[:-1]]
    return Force(*values(result, names), _parts(result.budget))


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
    return Depth(*values(fit, Depth._fields[:-1]), _parts(fit.budget))


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
    rows = {name: _numbers(name, columns[name]) for name in names}
    times = [int(t) for t in columns["t_ns"]]
    n = _same_length(t_ns=[float(t) for t in times], **rows)
    made = (TipPoseStruct * max(n, 1))()
    for i in range(n):
        made[i].t_ns = times[i]
        made[i].position_mm[:] = [rows[name][i] for name in names[:3]]
        made[i].quaternion[:] = [rows[name][i] for name in names[3:]]
    fit = TipFitStruct()
    call("incise_calibrate_tip", made, n, None, fit)
    fit.u_mm = tuple(math.sqrt(max(fit.covariance[4 * i], 0)) for i in range(3))
    return Tip(*values(fit, Tip._fields))
