# SPDX-License-Identifier: LGPL-2.1-or-later
"""Proof that a recording is complete, and who vouches for it."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
from typing import Any, Iterator, List, NamedTuple, Tuple, Union

from . import _library
from ._library import Invalid, Struct, c_bool, c_char, c_char_p, c_int, c_int64, c_uint64, c_void_p
from ._library import call, function, text

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
    "seal",
)
VERDICTS = ("unchecked", "good", "bad")
_ROWS, _ALL = 2, 3  # enum incise_prove_level


class FindingStruct(Struct, of="struct incise_verify_finding"):
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


class StreamStruct(Struct, of="struct incise_verify_stream"):
    _fields_ = [
        ("name", c_char * 16),
        ("expected", c_uint64),
        ("present", c_uint64),
        ("lost", c_uint64),
        ("lost_at_capture", c_uint64),
        ("blocks", c_uint64),
        ("altered", c_uint64),
    ]


class FramesStruct(Struct, of="struct incise_verify_frames"):
    _fields_ = [
        ("checked", c_bool),
        ("present", c_uint64),
        ("missing", c_uint64),
        ("altered", c_uint64),
        ("extra", c_uint64),
        ("ahead", c_uint64),
    ]


class ReportStruct(Struct, of="struct incise_verify_report"):
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


_Found = ctypes.CFUNCTYPE(None, c_void_p, ctypes.POINTER(FindingStruct))
_Progress = ctypes.CFUNCTYPE(c_int, c_void_p, ctypes.c_double)


class WatchStruct(Struct, of="struct incise_verify_watch"):
    _fields_ = [("found", _Found), ("progress", _Progress), ("user", c_void_p)]


_Write = ctypes.CFUNCTYPE(c_int, c_void_p, c_char_p)


class OptionsStruct(Struct, of="struct incise_prove_options"):
    _fields_ = [
        ("level", c_int),
        ("signers", c_char_p),
        ("revoked", c_char_p),
        ("authorities", c_char_p),
        ("watch", ctypes.POINTER(WatchStruct)),
        ("key", c_char_p),
        ("timestamp", c_char_p),
        ("recorded", c_bool),
        ("renew", c_bool),
        ("write", _Write),
        ("user", c_void_p),
    ]


class VoucherStruct(Struct, of="struct incise_proof_voucher"):
    _fields_ = [
        ("file", c_char * 100),
        ("kind", c_int),
        ("statement", c_int),
        ("verdict", c_int),
        ("made", c_bool),
        ("by", c_char * 300),
        ("key", c_char * 160),
        ("utc", c_char * 32),
        ("t_s", c_int64),
        ("why", c_char * 500),
    ]


class HeadStruct(Struct, of="struct incise_seal_head"):
    _fields_ = [("commit", c_int64), ("t_ns", c_int64), ("head", c_char * 65)]


class SealStruct(Struct, of="struct incise_proof_seal"):
    _fields_ = [
        ("path", c_char_p),
        ("join", c_bool),
        ("identity", c_char * 33),
        ("head", HeadStruct),
        ("why", c_char * 200),
        ("n_statements", c_int),
        ("n_vouchers", c_int),
        ("statements", c_void_p),
        ("vouchers", ctypes.POINTER(VoucherStruct)),
        ("signatures", c_int),
        ("timestamps", c_int),
        ("vouched", c_bool),
        ("bad", c_int),
    ]


class ProofStruct(Struct, of="struct incise_proof"):
    _fields_ = [
        ("report", ReportStruct),
        ("altered", c_char * 400),
        ("n", c_int),
        ("seals", ctypes.POINTER(SealStruct)),
    ]


_library.prototypes(
    "libincise-record",
    """
    int incise_prove(const char *path, const struct incise_prove_options *options,
        struct incise_proof *proof, struct incise_error *err);
    void incise_proof_free(struct incise_proof *proof);
    """,
)


class Finding(NamedTuple):
    """One finding and its place."""

    kind: str  #: lost, altered, ledger, extra, count, interrupted, frames, unverified, …
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


class Voucher(NamedTuple):
    """A signature or a time-stamp in the folder seal/ of a recording."""

    file: str
    statement: int  #: number of the statement that it is for
    verdict: str  #: good, bad, or unchecked: without signers or authorities
    by: str  #: signer, or subject of the authority's certificate; empty: not known
    key: str  #: of a signature, kind and fingerprint; empty: not known
    utc: str  #: of a time-stamp; empty: a signature
    why: str  #: of a bad one


class Seal(NamedTuple):
    """Signatures and time-stamps of a recording, of a member of a joined one, or of the join."""

    path: str
    vouched: bool  #: a signer signed what it is now
    bad: int  #: number of vouchers and statements that are not good
    vouchers: Tuple[Voucher, ...]


class Report(NamedTuple):
    """All findings of :func:`incise.verify`."""

    complete: bool  #: closed, nothing lost, nothing altered
    intact: bool  #: all that was committed is there and unaltered
    unverified: bool  #: something could not be checked
    interrupted: bool  #: not closed, or being written
    streams: Tuple[StreamReport, ...]
    findings: Tuple[Finding, ...]
    seals: Tuple[Seal, ...]  #: of the members of a joined recording, then of the join


@contextlib.contextmanager
def _proved(
    path: Union[str, "os.PathLike[str]"], level: int, found: List[Finding], *trust: Any
) -> Iterator[ProofStruct]:
    """What incise_prove() says. Ctrl-C ends it."""
    stop: List[bool] = []

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
    files = [None if file is None else _library.path_bytes(file) for file in trust]
    options = OptionsStruct(level, *files)
    options.watch = ctypes.pointer(watch)
    proof = ProofStruct()
    try:
        _library.call_interruptible(
            lambda: call("incise_prove", _library.path_bytes(path), options, proof),
            lambda: stop.append(True),
        )
        yield proof
    finally:
        function("incise_proof_free")(proof)


def _seal(seal: SealStruct) -> Seal:
    vouchers = tuple(
        Voucher(
            text(one.file),
            one.statement,
            VERDICTS[one.verdict],
            text(one.by),
            text(one.key),
            text(one.utc),
            text(one.why),
        )
        for one in seal.vouchers[: seal.n_vouchers]
    )
    return Seal(text(seal.path), seal.vouched, seal.bad, vouchers)


def verify(
    path: Union[str, "os.PathLike[str]"],
    signers: Union[None, str, "os.PathLike[str]"] = None,
    revoked: Union[None, str, "os.PathLike[str]"] = None,
    authorities: Union[None, str, "os.PathLike[str]"] = None,
) -> Report:
    """Verify a recording as `incise verify` does, with its options --signers, --revoked and --ca."""
    found: List[Finding] = []
    with _proved(path, _ALL, found, signers, revoked, authorities) as proof:
        report = proof.report
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
            tuple(_seal(seal) for seal in proof.seals[: proof.n]),
        )


def check_rows(path: Union[str, "os.PathLike[str]"]) -> None:
    """Raise :class:`incise.Invalid` unless the rows are those that were recorded."""
    with _proved(path, _ROWS, []) as proof:
        altered = text(proof.altered)
    if altered:
        raise Invalid(
            errno.EINVAL,
            f"{os.fspath(path)}: is not what was recorded: {altered}; incise.verify() says all; "
            "damaged=True takes it as it is",
        )
