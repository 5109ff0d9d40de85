# SPDX-License-Identifier: LGPL-2.1-or-later
"""Wall time of a recording: from CLOCK_MONOTONIC, the column t_ns, to TAI and UTC with a bound of the error."""

from __future__ import annotations

import ctypes
import errno
import math
import os
from typing import NamedTuple, Optional, Tuple

from . import _library
from ._library import Handle, Invalid, call, function, values

_UNKNOWN = 2**63 - 1


(WallPointStruct,) = _library.structs("""
    struct incise_wall_point {
        int64_t t_ns, tai_ns;
        double uncertainty_ns, rate_ppb, rate_uncertainty_ppb;
        int utc_offset_s;
        bool held;
        char source[24], reference[24], leap[24], restart[24];
    };
    """)


_library.prototypes(
    "libincise-record",
    """
    struct incise_wall *incise_recording_wall(struct incise_recording *recording,
        struct incise_error *err);
    void incise_wall_free(struct incise_wall *wall);
    size_t incise_wall_points(const struct incise_wall *wall,
        const struct incise_wall_point **points);
    int incise_wall_tai(const struct incise_wall *wall, int64_t t_ns, int64_t *tai_ns,
        int64_t *uncertainty_ns);
    int incise_wall_monotonic(const struct incise_wall *wall, int64_t tai_ns, int64_t *t_ns,
        int64_t *uncertainty_ns);
    int incise_wall_utc_offset_s(const struct incise_wall *wall, int64_t t_ns);
    void incise_wall_utc_text(int64_t tai_ns, int utc_offset_s, char text[INCISE_WALL_TEXT]);
    """,
)


class WallPoint(NamedTuple):
    """A reading of the clocks while recording; see Wall time in incise-recording(5)."""

    t_ns: int  #: CLOCK_MONOTONIC
    tai_ns: int  #: ns since 1970-01-01 00:00:00 TAI
    uncertainty_ns: float  #: bound of the error; inf: unknown
    rate_ppb: float
    rate_uncertainty_ppb: float
    utc_offset_s: int  #: TAI less UTC
    held: bool  #: continued from earlier points, as the source was lost
    source: str
    reference: str  #: TAI, or ptp: and the identity of a grandmaster
    leap: str
    restart: str  #: why the mapping starts again here, or empty


class Wall:
    """The mapping of one recording, ``rec.wall``; it can be used after the recording is closed."""

    def __init__(self) -> None:
        raise TypeError("a Wall comes of a recording: incise.open(path).wall")

    @classmethod
    def _of(cls, pointer: int) -> "Wall":
        """The wall time of a pointer, which it frees."""
        wall = cls.__new__(cls)
        wall._handle = Handle(pointer, "incise_wall_free")
        return wall

    @property
    def points(self) -> Tuple[WallPoint, ...]:
        """All readings, in order."""
        points = ctypes.POINTER(WallPointStruct)()
        n = function("incise_wall_points")(self._handle, ctypes.byref(points))
        return tuple(WallPoint(*values(point, WallPoint._fields)) for point in points[:n])

    def _convert(self, name: str, what: str, time_ns: int) -> Tuple[int, float]:
        result, bound = ctypes.c_int64(), ctypes.c_int64()
        rc = function(name)(self._handle, time_ns, ctypes.byref(result), ctypes.byref(bound))
        if rc < 0:
            raise Invalid(
                -rc,
                f"{what} {time_ns}: "
                + (
                    "is more than 60 s from the recording's wall time"
                    if -rc == errno.ENODATA
                    else os.strerror(-rc)
                ),
            )
        return result.value, math.inf if bound.value == _UNKNOWN else float(bound.value)

    def tai(self, t_ns: int) -> Tuple[int, float]:
        """TAI in ns since 1970 at a time of CLOCK_MONOTONIC, and the bound of its error, ns (inf: unknown)."""
        return self._convert("incise_wall_tai", "t_ns", int(t_ns))

    def monotonic(self, tai_ns: int) -> Tuple[int, float]:
        """The inverse: t_ns of a time of TAI, and the bound of its error, ns."""
        return self._convert("incise_wall_monotonic", "tai_ns", int(tai_ns))

    def utc(self, t_ns: int) -> str:
        """UTC at a time of CLOCK_MONOTONIC, in ISO 8601 with nanoseconds."""
        tai_ns, _ = self.tai(t_ns)
        offset_s = function("incise_wall_utc_offset_s")(self._handle, int(t_ns))
        out = ctypes.create_string_buffer(40)
        function("incise_wall_utc_text")(tai_ns, offset_s, out)
        return out.value.decode()

    def __repr__(self) -> str:
        first = self.points[0]
        return f"<incise.Wall by {first.source}, time of {first.reference}>"


def read(recording: int) -> Optional[Wall]:
    """The wall time of an open recording, or None without one."""
    try:
        return Wall._of(call("incise_recording_wall", recording))
    except Invalid as failure:
        if failure.errno != errno.ENODATA:
            raise
        return None
