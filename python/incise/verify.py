# SPDX-License-Identifier: LGPL-2.1-or-later
"""Proof that a recording is complete: its rows and frames compared with its ledger."""

from __future__ import annotations

import ctypes
import errno
import os
from typing import Any, List, NamedTuple, Optional, Tuple, Union

from . import _library
from ._library import Failure, Invalid, c_bool, c_char, c_char_p, c_int, c_int64, c_uint64, c_void_p
from ._library import function, text

KINDS = (
    "lost",
    "altered",
    "ledger",
    "extra",
    "count",
    "interrupted",
    "frames",
    "unverified",
    "damaged",
    "ended",
    "times",
)
# Findings by which rows are not those that were recorded; a loss was counted while recording.
_NOT_RECORDED = ("altered", "ledger", "extra", "count", "damaged")


class FindingStruct(ctypes.Structure):
    """struct incise_verify_finding"""

    _fields_ = [
        ("kind", c_int),
        ("stream", c_char_p),
        ("first_block", c_int64),
        ("last_block", c_int64),
        ("first_seq", c_int64),
        ("last_seq", c_int64),
        ("first_ns", c_int64),
        ("last_ns", c_int64),
        ("count", c_uint64),
        ("text", c_char_p),
    ]
    c_name = "struct incise_verify_finding"


class StreamStruct(ctypes.Structure):
    """struct incise_verify_stream"""

    _fields_ = [
        ("name", c_char * 16),
        ("expected", c_uint64),
        ("present", c_uint64),
        ("lost", c_uint64),
        ("lost_at_capture", c_uint64),
        ("blocks", c_uint64),
        ("altered", c_uint64),
    ]
    c_name = "struct incise_verify_stream"


class FramesStruct(ctypes.Structure):
    """struct incise_verify_frames"""

    _fields_ = [
        ("checked", c_bool),
        ("present", c_uint64),
        ("missing", c_uint64),
        ("altered", c_uint64),
        ("extra", c_uint64),
        ("ahead", c_uint64),
    ]
    c_name = "struct incise_verify_frames"


class ReportStruct(ctypes.Structure):
    """struct incise_verify_report"""

    _fields_ = [
        ("complete", c_bool),
        ("intact", c_bool),
        ("unverified", c_bool),
        ("interrupted", c_bool),
        ("findings", c_uint64),
        ("n_streams", c_int),
        ("streams", StreamStruct * 3),
        ("frames", FramesStruct),
        ("sealed", ctypes.c_bool),
        ("commits", ctypes.c_uint64),
    ]
    c_name = "struct incise_verify_report"


_Found = ctypes.CFUNCTYPE(None, c_void_p, ctypes.POINTER(FindingStruct))
_Progress = ctypes.CFUNCTYPE(c_int, c_void_p, ctypes.c_double)


class WatchStruct(ctypes.Structure):
    """struct incise_verify_watch"""

    _fields_ = [("found", _Found), ("progress", _Progress), ("user", c_void_p)]
    c_name = "struct incise_verify_watch"


_library.declare(
    "libincise-record",
    {
        name: (
            c_int,
            c_char_p,
            ctypes.POINTER(WatchStruct),
            ctypes.POINTER(ReportStruct),
            c_void_p,
        )
        for name in ("incise_verify", "incise_verify_rows")
    },
)


class Finding(NamedTuple):
    """One finding and its place."""

    kind: str  #: one of incise.verify.KINDS
    stream: str  #: force, tracker, camera; empty: all
    first_seq: int
    last_seq: int  #: below first_seq: not known
    count: int  #: of samples, rows or blocks
    text: str  #: all that in one line


class StreamReport(NamedTuple):
    """One stream of a recording."""

    name: str
    expected: int  #: samples from the first to the last one
    present: int  #: rows
    lost: int
    lost_at_capture: int  #: of these, those in the ledger
    altered: int  #: blocks of the ledger that do not agree with the rows


class Report(NamedTuple):
    """All findings of :func:`incise.verify`."""

    complete: bool  #: closed, nothing lost, nothing altered
    intact: bool  #: all that was committed is there and unaltered
    unverified: bool  #: something could not be checked
    interrupted: bool  #: not closed, or being written
    streams: Tuple[StreamReport, ...]
    findings: Tuple[Finding, ...]


def _run(name: str, path: Union[str, "os.PathLike[str]"]) -> Report:
    found: List[Finding] = []
    stop: List[bool] = []
    failure, report = Failure(), ReportStruct()

    def on_found(user: Any, pointer: Any) -> None:
        finding = pointer.contents
        found.append(
            Finding(
                KINDS[finding.kind],
                text(finding.stream or b""),
                finding.first_seq,
                finding.last_seq,
                finding.count,
                text(finding.text or b""),
            )
        )

    watch = WatchStruct(_Found(on_found), _Progress(lambda user, share: len(stop)), None)
    call = function(name)
    rc = _library.call_interruptible(
        lambda: call(
            _library.path_bytes(path), ctypes.byref(watch), ctypes.byref(report), failure.ref
        ),
        lambda: stop.append(True),
    )
    failure.check(rc)
    streams = tuple(
        StreamReport(
            text(stream.name),
            stream.expected,
            stream.present,
            stream.lost,
            stream.lost_at_capture,
            stream.altered,
        )
        for stream in report.streams[: report.n_streams]
    )
    return Report(
        report.complete,
        report.intact,
        report.unverified,
        report.interrupted,
        streams,
        tuple(found),
    )


def verify(path: Union[str, "os.PathLike[str]"]) -> Report:
    """Verify a recording, rows and frames, as `incise verify` does. Ctrl-C ends it."""
    return _run("incise_verify", path)


def check_rows(path: Union[str, "os.PathLike[str]"]) -> None:
    """Raise :class:`incise.Invalid` unless the rows are those that were recorded."""
    first: Optional[Finding] = None
    report = _run("incise_verify_rows", path)
    for finding in report.findings:
        if finding.kind in _NOT_RECORDED and first is None:
            first = finding
    if first is not None:
        raise Invalid(
            errno.EINVAL,
            f"{os.fspath(path)}: is not what was recorded: {first.text}; incise.verify() says all; "
            "damaged=True takes it as it is",
        )
