# SPDX-License-Identifier: LGPL-2.1-or-later
"""Recording a rig, as `incise capture` does."""

from __future__ import annotations

import ctypes
import errno
import warnings
from typing import Any, List, Optional

from . import _library
from ._library import (
    CalibrationStruct,
    Invalid,
    Stream,
    ErrorStruct,
    Struct,
    c_bool,
    c_char_p,
    c_double,
    c_int,
    c_int64,
    c_uint64,
    c_void_p,
    call,
    function,
    path_bytes,
    text,
)
from ._recording import PathLike, Recording, load_calibration, open

_TRACKER, _FORCE, _CAMERA = 1, 2, 4  # enum incise_rig_device
_Warn = ctypes.CFUNCTYPE(None, c_void_p, c_char_p)


class SetupStruct(Struct, of="struct incise_recorder_setup"):
    _fields_ = [
        ("calibration", ctypes.POINTER(CalibrationStruct)),
        ("calibration_path", c_char_p),
        ("vision", c_void_p),
        ("planned_s", c_double),
        ("armed", c_bool),
        ("trigger_force_N", c_double),
        ("trigger_button", c_bool),
        ("cuts", c_bool),
        ("clock_source", c_char_p),
    ]


class CountsStruct(Struct, of="struct incise_pose_counts"):
    _fields_ = [("poses", c_uint64), ("unusable", c_uint64), ("flagged", c_uint64 * 128)]


class StatsStruct(Struct, of="struct incise_recorder_stats"):
    _fields_ = [
        ("force", c_uint64),
        ("tracker", c_uint64),
        ("depth", c_uint64),
        ("frames", c_uint64),
        ("poses", CountsStruct),
        ("force_lost", c_uint64),
        ("tracker_lost", c_uint64),
        ("frames_lost", c_uint64),
        ("frames_unlooked", c_uint64),
        ("force_clipped", c_uint64),
        ("depth_mm", c_double),
        ("camera_depth_mm", c_double),
        ("force_N", c_double),
        ("full_scale_N", c_double),
        ("zero_mV", c_double),
        ("button", c_bool),
        ("armed", c_bool),
        ("bytes_per_s", c_double),
        ("disk_s", c_double),
        ("streams", Stream * 3),
        ("n_streams", c_int),
    ]


class OptionsStruct(Struct, of="struct incise_capture_options"):
    _fields_ = [
        ("recorder", SetupStruct),
        ("duration_s", c_double),
        ("sync", c_char_p),
        ("at_time", c_bool),
        ("start_tai", c_bool),
        ("start_ns", c_int64),
        ("stop", ctypes.POINTER(c_int)),
        ("step", c_void_p),
        ("warn", _Warn),
        ("context", c_void_p),
    ]


class ResultStruct(Struct, of="struct incise_capture_result"):
    _fields_ = [
        ("seconds", c_double),
        ("start_ns", c_int64),
        ("early", ErrorStruct),
        ("stats", StatsStruct),
        ("wall", c_void_p),
    ]


_library.prototypes(
    "libincise",
    """
    struct incise_rig *incise_rig_open(const char *spec, unsigned int devices,
        struct incise_error *err);
    void incise_rig_close(struct incise_rig *rig);
    """,
)
_library.prototypes(
    "libincise-record",
    """
    int incise_capture_run(const char *path, struct incise_rig *rig,
        const struct incise_capture_options *options, struct incise_capture_result *result,
        struct incise_error *err);
    int incise_capture_judge(const char *path, const struct incise_capture_options *options,
        const struct incise_capture_result *result, struct incise_error *err);
    """,
)


def capture(
    rig: PathLike,
    path: PathLike,
    *,
    duration_s: float = 0,
    calibration: Optional[PathLike] = None,
    camera: bool = False,
    trigger_force_N: float = 0,
    cuts: bool = False,
    clock_source: Optional[str] = None,
) -> Recording:
    """Record a rig into a new folder NAME.rec, and open it. Ctrl-C ends the recording, which is kept.

    rig: path of a rig.conf, or "sim:KEY=VALUE,…". duration_s: 0 records until Ctrl-C, on the simulated
    rig until the end of its cuts. calibration: a calibration.conf; None: nominal values. camera: record
    its frames too. trigger_force_N: start a second before a force of this size. cuts: mark the cuts in
    the table events. clock_source: as --clock-source of `incise capture`.

    A recording that is not complete, for example with lost samples, raises :class:`incise.Error` and
    can be opened nevertheless; warnings name doubtful samples.
    """
    if not (duration_s >= 0 and trigger_force_N >= 0):
        raise Invalid(
            errno.EINVAL,
            "duration_s, trigger_force_N: expected 0 or more, "
            f"found {duration_s!r}, {trigger_force_N!r}",
        )
    result, stop = ResultStruct(), c_int(0)
    name = path_bytes(path)
    doubts: List[str] = []

    def on_doubt(context: Any, line: bytes) -> None:
        doubts.append(text(line))

    values = load_calibration(calibration)
    options = OptionsStruct(
        recorder=SetupStruct(
            calibration=ctypes.pointer(values),
            calibration_path=None if calibration is None else path_bytes(calibration),
            trigger_force_N=trigger_force_N,
            cuts=cuts,
            clock_source=None if clock_source is None else clock_source.encode(),
        ),
        duration_s=duration_s,
        stop=ctypes.pointer(stop),
        warn=_Warn(on_doubt),
    )

    def interrupt() -> None:
        stop.value = 1

    devices = _TRACKER | _FORCE | (_CAMERA if camera else 0)
    opened = call("incise_rig_open", path_bytes(rig), devices)
    try:
        _library.call_interruptible(
            lambda: call("incise_capture_run", name, opened, options, result), interrupt
        )
        call("incise_capture_judge", name, options, result)
    finally:
        function("incise_wall_free")(result.wall)
        function("incise_rig_close")(opened)
        for doubt in doubts:
            warnings.warn(doubt, stacklevel=2)
    return open(path)
