# SPDX-License-Identifier: LGPL-2.1-or-later
"""Training from many sources, each read twice and never held in memory; see incise/corpus.h.

C reads files itself, and tables by a callback that opens their stream: no row passes through Python.
"""

from __future__ import annotations

import ctypes
import errno
import math
import os
from typing import Any, List, Optional, Sequence

from . import _library
from ._library import ArrowArrayStream, Invalid, c_int, c_void_p, call, function
from ._model import (
    Model,
    Stop,
    TrainOptionsStruct,
    has_cuts,
    is_path,
    is_recording,
    name_array,
    report_of,
)
from ._producer import open_stream
from ._recording import Recording

TEXT_MAX = 1000  # INCISE_SOURCE_TEXT

_Stream = ctypes.CFUNCTYPE(c_int, c_void_p, ctypes.POINTER(ArrowArrayStream), c_void_p)


SourceStruct, SourcesOptionsStruct, PropagationReportStruct, TrainedStruct = _library.structs(
    """
    struct incise_train_source {
        const char *name, *path;
        _Stream stream;
        bool cuts;
        const char *hashed, *text, *rig, *calibration;
        void *open, *state, *user;
    };
    struct incise_sources_options {
        const char **columns;
        int n_inputs;
        void *parts;
        int n_parts, n_further;
        const char *group;
        bool all_rows, averaged, smooth;
        double check;
        void *premises;
        int type, n_mfs[8];
        struct incise_train_options train;
        const char *progress;
        void *ranks;
        int end;
    };
    struct incise_propagation_report {
        double own, calibration, rig, weight;
        int recordings, calibrations;
    };
    struct incise_trained {
        void *model, *uncertainty;
        const char *notes;
        struct incise_train_report report;
        struct incise_baselines baselines;
        uint64_t pairs, check_pairs, left_out, repeated, check_outside, clamped;
        const char *group;
        void *initial, *factor, *corpus;
        double noise, coverage, thirds[3], least, end[2], end_bias[2];
        struct incise_propagation_report propagated;
        const char *better;
        double better_rmse;
        bool shared;
    };
    """,
    _Stream=_Stream,
)


_library.prototypes(
    "libincise-record",
    """
    int incise_source_text(const char *path, struct incise_recording *recording, char *text,
        struct incise_error *err);
    """,
)
_library.prototypes(
    "libincise-learn",
    """
    int incise_train_sources(struct incise_train_source *sources, int n,
        const struct incise_sources_options *options, struct incise_trained *trained,
        struct incise_error *err);
    void incise_trained_free(struct incise_trained *trained);
    """,
)


def _without_choice(path: bytes) -> bytes:
    """ "day.rec" of "day.rec:a", a joined recording with a choice of its machines."""
    folder, _, name = path.rpartition(b"/")
    if b":" not in name or os.path.exists(path):
        return path
    return os.path.join(folder, name.rpartition(b":")[0])


def _text(path: bytes, recording: Optional[int]) -> bytes:
    """The text of a source that factors and models keep."""
    text = ctypes.create_string_buffer(TEXT_MAX)
    call("incise_source_text", path, recording, text)
    return text.value


class Source:
    """A CSV file, a recording, or a table, as incise_train_source."""

    def __init__(self, given: Any, place: int):
        name = f"source {place}"
        named = isinstance(given, tuple) and len(given) == 2 and isinstance(given[0], str)
        if named:
            name, given = given
            if not name or not name.isprintable():
                raise Invalid(errno.EINVAL, f"name {name!r}: give a name of one line")
        if is_recording(given):
            given = Recording(os.fsdecode(given))
        path: Optional[bytes] = None
        if isinstance(given, Recording):
            path = _library.path_bytes(given.path)
        elif is_path(given):
            path = _library.path_bytes(given)
            if path == b"-" or (os.path.exists(path) and not os.path.isfile(path)):
                raise Invalid(
                    errno.EINVAL,
                    f"{os.fsdecode(path)}: is no file, and each source is read twice; "
                    "save it as a file, or read it into a table",
                )
        if named and path is not None:
            raise Invalid(
                errno.EINVAL,
                f"{os.fsdecode(path)}: has the name {name!r}; leave the name out, "
                "files go by their content",
            )
        self.is_table = path is None
        self.name = name if path is None else os.fsdecode(path)
        self.failure: Optional[BaseException] = None
        self.table, self.cuts = given, has_cuts(given)
        self.struct = SourceStruct(name=os.fsencode(self.name), cuts=self.cuts)
        if isinstance(given, Recording):
            self._describe(given, path)
        elif path is not None:
            self.struct.path = path
            if os.path.exists(path):
                self.struct.text = _text(path, None)
        else:
            self.struct.text = self.name.encode()[:300]
        if self.struct.path is None:
            self.struct.stream = _Stream(self._stream)

    def _describe(self, recording: Recording, path: bytes) -> None:
        self.table = recording.pairs()
        self.struct.hashed = os.path.join(_without_choice(path), b"recording.db")
        self.struct.rig = recording.info.rig.encode()
        with recording._lock:
            self.struct.text = _text(path, recording._open())
        if recording._calibration is not None:
            self.struct.text += b", read with another calibration"

    def _stream(self, _source: int, out: Any, _error: int) -> int:
        try:
            table = self.table
            if callable(table) and not hasattr(table, "__arrow_c_stream__"):
                table = table()
            stream, self.keep = open_stream(table)
            ctypes.memmove(out, ctypes.byref(stream), ctypes.sizeof(stream))
            # It is C's now.
            release = ArrowArrayStream.release
            ctypes.memset(ctypes.addressof(stream) + release.offset, 0, release.size)
            return 0
        except BaseException as failure:  # raised again by train_sources()
            self.failure = failure
            return -errno.EIO

    def close(self) -> None:
        """Break the cycle of the callback, which would keep the table."""
        self.struct = self.keep = None


def train_sources(
    given: Sequence[Any],
    columns: List[str],
    options: TrainOptionsStruct,
    group: Optional[str],
    check: float,
    all_rows: bool,
    mf_type: int,
    counts: Any,
    progress: Any,
) -> Model:
    """incise.train() of a list."""
    if options.classic:
        raise Invalid(
            errno.EINVAL, "classic keeps all pairs in memory; give one table, or leave classic out"
        )
    sources = [Source(source, place) for place, source in enumerate(given, 1)]
    names = [source.name for source in sources if source.is_table]
    for name in names:
        if names.count(name) > 1:
            raise Invalid(errno.EINVAL, f"name {name!r}: is given twice; give each table its own")
    how = SourcesOptionsStruct(
        columns=name_array(columns),
        n_inputs=len(columns) - 1,
        group=group.encode() if group else None,
        all_rows=all_rows,
        check=check,
        type=mf_type,
        n_mfs=counts,
        train=options,
    )
    stop, trained = Stop(how.train, progress), TrainedStruct()
    structs = (SourceStruct * len(sources))(*(source.struct for source in sources))

    def learn() -> Model:
        try:
            call("incise_train_sources", structs, len(sources), how, trained)
        finally:
            for source in sources:
                if source.failure:
                    raise source.failure
        model = Model._of(trained.model)
        model._set_uncertainty(trained.uncertainty)
        model._notes = trained.notes
        trained.model = trained.uncertainty = None
        known = not math.isnan(trained.coverage)
        model._report = report_of(
            trained.report,
            trained.pairs,
            trained.check_pairs,
            trained.left_out,
            trained.baselines if known else None,
        )
        return model

    try:
        return stop.run(learn)
    finally:
        function("incise_trained_free")(trained)
        for source in sources:
            source.close()
