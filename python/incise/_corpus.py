# SPDX-License-Identifier: LGPL-2.1-or-later
"""Training from many sources, each read twice and never held in memory; see incise/corpus.h.

C reads a source by a callback, once per pass: the callback opens the stream, and hands C's own
function that takes a row to C's reader. No row passes through Python.
"""

from __future__ import annotations

import ctypes
import errno
import hashlib
import os
import re
from typing import Any, List, Optional, Sequence

from . import _library
from ._library import ArrowArrayStream, Failure, Invalid, c_bool, c_char_p, c_double, c_int
from ._library import c_uint64, c_void_p, function
from ._producer import open_stream
from .model import Model, PairsStruct, SideStruct, TrainOptionsStruct, TrainReport
from .model import TrainReportStruct, VariableStruct, all_sums, baselines, name_array, start
from .model import has_cuts, is_path, is_recording, report_of
from .recording import Recording

TEXT_MAX = 1000  # INCISE_FACTOR_TEXT_MAX
ORIGINS = 480  # bytes of a recording's origins in its text, as in tools/train/sources.c
_ORIGIN = re.compile(
    rb"incise:([1-9]):([a-z]{1,15}:[0-9a-f]{64}:[0-9]+:[-0-9A-Za-z]+:[-0-9A-Za-z._~%]+;)"
)
SAMPLE = 20000  # INCISE_CORPUS_SAMPLE

_Read = ctypes.CFUNCTYPE(c_int, c_void_p, c_void_p, c_void_p, c_void_p)


def _without_choice(path: bytes) -> bytes:
    """ "day.rec" of "day.rec:a", a joined recording with a choice of its machines."""
    folder, _, name = path.rpartition(b"/")
    if b":" not in name or os.path.exists(path):
        return path
    return os.path.join(folder, name.rpartition(b":")[0])


class SourceStruct(ctypes.Structure):
    """struct incise_corpus_source"""

    _fields_ = [
        ("name", c_char_p),
        ("hash", c_char_p),
        ("text", c_char_p),
        ("group", c_char_p),
        ("own_groups", c_bool),
        ("read", _Read),
        ("user", c_void_p),
        ("calibration", c_char_p),
    ]
    c_name = "struct incise_corpus_source"


class CorpusSideStruct(ctypes.Structure):
    """struct incise_corpus_side"""

    _fields_ = [
        ("sample", SideStruct),
        ("rows", c_uint64),
        ("different", c_uint64),
        ("n_groups", c_int),
    ]
    c_name = "struct incise_corpus_side"


_source = ctypes.POINTER(SourceStruct)
_rows = (  # the end of the arguments of both readers
    ctypes.POINTER(c_char_p),
    c_int,
    c_char_p,
    c_char_p,
    c_void_p,
    c_void_p,
    ctypes.POINTER(c_uint64),
    c_void_p,
)
_library.declare(
    "libincise-learn",
    {
        "incise_dataset_each": (c_int, c_char_p, *_rows),
        "incise_dataset_each_arrow": (c_int, ctypes.POINTER(ArrowArrayStream), *_rows),
        "incise_file_sha256": (c_int, c_char_p, c_char_p, c_void_p),
        "incise_corpus_new": (c_void_p, c_int, c_bool, c_uint64, ctypes.c_size_t),
        "incise_corpus_free": (None, c_void_p),
        "incise_corpus_set_stop": (None, c_void_p, ctypes.POINTER(c_int)),
        "incise_corpus_survey": (c_int, c_void_p, _source, c_void_p),
        "incise_corpus_settle": (c_int, c_void_p, c_double, c_void_p),
        "incise_corpus_side": (ctypes.POINTER(CorpusSideStruct), c_void_p, c_bool),
        "incise_corpus_ranges": (None, c_void_p, c_void_p, c_void_p),
        "incise_corpus_fold": (
            c_int, c_void_p, _source, c_void_p, c_void_p, c_void_p, c_void_p
        ),
        "incise_factor_new": (c_void_p, c_void_p, c_void_p),
        "incise_factor_free": (None, c_void_p),
        "incise_factor_set_options": (None, c_void_p, c_char_p),
        "incise_factor_notes": (c_void_p, c_void_p),
        "incise_factor_rmse": (c_double, c_void_p, c_void_p, c_void_p),
    },
)


def _sha256(path: bytes) -> bytes:
    failure, digest = Failure(), ctypes.create_string_buffer(65)
    failure.check(function("incise_file_sha256")(path, digest, failure.ref))
    return digest.value


def _origins_of_file(path: bytes) -> List[bytes]:
    """Those in the comments at the start of a CSV file, one deeper; see incise/origin.h."""
    found: List[bytes] = []
    with open(path, "rb") as file:
        for line in file:
            if not line.startswith(b"#"):
                break
            for depth, rest in _ORIGIN.findall(line):
                origin = b"incise:%d:%s" % (int(depth) + 1, rest)
                if depth < b"9" and origin not in found:
                    found.append(origin)
    return found


class Source:
    """A CSV file, a recording, or a table, as incise_corpus_source; close() it."""

    def __init__(self, given: Any, place: int):
        self.name = f"source {place}"
        named = isinstance(given, tuple) and len(given) == 2 and isinstance(given[0], str)
        if named:
            self.name, given = given
            if not self.name or not self.name.isprintable():
                raise Invalid(errno.EINVAL, f"name {self.name!r}: give a name of one line")
        if is_recording(given):
            given = Recording(os.fsdecode(given))
        self.path: Optional[bytes] = None
        self.recording = given if isinstance(given, Recording) else None
        self.table = self.recording.pairs() if self.recording else given
        if self.recording:
            self.path = _library.path_bytes(self.recording.path)
        elif is_path(given):
            self.path = _library.path_bytes(given)
            if self.path == b"-" or (os.path.exists(self.path) and not os.path.isfile(self.path)):
                raise Invalid(
                    errno.EINVAL,
                    f"{os.fsdecode(self.path)}: is no file, and each source is read twice; "
                    "save it as a file, or read it into a table",
                )
        self.is_table = self.path is None
        if self.path is not None:
            if named:
                raise Invalid(
                    errno.EINVAL,
                    f"{os.fsdecode(self.path)}: has the name {self.name!r}; leave the name out, "
                    "files go by their content",
                )
            self.name = os.fsdecode(self.path)
        self.failure: Optional[BaseException] = None
        self.left_out = 0

    def prepare(self, columns: Any, group: Optional[str], where: Optional[str]) -> None:
        """Hash it, and fill in the struct; the text is that of incise train."""
        rig = b""
        if self.is_table:
            text = self.name.encode()[:300]
            digest = hashlib.sha256(self.name.encode()).hexdigest().encode()
        elif self.recording:
            info = self.recording.info
            rig = info.rig.encode()
            origins = self.recording._origins(ORIGINS)
            text = (
                b"%.100s, %s%srecorded %s, rig %.120s, force %.9g mV/N, zero %.9g mV, camera %.9g mm/px"
                % (
                    os.path.basename(self.path.rstrip(b"/")),
                    origins,
                    b", " if origins else b"",
                    info.started.encode(),
                    rig,
                    info.force_mV_N,
                    info.zero_mV,
                    info.depth_mm_px,
                )
            )
            if self.recording._calibration is not None:
                text += b", read with another calibration"
            digest = _sha256(os.path.join(_without_choice(self.path), b"recording.db"))
        else:
            text = os.path.basename(self.path)[:300]
            digest = _sha256(self.path)
            between = b", "
            for origin in _origins_of_file(self.path):
                if len(text) + len(origin) + 2 >= TEXT_MAX:
                    break
                text += between + origin
                between = b" "
        # A group of all rows; else the text of a column.
        whole = {"recording": digest, "rig": rig if self.recording else None}.get(group or "")
        self.rows = (
            columns,
            len(columns),
            group.encode() if group and whole is None else None,
            where.encode() if where else None,
        )
        self.struct: Optional[SourceStruct] = SourceStruct(
            os.fsencode(self.name), digest, text, whole, group == "cut", _Read(self._read)
        )

    def close(self) -> None:
        """Break the cycle of the callback, which would keep the table."""
        self.struct = None

    def _read(self, _user: int, take: int, taker: int, _error: int) -> int:
        try:
            self._pass_rows(take, taker)
            return 0
        except BaseException as failure:  # raised again by check()
            self.failure = failure
            return -errno.EIO

    def _pass_rows(self, take: int, taker: int) -> None:
        failure, left_out = Failure(), c_uint64()
        rest = (*self.rows, take, taker, ctypes.byref(left_out), failure.ref)
        if self.path is not None and not self.recording:
            rc = function("incise_dataset_each")(self.path, *rest)
        else:
            table = self.table
            if callable(table) and not hasattr(table, "__arrow_c_stream__"):
                table = table()
            stream, keep = open_stream(table)
            rc = function("incise_dataset_each_arrow")(ctypes.byref(stream), *rest)
            del keep
        self.left_out = left_out.value
        if rc:
            raise _library.make_error(-rc, self._line(str(failure.exception(-rc))))

    def _line(self, line: str) -> str:
        return line if line.startswith(self.name) else f"{self.name}: {line}"

    def check(self, rc: int, failure: Failure) -> None:
        """Raise what ended its reading, or the error of C."""
        raised, self.failure = self.failure, None
        if raised is not None:
            raise raised
        failure.check(rc)


class Corpus:
    """A training from sources; frees what it holds."""

    def __init__(
        self, given: Sequence[Any], columns: List[str], group: Optional[str], all_rows: bool
    ):
        self.sources = [Source(source, place) for place, source in enumerate(given, 1)]
        names = [source.name for source in self.sources if source.is_table]
        for name in names:
            if names.count(name) > 1:
                raise Invalid(
                    errno.EINVAL, f"name {name!r}: is given twice; give each table its own"
                )
        if group is None and self.sources and all(
            source.recording or has_cuts(source.path or source.table) for source in self.sources
        ):
            group = "cut"
        group = None if group == "none" else group
        self.columns, self.group, self.all_rows = columns, group, all_rows
        self.stop = c_int(0)
        self.failure = Failure()
        self.raised: Optional[BaseException] = None
        self.corpus = self.sums = self.held = None

    def close(self) -> None:
        for source in self.sources:
            source.close()
        self.corpus = self.sums = self.held = None

    def survey(self, share: float, seed: int) -> None:
        self.corpus = _library.Handle(
            self.failure.require(
                function("incise_corpus_new")(
                    len(self.columns) - 1, bool(self.group), seed, SAMPLE
                )
            ),
            "incise_corpus_free",
        )
        function("incise_corpus_set_stop")(self.corpus, ctypes.pointer(self.stop))
        names, where = name_array(self.columns), None if self.all_rows else "advancing"
        for source in self.sources:
            source.prepare(names, self.group, where)
            source.check(
                function("incise_corpus_survey")(
                    self.corpus, ctypes.byref(source.struct), self.failure.ref
                ),
                self.failure,
            )
        self.failure.check(
            function("incise_corpus_settle")(self.corpus, share, self.failure.ref)
        )
        self.share = share
        self.how = f"groups: {self.group or 'none'}" + ", all rows" * self.all_rows
        if share:
            self.how += f", {share:g} held out with seed {seed}"
        side = function("incise_corpus_side")
        self.fit, self.check = (side(self.corpus, check).contents for check in (False, True))

    def start(self, mf_type: int, counts: Any, options: TrainOptionsStruct) -> Model:
        n = len(self.columns)
        ends = (c_double * n)(), (c_double * n)()
        function("incise_corpus_ranges")(self.corpus, *ends)
        options.ranges = (VariableStruct * n)(*((b"", *range_) for range_ in zip(*ends)))
        options.groups = self.fit.sample.groups
        return Model._of(start(self.fit.sample.pairs, self.columns, mf_type, counts, options))

    def _factor(self, premises: int) -> _library.Handle:
        factor = self.failure.require(
            function("incise_factor_new")(premises, self.failure.ref)
        )
        function("incise_factor_set_options")(factor, self.how.encode())
        return _library.Handle(factor, "incise_factor_free")

    def _sums(self, _user: int, premises: int) -> Optional[int]:
        """The second pass."""
        try:
            self.sums = self._factor(premises)
            self.held = self._factor(premises) if self.share else None
            for source in self.sources:
                source.check(
                    function("incise_corpus_fold")(
                        self.corpus,
                        ctypes.byref(source.struct),
                        self.sums,
                        self.held,
                        None,
                        self.failure.ref,
                    ),
                    self.failure,
                )
            return self.sums._as_parameter_
        except BaseException as failure:  # raised again by run()
            self.raised = failure
            return None

    def run(self, model: Model, options: TrainOptionsStruct) -> TrainReport:
        report, uncertainty = TrainReportStruct(), c_void_p()
        options.uncertainty = ctypes.pointer(uncertainty)
        options.all = all_sums(self._sums)
        has_check = self.check.sample.pairs.n > 0
        rc = function("incise_train")(
            model._pointer,
            ctypes.byref(self.fit.sample.pairs),
            ctypes.byref(self.check.sample.pairs) if has_check else None,
            ctypes.byref(options),
            ctypes.byref(report),
            self.failure.ref,
        )
        options.all = all_sums()
        raised, self.raised = self.raised, None
        if raised is not None:
            raise raised
        self.failure.check(rc)
        model._set_uncertainty(uncertainty.value)
        if self.held:
            report.check_rmse = function("incise_factor_rmse")(
                self.held,
                model._pointer,
                ctypes.byref(report, TrainReportStruct.check_r2.offset),
            )
        model._notes = _library.owned_bytes(function("incise_factor_notes")(self.sums))
        return report_of(
            report,
            self.fit.rows,
            self.check.rows,
            sum(source.left_out for source in self.sources),
            baselines(self.fit.sample, self.check.sample) if has_check else {},
        )


def train_sources(
    given: Sequence[Any],
    columns: List[str],
    options: TrainOptionsStruct,
    group: Optional[str],
    check: float,
    all_rows: bool,
    mf_type: int,
    counts: Any,
) -> Model:
    """incise.train() of a list."""
    if options.classic:
        raise Invalid(
            errno.EINVAL, "classic keeps all pairs in memory; give one table, or leave classic out"
        )
    corpus = Corpus(given, columns, group, all_rows)
    options.stop = ctypes.pointer(corpus.stop)

    def learn() -> Model:
        corpus.survey(check, options.seed)
        model = corpus.start(mf_type, counts, options)
        model.report = corpus.run(model, options)
        return model

    def cancel() -> None:
        corpus.stop.value = 1

    try:
        return _library.call_interruptible(learn, cancel)
    finally:
        corpus.close()
