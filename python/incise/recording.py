# SPDX-License-Identifier: LGPL-2.1-or-later
"""Recordings: their streams as tables, their pairs for training, and what they say of themselves."""

from __future__ import annotations

import ctypes
import errno
import os
import threading
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Tuple, Union

from . import _library
from ._library import (
    ArrowArrayStream,
    CalibrationStruct,
    ExportOptions,
    Failure,
    FrameStruct,
    Invalid,
    NotFound,
    RecordingInfo,
    function,
    text,
)
from .arrow import Table
from .wall import Wall
from .wall import read as read_wall

PathLike = Union[str, "os.PathLike[str]"]

_library.declare(
    "libincise-record",
    {
        "incise_recording_open": (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p),
        "incise_recording_close": (None, ctypes.c_void_p),
        "incise_recording_info": (
            ctypes.c_int,
            ctypes.c_void_p,
            ctypes.POINTER(RecordingInfo),
            ctypes.c_void_p,
        ),
        "incise_recording_stream": (
            ctypes.c_int,
            ctypes.c_void_p,
            ctypes.c_char_p,
            ctypes.POINTER(ExportOptions),
            ctypes.POINTER(ArrowArrayStream),
            ctypes.c_void_p,
        ),
        "incise_export_options_init": (None, ctypes.POINTER(ExportOptions)),
        "incise_frame_reader_new": (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p),
        "incise_frame_reader_free": (None, ctypes.c_void_p),
        "incise_frame_reader_at": (
            ctypes.c_int,
            ctypes.c_void_p,
            ctypes.c_int64,
            ctypes.POINTER(FrameStruct),
            ctypes.c_void_p,
        ),
    },
)
_library.declare(
    "libincise",
    {
        "incise_calibration_nominal": (None, ctypes.POINTER(CalibrationStruct)),
        "incise_calibration_load": (
            ctypes.c_int,
            ctypes.c_char_p,
            ctypes.POINTER(CalibrationStruct),
            ctypes.c_void_p,
        ),
    },
)


class Stream(NamedTuple):
    """One stream of a recording: its losses and its times. NaN: not known."""

    name: str  #: force, tracker or camera
    device: str
    timestamped: bool  #: by the kernel or the converter, at the acquisition
    nominal_hz: float
    delay_ms: float
    delay_sd_ms: float
    rows: int
    lost: int
    late: int  #: more than a period behind the line of the device's clock
    rate_hz: float  #: measured by this computer's clock
    drift_ppm: float  #: of the device's clock
    drift_sd_ppm: float
    jitter_ms: float
    jitter_max_ms: float
    offset_ms: float  #: of times: the delay, and the expected error of the line
    offset_sd_ms: float  #: standard uncertainty of times
    ended: str  #: cause of an end before the recording's; empty: none
    note: str  #: a doubt of the device or its settings; empty: none


class Info(NamedTuple):
    """What a recording says of itself."""

    complete: bool  #: closed by its recorder
    start_ns: int  #: first force sample, CLOCK_MONOTONIC
    end_ns: int
    started: str  #: wall clock at the start, ISO 8601 UTC
    rig: str
    force: int  #: rows
    tracker: int
    depth: int
    force_lost: int
    tracker_lost: int
    force_clipped: int
    bits: int
    full_scale_V: float
    offset_V: float
    force_mV_N: float
    zero_mV: float
    depth_mm_px: float
    surface_normal: Tuple[float, float, float]
    surface_point_mm: Tuple[float, float, float]
    tip_mm: Tuple[float, float, float]
    cuts: int
    depth_max_mm: float
    force_max_N: float
    newtons: bool  #: the force channel measures N: full_scale_V and offset_V are in N
    streams: Tuple[Stream, ...]


def _values(struct: ctypes.Structure, names: Tuple[str, ...]) -> Iterator[Any]:
    for name in names:
        value = getattr(struct, name)
        if isinstance(value, bytes):
            value = text(value)
        elif isinstance(value, ctypes.Array) and not isinstance(value, bytes):
            value = tuple(value)
        yield value


class Frame(NamedTuple):
    """A frame of the camera."""

    t_ns: int  #: middle of the exposure, CLOCK_MONOTONIC
    seq: int  #: a gap is a lost frame
    image: Any  #: numpy array of bytes: height × width × 3 (red first), or height × width


def _pixels(frame: FrameStruct) -> Any:
    """The frame as an array of its own."""
    import numpy

    data = numpy.frombuffer(ctypes.string_at(frame.data, frame.size), numpy.uint8)
    if frame.pixels == 3:  # MJPEG
        import io

        try:
            from PIL import Image
        except ImportError:
            raise NotFound(
                errno.ENOENT,
                "frames are JPEG, which Pillow decodes; install python3-pil, or pip install pillow",
            ) from None
        return numpy.asarray(Image.open(io.BytesIO(data.tobytes())).convert("RGB"))
    rows = data.reshape(frame.height, frame.stride)
    if frame.pixels == 0:
        return rows[:, : 3 * frame.width].reshape(frame.height, frame.width, 3).copy()
    if frame.pixels == 1:
        return rows[:, : frame.width].copy()
    # YUYV of BT.601 with luma from 16 to 235, as cameras send it
    pairs = rows[:, : 2 * frame.width].reshape(frame.height, frame.width // 2, 4).astype(float)
    y = pairs[:, :, (0, 2)].reshape(frame.height, frame.width) - 16
    u, v = (numpy.repeat(pairs[:, :, i] - 128, 2, axis=1) for i in (1, 3))
    rgb = (1.164 * y + 1.596 * v, 1.164 * y - 0.813 * v - 0.392 * u, 1.164 * y + 2.017 * u)
    return numpy.rint(numpy.clip(numpy.stack(rgb, axis=2), 0, 255)).astype(numpy.uint8)


def load_calibration(path: Optional[PathLike]) -> CalibrationStruct:
    """Read a calibration.conf; None: the nominal values of Song et al. (2006)."""
    calibration = CalibrationStruct()
    function("incise_calibration_nominal")(ctypes.byref(calibration))
    if path is not None:
        failure = Failure()
        failure.check(
            function("incise_calibration_load")(
                _library.path_bytes(path), ctypes.byref(calibration), failure.ref
            )
        )
    return calibration


def _uncertainty(word: str) -> int:
    words = ("none", "total", "parts")
    if word not in words:
        raise Invalid(
            errno.EINVAL, f"uncertainty: expected none, total or parts, found {word!r}"
        )
    return words.index(word)


class Recording:
    """A recording, opened with :func:`incise.open`.

    Its tables (:class:`incise.Table`) read by connections of their own: they may be read at the
    same time, in several threads, and after :meth:`close`. Of a recording that is being written they
    have the rows up to the last commit.
    """

    def __init__(
        self,
        path: PathLike,
        calibration: Optional[PathLike] = None,
        damaged: bool = False,
    ):
        self._pointer: Optional[int] = None
        self._lock = threading.Lock()
        self._process = os.getpid()
        self._damaged = damaged
        self._checked = False
        self._frames: Optional[int] = None
        self._start_ns: Optional[int] = None
        self._calibration = load_calibration(calibration) if calibration is not None else None
        self._calibration_path = (
            _library.path_bytes(calibration) if calibration is not None else None
        )
        self.path = os.fspath(path)
        failure = Failure()
        self._pointer = failure.require(
            function("incise_recording_open")(_library.path_bytes(path), failure.ref)
        )

    def __repr__(self) -> str:
        return f"<incise.Recording {self.path}{'' if self._pointer else ', closed'}>"

    def __reduce__(self) -> Any:
        raise TypeError("a Recording cannot be copied or pickled; open it again")

    def __enter__(self) -> "Recording":
        return self

    def __exit__(self, *exception: Any) -> None:
        self.close()

    def __del__(self) -> None:
        if getattr(self, "_pointer", None) and self._process == os.getpid():
            self.close()

    def close(self) -> None:
        """Close it; again is harmless."""
        with self._lock:
            if self._pointer and self._process == os.getpid():
                function("incise_frame_reader_free")(self._frames)
                function("incise_recording_close")(self._pointer)
            self._pointer = self._frames = None

    def _open(self) -> int:
        if self._process != os.getpid():
            raise Invalid(
                errno.EINVAL,
                f"{self.path}: was opened by process {self._process} before a fork; open it again "
                "in this one",
            )
        if not self._pointer:
            raise Invalid(errno.EINVAL, f"{self.path}: is closed; open it again")
        return self._pointer

    @property
    def info(self) -> Info:
        """Rows, losses, calibration, and streams with their times; of a complete recording from its summary."""
        failure, struct = Failure(), RecordingInfo()
        with self._lock:
            failure.check(
                function("incise_recording_info")(
                    self._open(), ctypes.byref(struct), failure.ref
                )
            )
        streams = tuple(
            Stream(*_values(struct.streams[i], Stream._fields)) for i in range(struct.n_streams)
        )
        return Info(*_values(struct, Info._fields[:-1]), streams)

    @property
    def wall(self) -> Optional[Wall]:
        """TAI and UTC of its times, with bounds; None without wall time, as of a simulated clock."""
        failure = Failure()
        with self._lock:
            return read_wall(self._open(), failure)

    def frame(self, t: float) -> Frame:
        """The frame nearest to t, in seconds since the first force sample (as the column t_s); needs
        numpy, and Pillow for a camera that sends JPEG. Going forward is quick."""
        if self._start_ns is None:
            self._start_ns = self.info.start_ns
        start_ns = self._start_ns
        failure, frame = Failure(), FrameStruct()
        with self._lock:
            recording = self._open()
            if self._frames is None:
                self._frames = failure.require(
                    function("incise_frame_reader_new")(recording, failure.ref)
                )
            failure.check(
                function("incise_frame_reader_at")(
                    self._frames, start_ns + round(t * 1e9), ctypes.byref(frame), failure.ref
                )
            )
            return Frame(frame.t_ns, frame.seq, _pixels(frame))

    # --- tables --------------------------------------------------------------------------

    def _check(self) -> None:
        """Compare the rows with the ledger, once, unless damaged rows were asked for."""
        if self._checked or self._damaged:
            return
        from .verify import check_rows

        check_rows(self.path)
        self._checked = True

    def _table(self, what: str, about: str, **options: Any) -> Table:
        with self._lock:
            self._open()
        struct = ExportOptions()
        function("incise_export_options_init")(ctypes.byref(struct))
        for name, value in options.items():
            try:
                setattr(struct, name, value)
            except TypeError as failure:
                raise Invalid(errno.EINVAL, f"{name}: {failure}") from None
        if self._calibration is not None:
            struct.calibration = ctypes.pointer(self._calibration)
            struct.calibration_path = self._calibration_path
        path = _library.path_bytes(self.path)

        def open_stream(stream: ArrowArrayStream) -> None:
            self._check()
            failure = Failure()
            recording = failure.require(function("incise_recording_open")(path, failure.ref))
            try:
                failure.check(
                    function("incise_recording_stream")(
                        recording,
                        what.encode(),
                        ctypes.byref(struct),
                        ctypes.byref(stream),
                        failure.ref,
                    )
                )
            finally:
                function("incise_recording_close")(recording)

        return Table._of(open_stream, f"{about} of {self.path}")

    @property
    def force(self) -> Table:
        """Force samples: seq, t_ns, code, force_N, clipped."""
        return self._table("force", "force")

    @property
    def tracker(self) -> Table:
        """Poses as received, without the calibrated tip: seq, t_ns, arrival_ns, x_mm, y_mm, z_mm,
        qw, qx, qy, qz, status, station, button."""
        return self._table("tracker", "tracker")

    @property
    def depth(self) -> Table:
        """Depth of the tip by the tracker: seq, t_ns, depth_mm, velocity_mm_s."""
        return self._table("depth", "depth")

    @property
    def frames(self) -> Table:
        """Frames of the camera: seq, t_ns, arrival_ns, pts, bytes, and what vision saw or null:
        length_px, sd_px, depth_mm, quality."""
        return self._table("frames", "frames")

    @property
    def events(self) -> Table:
        """Events and marks: t_ns, kind, text."""
        return self._table("events", "events")

    def pairs(
        self,
        depth_bins: int = 0,
        velocity_bins: int = 0,
        by_cut: bool = False,
        rate_hz: float = 0,
        min_count: int = 50,
        depth_max_mm: float = 0,
        velocity_max_mm_s: float = 0,
        tai: bool = False,
        uncertainty: str = "none",
        from_s: float = 0,
        to_s: float = 0,
        cut: int = 0,
    ) -> Table:
        """Force with depth and velocity inside the cuts, as `incise export` gives them.

        Without bins every force sample, or with rate_hz means over 1/rate_hz: cut, t_s, depth_mm,
        velocity_mm_s, force_N, clipped, advancing, acceleration_mm_s2, tilt_deg, time_in_tissue_s.
        With bins of depth and velocity (both) the means of each bin with min_count samples or more:
        [cut,] depth_mm, velocity_mm_s, force_N, sd_N, count, cuts, advancing, and the last three.
        With tai, rows without bins end with tai_ns and tai_u_ns, the bound of its error.
        With uncertainty "total" or "parts" there are columns of standard uncertainties, see
        incise-export(1); which are of force_N, table.fields says in uncertainty_variables.
        With from_s, to_s (seconds from the first sample; 0: to the end) or a cut's number, from 1, only that part
        is read.
        """
        return self._table(
            "table",
            "pairs",
            depth_bins=depth_bins,
            velocity_bins=velocity_bins,
            by_cut=by_cut,
            rate_hz=rate_hz,
            min_count=min_count,
            depth_max_mm=depth_max_mm,
            velocity_max_mm_s=velocity_max_mm_s,
            tai=tai,
            uncertainty=_uncertainty(uncertainty),
            from_s=from_s,
            to_s=to_s,
            cut=cut,
        )

    def resample(
        self,
        rate_hz: float = 0,
        tai: bool = False,
        uncertainty: str = "none",
        from_s: float = 0,
        to_s: float = 0,
    ) -> Table:
        """All of the recording on one grid of rate_hz, or at each force sample: force, pose, depth,
        velocity and camera, with standard uncertainties; with tai also tai_ns and tai_u_ns.

        Without uncertainty "total" or "parts", those are of noise and time alone.
        With from_s and to_s, seconds from the first sample, only that part is read.
        """
        return self._table(
            "table",
            "resampled rows",
            rate_hz=rate_hz,
            resample=True,
            tai=tai,
            uncertainty=_uncertainty(uncertainty),
            from_s=from_s,
            to_s=to_s,
        )


def open(  # the name that every reader of files has
    path: PathLike, calibration: Optional[PathLike] = None, damaged: bool = False
) -> Recording:
    """Open a recording, NAME.rec; of an interrupted one, NAME.rec.part.

    calibration: a calibration.conf in place of the recording's own. damaged: do not compare rows
    with the ledger, which otherwise happens once before the first table is read.
    """
    return Recording(path, calibration, damaged)
