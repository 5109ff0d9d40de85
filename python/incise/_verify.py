# SPDX-License-Identifier: LGPL-2.1-or-later
"""Proof that a recording is complete, and who vouches for it."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
from typing import Any, Iterator, List, NamedTuple, Optional, Tuple

from . import _library
from ._library import Invalid, PathLike, c_char_p, c_int, c_void_p, call, function, text, values

KINDS = """
    lost altered ledger extra count interrupted frames unverified damaged ended times seal
""".split()
VERDICTS = ("unchecked", "good", "bad")
_ROWS, _ALL = 2, 3  # enum incise_prove_level


FindingStruct, StreamStruct, FramesStruct, ReportStruct = _library.structs("""
    struct incise_verify_finding {
        int kind;
        const char *stream;
        int64_t first_block, last_block, first_seq, last_seq, first_ns, last_ns;
        uint64_t count;
        const char *text;
    };
    struct incise_verify_stream {
        char name[16];
        uint64_t expected, present, lost, lost_at_capture, blocks, altered;
    };
    struct incise_verify_frames {
        bool checked;
        uint64_t present, missing, altered, extra, ahead;
    };
    struct incise_verify_report {
        bool complete, intact, unverified, interrupted;
        uint64_t findings;
        int n_streams;
        struct incise_verify_stream streams[3];
        struct incise_verify_frames frames;
        bool sealed;
        uint64_t commits;
    };
    """)


_Found = ctypes.CFUNCTYPE(None, c_void_p, ctypes.POINTER(FindingStruct))
_Progress = ctypes.CFUNCTYPE(c_int, c_void_p, ctypes.c_double)


(WatchStruct,) = _library.structs(
    """
    struct incise_verify_watch {
        _Found found;
        _Progress progress;
        void *user;
    };
    """,
    _Found=_Found,
    _Progress=_Progress,
)


_Write = ctypes.CFUNCTYPE(c_int, c_void_p, c_char_p)


OptionsStruct, VoucherStruct, HeadStruct, SealStruct, ProofStruct = _library.structs(
    """
    struct incise_prove_options {
        int level;
        const char *signers, *revoked, *authorities;
        struct incise_verify_watch *watch;
        const char *key, *timestamp;
        bool recorded, renew;
        _Write write;
        void *user;
    };
    struct incise_proof_voucher {
        char file[100];
        int kind, statement, verdict;
        bool made;
        char by[300], key[160], utc[32];
        int64_t t_s;
        char why[500];
    };
    struct incise_seal_head {
        int64_t commit, t_ns;
        char head[65];
    };
    struct incise_proof_seal {
        const char *path;
        bool join;
        char identity[33];
        struct incise_seal_head head;
        char why[200];
        int n_statements, n_vouchers;
        void *statements;
        struct incise_proof_voucher *vouchers;
        int signatures, timestamps;
        bool vouched;
        int bad;
    };
    struct incise_proof {
        struct incise_verify_report report;
        char altered[400];
        int n;
        struct incise_proof_seal *seals;
    };
    """,
    _Write=_Write,
)


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
def _proved(path: PathLike, level: int, found: List[Finding], *trust: Any) -> Iterator[ProofStruct]:
    """The proof of incise_prove(). Ctrl-C ends it."""
    stop: List[bool] = []

    def on_found(user: Any, pointer: Any) -> None:
        finding = pointer.contents
        found.append(Finding(KINDS[finding.kind], *values(finding, Finding._fields[1:])))

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
        Voucher(*values(one, Voucher._fields))._replace(verdict=VERDICTS[one.verdict])
        for one in seal.vouchers[: seal.n_vouchers]
    )
    return Seal(text(seal.path), seal.vouched, seal.bad, vouchers)


def verify(
    path: PathLike,
    signers: Optional[PathLike] = None,
    revoked: Optional[PathLike] = None,
    authorities: Optional[PathLike] = None,
) -> Report:
    """Verify a recording as `incise verify` does, with its options --signers, --revoked and --ca."""
    found: List[Finding] = []
    with _proved(path, _ALL, found, signers, revoked, authorities) as proof:
        report = proof.report
        streams = report.streams[: report.n_streams]
        return Report(
            *values(report, Report._fields[:4]),
            tuple(StreamReport(*values(stream, StreamReport._fields)) for stream in streams),
            tuple(found),
            tuple(_seal(seal) for seal in proof.seals[: proof.n]),
        )


def check_rows(path: PathLike) -> None:
    """Raise :class:`incise.Invalid` unless the rows are those that were recorded."""
    with _proved(path, _ROWS, []) as proof:
        altered = text(proof.altered)
    if altered:
        raise Invalid(
            errno.EINVAL,
            f"{os.fspath(path)}: is not what was recorded: {altered}; incise.verify() says all; "
            "damaged=True takes it as it is",
        )
