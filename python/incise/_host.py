# SPDX-License-Identifier: LGPL-2.1-or-later
"""The cutting force inside a simulator that steps at a rate of its own; see incise/host.h."""

from __future__ import annotations

import ctypes
import errno
import threading
from typing import Any, NamedTuple, Optional, Sequence

from . import _library
from ._library import Failure, Invalid, c_bool, c_double, c_int, c_int64, c_void_p
from ._library import function
from .plan import PHASES, TOOLS, StabilityStruct, Tick, TickStruct, Vector, find_scene
from .recording import PathLike


class HostOptions(ctypes.Structure):
    """struct incise_host_options"""

    _fields_ = [
        ("host_period_s", c_double),
        ("gives_velocity", c_bool),
        ("fit_gain", c_bool),
        ("tip_mm", c_double * 3),
        ("tool", c_int),
        ("clock", c_void_p),
    ]
    c_name = "struct incise_host_options"


class HostPose(ctypes.Structure):
    """struct incise_host_pose"""

    _fields_ = [("position_mm", c_double * 3), ("quaternion", c_double * 4)]
    c_name = "struct incise_host_pose"


class HostWrench(ctypes.Structure):
    """struct incise_host_wrench"""

    _fields_ = [("force_N", c_double * 3), ("torque_N_mm", c_double * 3), ("flags", ctypes.c_uint)]
    c_name = "struct incise_host_wrench"


class HostInfo(ctypes.Structure):
    """struct incise_host_info"""

    _fields_ = [
        ("tick_s", c_double),
        ("hold_ticks", c_int),
        ("gain", c_double),
        ("scene_gain", c_double),
        ("stability", StabilityStruct),
    ]
    c_name = "struct incise_host_info"


_options, _pose, _velocity, _wrench, _tick, _info = map(
    ctypes.POINTER, (HostOptions, HostPose, c_double, HostWrench, TickStruct, HostInfo)
)
_library.declare(
    "libincise",
    {
        "incise_clock_new_real": (c_void_p,),
        "incise_clock_free": (None, c_void_p),
        "incise_host_new": (c_void_p, c_void_p, _options, c_void_p),
        "incise_host_free": (None, c_void_p),
        "incise_host_step": (c_int, c_void_p, c_int64, _pose, _velocity, _wrench),
        "incise_host_reset": (None, c_void_p),
        "incise_host_set_tool": (c_int, c_void_p, c_int),
        "incise_host_last": (None, c_void_p, _tick),
        "incise_host_info": (None, c_void_p, _info),
    },
)

#: Reasons why the force of a step ramps to 0.
FADES = {
    0: "",
    -errno.ESTALE: "the step was longer than the host's step_s, or the host is behind the clock",
    -errno.ERANGE: "the time went back",
}


class Wrench(NamedTuple):
    """The force of the tissue on the tool, in the frame of the scene."""

    force_N: Vector
    torque_N_mm: Vector  #: about the position of the pose
    flags: int  #: bits of incise.plan.FLAGS
    fades: str  #: why the force ramps to 0; "": it does not


class Host:
    """A scene in the loop of a simulator: a pose at each of its steps, a wrench until the next.

    step_s: the simulator's largest step; 0: a tick of the scene, which gives the bits of a Plan.
    Longer steps are filled with ticks; what tissue is stable depends on them. A scene that swings
    is refused with the largest safe gain, and fit_gain takes that gain. velocity: each step() has
    one. live: the force fades where the simulator is slower than CLOCK_MONOTONIC.
    """

    def __init__(
        self,
        scene: PathLike,
        model: Optional[PathLike] = None,
        *,
        step_s: float = 0,
        arithmetic: Optional[str] = None,
        velocity: bool = False,
        fit_gain: bool = False,
        tool: str = "auto",
        tip_mm: Sequence[float] = (0, 0, 0),
        live: bool = False,
    ):
        failure = Failure()
        made, handle = failure.require, _library.Handle
        self.path = find_scene(scene)
        paths = [name and _library.path_bytes(name) for name in (self.path, model)]
        loaded = made(function("incise_scene_load")(*paths, failure.ref))
        self._scene = handle(loaded, "incise_scene_free")
        if arithmetic is not None:
            set_arithmetic = function("incise_scene_set_arithmetic")
            failure.check(set_arithmetic(self._scene, arithmetic.encode(), failure.ref))
        options = HostOptions(step_s, velocity, fit_gain, tuple(tip_mm), find_tool(tool))
        if live:
            self._clock = handle(made(function("incise_clock_new_real")()), "incise_clock_free")
            options.clock = self._clock._as_parameter_
        host = made(function("incise_host_new")(self._scene, options, failure.ref))
        self._host = handle(host, "incise_host_free")
        self._step = function("incise_host_step")
        self._use = threading.Lock()
        self.pose, self.wrench = HostPose(), HostWrench()

    def __reduce__(self) -> Any:
        raise TypeError("a Host is at work and cannot be copied or pickled; make another one")

    def __del__(self) -> None:
        self.__dict__.pop("_host", None)  # before its scene and clock

    def __repr__(self) -> str:
        return f"<incise.Host {self.path}: gain {self.info.gain:g}, hold {self.info.hold_ticks} ticks>"

    @property
    def info(self) -> HostInfo:
        """Its tick_s, hold_ticks, gain in use and scene_gain."""
        info = HostInfo()
        function("incise_host_info")(self._host, ctypes.byref(info))
        return info

    @property
    def tick(self) -> Tick:
        """The last tick; all 0 before the first. Its t_ns is not the simulator's time."""
        last = TickStruct()
        function("incise_host_last")(self._host, ctypes.byref(last))
        values = [getattr(last, name) for name in Tick._fields]
        tick = Tick(*(tuple(v) if isinstance(v, ctypes.Array) else v for v in values))
        return tick._replace(phase=PHASES[last.phase], tool=TOOLS[last.tool])

    def set_tool(self, tool: str) -> None:
        """Say what the hand holds: auto, blade, handle or tube. It changes out of the tissue."""
        function("incise_host_set_tool")(self._host, find_tool(tool))

    def reset(self) -> None:
        """Start again, as made: cuts heal, and the next time may be any."""
        function("incise_host_reset")(self._host)

    def advance(self, t: float, velocity: Any = None) -> int:
        """Step with self.pose to self.wrench; returns a key of FADES."""
        if not -4e9 < t < 4e9:
            raise Invalid(errno.EINVAL, f"t={t!r}: not within 4e9 seconds")
        rc: int = self._step(self._host, round(t * 1e9), self.pose, velocity, self.wrench)
        if rc not in FADES:
            raise Invalid(-rc, f"t={t!r}: the pose is not finite or too far away, or has no velocity")
        return rc

    def step(self, t: float, pose: Any, velocity_mm_s: Optional[Sequence[float]] = None) -> Wrench:
        """Go on to t seconds of the simulator, with the pose there: (x, y, z) in mm, or that and a
        quaternion (w, x, y, z). The wrench holds until the next step."""
        with self._use:
            try:
                position, quaternion = pose if len(pose) == 2 else (pose, (1, 0, 0, 0))
                self.pose.position_mm[:] = [*position]
                self.pose.quaternion[:] = [*quaternion]
                velocity = None if velocity_mm_s is None else (c_double * 3)()
                if velocity is not None:
                    velocity[:] = [*velocity_mm_s]
            except (TypeError, ValueError, IndexError) as failure:
                said = "a pose is (x, y, z) in mm, or that and a quaternion (w, x, y, z), a velocity "
                raise Invalid(errno.EINVAL, f"{said}(x, y, z) in mm/s: {failure}") from None
            fades = FADES[self.advance(t, velocity)]
            found = self.wrench
            return Wrench(tuple(found.force_N), tuple(found.torque_N_mm), found.flags, fades)


def find_tool(tool: str) -> int:
    """The number of a tool in the C library."""
    if tool not in TOOLS:
        raise Invalid(errno.EINVAL, f"tool={tool!r}: one of {', '.join(TOOLS)}")
    return TOOLS.index(tool)
