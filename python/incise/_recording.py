# SPDX-License-Identifier: LGPL-2.1-or-later
"""Recordings: their streams as tables, their pairs for training, and what they say of themselves."""

from __future__ import annotations

import ctypes
import errno
import math
import os
import threading
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

from . import _library
from ._arrow import Table
from ._library import ArrowArrayStream, CalibrationStruct, Error, ExportOptions, FrameStruct
from ._library import Invalid, PathLike, RecordingInfo, call, function, package, values
from ._show import html_table
from ._wall import Wall
from ._wall import read as read_wall

_library.prototypes(
    "libincise-record",
    """
    struct incise_recording *incise_recording_open(const char *path, struct incise_error *err);
    void incise_recording_close(struct incise_recording *recording);
    int incise_recording_info(struct incise_recording *recording,
        struct incise_recording_info *info, struct incise_error *err);
    int incise_recording_stream(struct incise_recording *recording, const char *what,
        const struct incise_export_options *options, struct ArrowArrayStream *stream,
        struct incise_error *err);
    void incise_export_options_init(struct incise_export_options *options);
    struct incise_frame_reader *incise_frame_reader_new(struct incise_recording *recording,
        struct incise_error *err);
    void incise_frame_reader_free(struct incise_frame_reader *reader);
    int incise_frame_reader_at(struct incise_frame_reader *reader, int64_t t_ns,
        struct incise_camera_frame *frame, struct incise_error *err);
    """,
)
_library.prototypes(
    "libincise",
    """
    void incise_calibration_nominal(struct incise_calibration *calibration);
    int incise_calibration_load(const char *path, struct incise_calibration *calibration,
        struct incise_error *err);
    """,
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
    """A recording's own summary."""

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


class Frame(NamedTuple):
    """A frame of the camera."""

    t_ns: int  #: middle of the exposure, CLOCK_MONOTONIC
    seq: int  #: a gap is a lost frame
    image: Any  #: numpy array of bytes: height × width × 3 (red first), or height × width


def _pixels(frame: FrameStruct) -> Any:
    """The frame as an array of its own."""
    numpy = package("numpy", "a frame")
    data = numpy.frombuffer(ctypes.string_at(frame.data, frame.size), numpy.uint8)
    if frame.pixels == 3:  # MJPEG
        import io

        image = package("PIL.Image", "a frame in JPEG")
        return numpy.asarray(image.open(io.BytesIO(data.tobytes())).convert("RGB"))
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
    function("incise_calibration_nominal")(calibration)
    if path is not None:
        call("incise_calibration_load", _library.path_bytes(path), calibration)
    return calibration


def _uncertainty(word: str) -> int:
    words = ("none", "total", "parts")
    if word not in words:
        raise Invalid(errno.EINVAL, f"uncertainty: expected none, total or parts, found {word!r}")
    return words.index(word)


def _words(
    between: Optional[Tuple[float, Optional[float]]] = None, cut: Optional[int] = None
) -> str:
    """A part in words, behind those of what it is a part of; refuses what is none."""
    if between is not None:
        from_s, to_s = _times(*between)
        return f", {from_s} s to {f'{to_s} s' if to_s else 'its end'}"
    if not isinstance(cut, int) or cut < 1:
        raise Invalid(errno.EINVAL, f"cut {cut!r}: cuts have numbers from 1")
    return f", cut {cut}"


def _limit(limits: Dict[str, Any], from_s: float, to_s: float) -> None:
    """Limit a part further; to_s 0: to its end."""
    ends = [end for end in (limits.get("to_s"), to_s) if end]
    limits.update(from_s=max(limits.get("from_s", 0), from_s), to_s=min(ends, default=0))


def _times(from_s: float, to_s: Optional[float]) -> Tuple[float, float]:
    """A part as the library takes it, where 0 stands for the end."""
    try:
        if 0 <= from_s < (math.inf if to_s is None else to_s):
            return from_s, 0 if to_s is None or to_s == math.inf else to_s
    except TypeError:
        pass
    raise Invalid(
        errno.EINVAL,
        f"between({from_s!r}, {to_s!r}): expected seconds, the first before the second",
    )


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
        self._limits: List[Dict[str, Any]] = []  # all of the part that tables are of …
        self._words = ""  # … and their words
        self._calibration = load_calibration(calibration) if calibration is not None else None
        self._calibration_path = (
            _library.path_bytes(calibration) if calibration is not None else None
        )
        self.path = os.fspath(path)
        self._pointer = call("incise_recording_open", _library.path_bytes(path))

    def __repr__(self) -> str:
        try:
            info = self.info
        except Error as failure:
            return f"<incise.Recording {failure}>"
        seconds = (info.end_ns - info.start_ns) * 1e-9
        part = f"{self._words}; the whole" if self._words else ""
        return (
            f"<incise.Recording {self.path}{part}: {info.cuts} cuts in {seconds:.3f} s, rows: "
            f"{info.force} force, {info.tracker} tracker, {info.depth} depth>"
        )

    def _repr_html_(self) -> str:
        header = ("stream", "device", "rows", "lost", "rate / Hz", "jitter / ms")
        rows = (
            (s.name, s.device, s.rows, s.lost, s.rate_hz, s.jitter_ms) for s in self.info.streams
        )
        return html_table(repr(self)[1:-1], header, rows)

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
        struct = RecordingInfo()
        with self._lock:
            call("incise_recording_info", self._open(), struct)
        streams = tuple(
            Stream(*values(struct.streams[i], Stream._fields)) for i in range(struct.n_streams)
        )
        return Info(*values(struct, Info._fields[:-1]), streams)

    @property
    def wall(self) -> Optional[Wall]:
        """TAI and UTC of its times, with bounds; None without wall time, as of a simulated clock."""
        with self._lock:
            return read_wall(self._open())

    def frame(self, t: float) -> Frame:
        """The frame nearest to t, in seconds since the first force sample (as the column t_s); needs
        numpy, and Pillow for a camera that sends JPEG. Going forward is quick."""
        start_ns = self._start()
        frame = FrameStruct()
        with self._lock:
            recording = self._open()
            if self._frames is None:
                self._frames = call("incise_frame_reader_new", recording)
            call("incise_frame_reader_at", self._frames, start_ns + round(t * 1e9), frame)
            return Frame(frame.t_ns, frame.seq, _pixels(frame))

    def _start(self) -> int:
        """The first force sample; of a closed recording, too."""
        if self._start_ns is None:
            with Recording(self.path) as again:
                self._start_ns = again.info.start_ns
        return self._start_ns

    # --- tables --------------------------------------------------------------------------

    def _part(self, **limits: Any) -> "Recording":
        words = self._words + _words(**limits)
        part = Recording(self.path, damaged=self._damaged)
        part._calibration, part._calibration_path = self._calibration, self._calibration_path
        part._limits, part._words = [*self._limits, limits], words
        return part

    def between(self, from_s: float = 0, to_s: Optional[float] = None) -> "Recording":
        """The recording with tables from from_s to before to_s, seconds from its first force sample;
        its info stays that of the whole."""
        return self._part(between=(from_s, to_s))

    def cut(self, number: int) -> "Recording":
        """The recording with the tables of one cut, from 1; its info stays that of the whole."""
        return self._part(cut=number)

    def _span(self, number: int) -> Tuple[float, float]:
        """Begin and end of a cut, in seconds."""
        pairs = self._whole("table", f"pairs of {self.path}", {"cut": number})
        times = [batch.column("t_s") for batch in pairs.batches()]
        return times[0][0], times[-1][-1] + 1e-9

    def plot(self, rate_hz: float = 100) -> Any:
        """Plot force and depth over time, resampled; returns the matplotlib axes."""
        return self.resample(rate_hz=rate_hz).plot("force_N", "depth_mm")

    def _check(self) -> None:
        """Compare the rows with the ledger, once, unless damaged rows were asked for."""
        if self._checked or self._damaged:
            return
        from ._verify import check_rows

        check_rows(self.path)
        self._checked = True

    def _table(self, what: str, about: str, **options: Any) -> Table:
        """A table of the part that the recording is limited to."""
        with self._lock:
            self._open()
        table = self._whole(what, f"{about} of {self.path}", options)
        for limits in self._limits:
            table = table._part(**limits)
        return table

    def _whole(self, what: str, about: str, options: Dict[str, Any]) -> Table:
        def part(
            between: Optional[Tuple[float, Optional[float]]] = None, cut: Optional[int] = None
        ) -> Table:
            limits, label = dict(options), about + _words(between, cut)
            if cut is not None:
                if what == "table" and not options.get("resample"):
                    limits["cut"] = cut
                else:  # only rows of cuts have the number of one
                    _limit(limits, *self._span(cut))
            if between is not None:
                _limit(limits, *_times(*between))
            return self._whole(what, label, limits)

        struct = ExportOptions()
        function("incise_export_options_init")(struct)
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
            recording = call("incise_recording_open", path)
            try:
                call("incise_recording_stream", recording, what.encode(), struct, stream)
            finally:
                function("incise_recording_close")(recording)

        return Table._of(open_stream, about, part, self._start)

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
    ) -> Table:
        """Force with depth and velocity inside the cuts, as `incise export` gives them.

        Without bins every force sample, or with rate_hz means over 1/rate_hz: cut, t_s, depth_mm,
        velocity_mm_s, force_N, clipped, advancing, acceleration_mm_s2, tilt_deg, time_in_tissue_s,
        mean_speed_mm_s, deepest_mm, way_mm.
        With bins of depth and velocity (both) the means of each bin with min_count samples or more:
        [cut,] depth_mm, velocity_mm_s, force_N, sd_N, count, cuts, advancing, and acceleration to deepest.
        With tai, rows without bins end with tai_ns and tai_u_ns, the bound of its error.
        With uncertainty "total" or "parts" there are columns of standard uncertainties, see
        incise-export(1); which are of force_N, table.fields says in uncertainty_variables.
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
        )

    def resample(
        self,
        rate_hz: float = 0,
        tai: bool = False,
        uncertainty: str = "none",
    ) -> Table:
        """All of the recording on one grid of rate_hz, or at each force sample: force, pose, depth,
        velocity and camera, with standard uncertainties; with tai also tai_ns and tai_u_ns.

        Without uncertainty "total" or "parts", those are of noise and time alone.
        """
        return self._table(
            "table",
            "resampled rows",
            rate_hz=rate_hz,
            resample=True,
            tai=tai,
            uncertainty=_uncertainty(uncertainty),
        )


def open(  # the name that every reader of files has
    path: PathLike, calibration: Optional[PathLike] = None, damaged: bool = False
) -> Recording:
    """Open a recording, NAME.rec; of an interrupted one, NAME.rec.part.

    calibration: a calibration.conf in place of the recording's own. damaged: do not compare rows
    with the ledger, which otherwise happens once before the first table is read.
    """
    if _library.path_bytes(path).endswith((b".fis", b".fx")):
        raise Invalid(errno.EINVAL, f"{path}: is a model; incise.load() reads it")
    return Recording(path, calibration, damaged)
