# SPDX-License-Identifier: LGPL-2.1-or-later
"""Recording a rig, as `incise capture` does."""

from __future__ import annotations

import ctypes
import errno
import warnings
from typing import Any, List, Optional

from . import _library
from ._library import Invalid, c_char_p, c_int, c_void_p, call, function, path_bytes, text
from ._recording import PathLike, Recording, load_calibration, open

_TRACKER, _FORCE, _CAMERA, _FORCE_IF_NAMED = 1, 2, 4, 128  # enum incise_rig_device
_Warn = ctypes.CFUNCTYPE(None, c_void_p, c_char_p)


SetupStruct, CountsStruct, StatsStruct, OptionsStruct, ResultStruct = _library.structs(
    """
    struct incise_recorder_setup {
        struct incise_calibration *calibration;
        const char *calibration_path;
        void *vision;
        double planned_s;
        bool armed;
        double trigger_force_N;
        bool trigger_button, cuts;
        const char *clock_source;
    };
    struct incise_pose_counts {
        uint64_t poses, unusable, flagged[128];
    };
    struct incise_recorder_stats {
        uint64_t force, tracker, depth, frames;
        struct incise_pose_counts poses;
        uint64_t force_lost, tracker_lost, frames_lost, frames_unlooked, force_clipped;
        double depth_mm, camera_depth_mm, force_N, full_scale_N, zero_mV;
        bool button, armed;
        double bytes_per_s, disk_s;
        struct incise_stream streams[3];
        int n_streams;
    };
    struct incise_capture_options {
        struct incise_recorder_setup recorder;
        double duration_s;
        const char *sync;
        bool at_time, start_tai;
        int64_t start_ns;
        int *stop;
        void *step;
        _Warn warn;
        void *context;
    };
    struct incise_capture_result {
        double seconds;
        int64_t start_ns;
        struct incise_error early;
        struct incise_recorder_stats stats;
        void *wall;
    };
    """,
    _Warn=_Warn,
)


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
    name = _library.new_path(path, ".rec")
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

    devices = _TRACKER | _FORCE | _FORCE_IF_NAMED | (_CAMERA if camera else 0)
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
