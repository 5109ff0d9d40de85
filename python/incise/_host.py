# SPDX-License-Identifier: LGPL-2.1-or-later
"""The cutting force inside a simulator that steps at a rate of its own; see incise/host.h."""

from __future__ import annotations

import errno
import threading
from typing import Any, NamedTuple, Optional, Sequence, Union

from . import _library
from ._library import Invalid, PathLike, c_double, c_void_p, call, function, values
from ._model import CompiledModel, Model
from ._plan import PHASES, TOOLS, StabilityStruct, Tick, TickStruct, Vector, load_scene

HostOptions, HostPose, HostWrench, HostInfo = _library.structs("""
    struct incise_host_options {
        double host_period_s;
        bool gives_velocity, fit_gain;
        double tip_mm[3];
        int tool;
        void *clock;
    };
    struct incise_host_pose {
        double position_mm[3], quaternion[4];
    };
    struct incise_host_wrench {
        double force_N[3], torque_N_mm[3];
        unsigned int flags;
    };
    struct incise_host_info {
        double tick_s;
        int hold_ticks;
        double gain, scene_gain;
        struct incise_plan_stability stability;
    };
    """)

_library.declare("libincise", {"incise_clock_new_real": (c_void_p,)})
_library.prototypes(
    "libincise",
    """
    void incise_clock_free(struct incise_clock *clock);
    struct incise_host *incise_host_new(const struct incise_scene *scene,
        const struct incise_host_options *options, struct incise_error *err);
    void incise_host_free(struct incise_host *host);
    int incise_host_step(struct incise_host *host, int64_t t_ns, const struct incise_host_pose *pose,
        const double velocity_mm_s[3], struct incise_host_wrench *wrench);
    void incise_host_reset(struct incise_host *host);
    int incise_host_set_tool(struct incise_host *host, enum incise_tool tool);
    void incise_host_last(struct incise_host *host, struct incise_tick *tick);
    void incise_host_info(struct incise_host *host, struct incise_host_info *info);
    """,
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
    flags: int  #: bits of incise.FLAGS
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
        model: Union[PathLike, Model, CompiledModel, None] = None,
        *,
        step_s: float = 0,
        arithmetic: Optional[str] = None,
        velocity: bool = False,
        fit_gain: bool = False,
        texture: bool = True,
        tool: str = "auto",
        tip_mm: Sequence[float] = (0, 0, 0),
        live: bool = False,
    ):
        self.path, self._scene = load_scene(scene, model, arithmetic, texture)
        options = HostOptions(step_s, velocity, fit_gain, tuple(tip_mm), find_tool(tool))
        if live:
            clock = function("incise_clock_new_real")()
            if not clock:
                raise MemoryError("no memory for a clock")
            self._clock = _library.Handle(clock, "incise_clock_free")
            options.clock = clock
        self._host = _library.Handle(
            call("incise_host_new", self._scene, options), "incise_host_free"
        )
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
    def info(self) -> Any:
        """Its tick_s, hold_ticks, gain in use and scene_gain."""
        info = HostInfo()
        function("incise_host_info")(self._host, info)
        return info

    @property
    def tick(self) -> Tick:
        """The last tick; all 0 before the first. Its t_ns is not the simulator's time."""
        last = TickStruct()
        function("incise_host_last")(self._host, last)
        tick = Tick(*values(last, Tick._fields))
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
