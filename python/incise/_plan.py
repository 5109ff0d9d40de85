# SPDX-License-Identifier: LGPL-2.1-or-later
"""Scenes without a device: the loop's stages, tick by tick or over a whole stroke in one C call."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import threading
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple, Union

from . import _library
from ._columns import Columns
from ._library import Invalid, NotFound, PathLike, c_bool, c_double, c_int, call, function, package
from ._library import text, values
from ._model import CompiledModel, Model, model_file
from ._show import html_table

AXES_MAX, POSES_MAX = 3, 32
PHASES = ("free", "cutting", "insertion")
TOOLS = ("auto", "blade", "handle", "tube")
_FLAGS = """
    contact extrapolated stale clamped fault slewed travel unpaid starting not_finite unusable in_cut
    membrane lumen back_wall full
"""
#: Bits of a tick's flags, {name: value}; see incise/tick_flags.h.
FLAGS = {name: 1 << bit for bit, name in enumerate(_FLAGS.split())}


SampleStruct, TrackerStruct, TickStruct, DeviceStruct = _library.structs("""
    struct incise_tracker_sample {
        int64_t t_ns;
        uint64_t seq;
        double position_mm[3], quaternion[4];
        char status;
        uint8_t station;
        bool button, restarted;
        uint32_t after_ns;
    };
    struct incise_tracker_info {
        char name[64];
        double rate_hz;
        int64_t latency_ns;
        int stations;
        bool external_sync;
        int64_t grain_ns;
        uint8_t scalpel_station, tube_station;
        bool network;
        char note[300];
        bool lost_unsure;
        const void *haptic;
    };
    struct incise_tick {
        int64_t t_ns;
        double position_mm[3], quaternion[4], tool_mm[3], proxy_mm[3], normal[3], depth_mm;
        double velocity_mm_s, command_N[3], actuated_N[3], rendered_N[3], unfelt_N;
        uint32_t flags;
        int phase, tool;
    };
    struct incise_haptic_device {
        double mass_kg, damping_N_s_mm, coulomb_N, encoder_mm, period_s;
        int delay_ticks;
    };
    """)


class _Worst(ctypes.Structure):
    _fields_ = [
        ("lean_N", c_double),
        ("along_mm_s", c_double),
        ("askew", c_double),
        ("place_mm", c_double * 3),
        ("tool", c_int),
        ("held", c_int),
        ("guided", c_bool),
        ("tilted", c_bool),
        ("depth_mm", c_double),
        ("swing_mm", c_double),
        ("settle_s", c_double),
    ]


_Weakest, StabilityStruct = _library.structs(
    """
    struct incise_plan_weakest {
        double margin, along[3], hz, lean_N, depth_mm, place_mm[3];
        int tool, held;
        bool tilted;
        int states, paid;
    };
    struct incise_plan_stability {
        struct incise_haptic_device device;
        bool own_delay;
        double stiffness_N_mm, damping_N_s_mm;
        int late_ticks, n_axes, axis_late_ticks[3];
        double speed_slope_N_s_mm, slope_N_mm, unloading_N_mm, support_mm, beyond_N_mm;
        int runs;
        int64_t ticks;
        _Worst worst;
        struct incise_plan_weakest weakest;
        double noise_mm, noise_N;
        bool certified;
        double acceleration_slope_N_s2_mm;
    };
    """,
    _Worst=_Worst,
)


_library.prototypes(
    "libincise",
    """
    struct incise_scene *incise_scene_load(const char *path, const char *model,
        struct incise_error *err);
    void incise_scene_free(struct incise_scene *scene);
    double incise_scene_rate_hz(const struct incise_scene *scene);
    int incise_scene_set_arithmetic(struct incise_scene *scene, const char *name,
        struct incise_error *err);
    void incise_scene_set_full(struct incise_scene *scene, bool full);
    void incise_scene_leave_texture_out(struct incise_scene *scene);
    struct incise_plan *incise_plan_new_fed(const struct incise_scene *scene,
        const struct incise_tracker_info *tracker, struct incise_error *err);
    void incise_plan_free(struct incise_plan *plan);
    const char *incise_plan_stage(const struct incise_plan *plan, int index);
    const char *incise_plan_left_out(const struct incise_plan *plan, int index, const char **why);
    size_t incise_plan_memory(const struct incise_plan *plan);
    double incise_plan_bound(const struct incise_plan *plan, double reach_mm);
    void incise_plan_stability(const struct incise_plan *plan,
        struct incise_plan_stability *stability);
    int incise_plan_set_tool(struct incise_plan *plan, enum incise_tool tool);
    int incise_plan_set_tip(struct incise_plan *plan, const double tip_mm[3]);
    int incise_plan_feed(struct incise_plan *plan, const struct incise_tracker_sample *samples,
        int n);
    int incise_plan_tick(struct incise_plan *plan, int64_t t_ns, struct incise_tick *tick);
    int incise_plan_cause(const struct incise_plan *plan, char *text, size_t size);
    int64_t incise_plan_run(struct incise_plan *plan, const struct incise_tracker_sample *poses,
        uint64_t n, int64_t start_ns, int64_t period_ns, struct incise_tick *ticks, uint64_t n_ticks);
    """,
)

Vector = Tuple[float, float, float]


class Tick(NamedTuple):
    """The result of one tick."""

    t_ns: int
    position_mm: Vector  #: of the tip, predicted
    quaternion: Tuple[float, float, float, float]  #: of the scalpel, w first
    tool_mm: Vector  #: end of what the hand holds
    proxy_mm: Vector  #: its point on the surface, in contact
    normal: Vector  #: along which the tissue pushes, in contact
    depth_mm: float
    velocity_mm_s: float
    command_N: Vector  #: force, in the tracker's frame
    flags: int  #: bits of incise.FLAGS
    phase: str
    tool: str


class Stability(NamedTuple):
    """The limits of the plan's device; see incise-plan(1)."""

    stiffness_N_mm: float  #: largest of the scene
    damping_N_s_mm: float
    margin: float  #: with so many times its forces it would swing; 16: with no fewer
    slope_N_mm: float  #: largest of the model's force by the depth
    unloading_N_mm: float
    support_mm: float  #: largest depth that the model knows
    runs: int  #: closed loops that were tried
    settle_s: float  #: of the one that took longest to rest
    certified: bool  #: the model's slopes are bounds, not estimates


def _scene_folders() -> List[str]:
    folders = [".", "/etc/incise/scenes"]
    here = os.path.dirname(os.path.abspath(__file__))
    source = os.path.join(here, "..", "..")
    if os.path.exists(os.path.join(source, "lib", "libincise.map")):
        folders.append(os.path.normpath(os.path.join(source, "scenes")))
    if os.environ.get("INCISE_LIBDIR"):
        beside = os.path.join(os.environ["INCISE_LIBDIR"], "..", "share", "incise", "scenes")
        folders.append(os.path.normpath(beside))
    for prefix in ("/usr/local", "/usr"):
        folders.append(os.path.join(prefix, "share", "incise", "scenes"))
    try:
        from . import _installed  # written by make install

        folders.insert(2, os.path.join(_installed.DATADIR, "incise", "scenes"))
    except ImportError:
        pass
    return folders


def find_scene(scene: PathLike) -> str:
    """The file of a scene: a path, or a name such as "neck" of a shipped one."""
    name = os.fspath(scene)
    if os.path.isfile(name):
        return name
    import glob

    found: List[str] = []
    for folder in _scene_folders():
        path = os.path.join(folder, name + ".scene")
        if "/" not in name and os.path.isfile(path):
            return path
        found += glob.glob(os.path.join(folder, "*.scene"))
    names = sorted({os.path.basename(path)[: -len(".scene")] for path in found})
    raise NotFound(
        errno.ENOENT,
        f"{name}: no such scene; give the path of a file, or one of: {', '.join(names)}",
    )


def load_scene(
    scene: PathLike,
    model: Union[PathLike, Model, CompiledModel, None],
    arithmetic: Optional[str],
    texture: bool,
) -> Tuple[str, Any]:
    """The path of a scene, and the scene with its model and its arithmetic."""
    path = find_scene(scene)
    with contextlib.nullcontext() if model is None else model_file(model) as file:
        made = call("incise_scene_load", _library.path_bytes(path), file)
    loaded = _library.Handle(made, "incise_scene_free")
    if arithmetic is not None:
        call("incise_scene_set_arithmetic", loaded, arithmetic.encode())
    if not texture:
        function("incise_scene_leave_texture_out")(loaded)
    return path, loaded


def _fill_pose(sample: SampleStruct, t_ns: int, pose: Any) -> None:
    """A pose is (position, quaternion), or a position alone: the scalpel upright."""
    try:
        if len(pose) == 2:
            position, quaternion = pose
        else:
            position, quaternion = pose, (1.0, 0.0, 0.0, 0.0)
        sample.t_ns = t_ns
        sample.position_mm[:] = [float(x) for x in position]
        sample.quaternion[:] = [float(x) for x in quaternion]
    except (TypeError, ValueError) as failure:
        raise Invalid(
            errno.EINVAL,
            f"a pose is (x, y, z) in mm, or that and a quaternion (w, x, y, z): {failure}",
        ) from None
    sample.status = b" "


def _columns(poses: Any) -> Dict[str, Any]:
    """The columns of poses: a table such as rec.tracker, or {column: values}."""
    if hasattr(poses, "numpy"):
        poses = poses.numpy()
    elif hasattr(poses, "to_dict") and hasattr(poses, "columns"):
        poses = {name: poses[name].to_numpy() for name in poses.columns}
    if not hasattr(poses, "keys"):
        raise Invalid(
            errno.EINVAL,
            "poses are a table such as rec.tracker, or {t_ns, x_mm, y_mm, z_mm[, qw, qx, qy, qz]}",
        )
    missing = [name for name in ("t_ns", "x_mm", "y_mm", "z_mm") if name not in poses]
    if missing:
        raise Invalid(errno.EINVAL, f"poses have no column {', '.join(missing)}")
    return poses


class Plan:
    """A scene, compiled to its stages, and fed with poses.

    scene: a .scene file, or the name of a shipped one. model: in place of the scene's, a .fis or .fx, or
    a model that was trained or compiled here. texture: with that of the scene, if its model is.
    tracker_hz, latency_ms: of the tracker that the poses are from; the prediction and the stability
    depend on them. A scene that its device cannot hold is refused with the largest safe gain.
    """

    def __init__(
        self,
        scene: PathLike,
        model: Union[PathLike, Model, CompiledModel, None] = None,
        *,
        arithmetic: Optional[str] = None,
        full: bool = False,
        texture: bool = True,
        tool: str = "auto",
        tip_mm: Sequence[float] = (0, 0, 0),
        tracker_hz: float = 120,
        latency_ms: float = 4.2,
    ):
        self.path, self._scene = load_scene(scene, model, arithmetic, texture)
        function("incise_scene_set_full")(self._scene, full)
        self.rate_hz: float = function("incise_scene_rate_hz")(self._scene)
        self._period_ns = round(1e9 / self.rate_hz)
        tracker = TrackerStruct(b"poses", tracker_hz, round(latency_ms * 1e6), 1, False, 0, 1, 0)
        self._plan = _library.Handle(
            call("incise_plan_new_fed", self._scene, tracker),
            "incise_plan_free",
        )
        self.set_tool(tool)
        if function("incise_plan_set_tip")(self._plan, (c_double * 3)(*tip_mm)) < 0:
            raise Invalid(errno.EINVAL, f"tip_mm={tuple(tip_mm)!r}: not within 1e6 mm")
        self._tick = TickStruct()
        self._sample = SampleStruct()
        self._last_ns = -(1 << 63)
        self._use = threading.Lock()

    def __reduce__(self) -> Any:
        raise TypeError("a Plan is at work and cannot be copied or pickled; make another one")

    def __del__(self) -> None:
        self.__dict__.pop("_plan", None)  # before its scene

    def __repr__(self) -> str:
        return f"<incise.Plan {self.path}: {' '.join(self.stages)}>"

    def _repr_html_(self) -> str:
        rows = [(name, "runs") for name in self.stages] + list(self.left_out.items())
        return html_table(f"incise.Plan {self.path}, {self.rate_hz:g} Hz", ("stage", ""), rows)

    @property
    def stages(self) -> List[str]:
        """The stages that the scene needs, in order."""
        names = []
        while (name := function("incise_plan_stage")(self._plan, len(names))) is not None:
            names.append(text(name))
        return names

    @property
    def left_out(self) -> Dict[str, str]:
        """The stages that the scene does not need, {stage: reason}."""
        found: Dict[str, str] = {}
        why = ctypes.c_char_p()
        left_out = function("incise_plan_left_out")
        while (name := left_out(self._plan, len(found), ctypes.byref(why))) is not None:
            found[text(name)] = text(why.value or b"")
        return found

    @property
    def memory(self) -> int:
        """Bytes that the plan holds."""
        return function("incise_plan_memory")(self._plan)

    @property
    def stability(self) -> Stability:
        """Stiffness of the plan, and its margin on its device."""
        s = StabilityStruct()
        function("incise_plan_stability")(self._plan, s)
        s.margin, s.settle_s = s.weakest.margin, s.worst.settle_s
        return Stability(*values(s, Stability._fields))

    def set_tool(self, tool: str) -> None:
        """Say what the hand holds: auto, blade, handle or tube. It changes out of the tissue."""
        if tool not in TOOLS:
            raise Invalid(errno.EINVAL, f"tool={tool!r}: one of {', '.join(TOOLS)}")
        function("incise_plan_set_tool")(self._plan, TOOLS.index(tool))

    def _fail(self, rc: int) -> None:
        cause = ctypes.create_string_buffer(500)
        function("incise_plan_cause")(self._plan, cause, len(cause))
        raise _library.make_error(-rc, text(cause.value) or os.strerror(-rc))

    def _begin(self) -> None:
        """Mark it as in use: the C library runs without Python's lock."""
        if not self._use.acquire(blocking=False):
            raise Invalid(
                errno.EBUSY,
                "another thread uses this Plan at this moment; give each thread its own",
            )

    def step(self, t: float, pose: Any) -> Tick:
        """Feed a pose, (x, y, z) in mm or that and a quaternion, and run the tick at t seconds.

        t grows from call to call. pose may be None: none has come. A second thread at once is an
        error.
        """
        self._begin()
        try:
            return self._step(t, pose)
        finally:
            self._use.release()

    def _step(self, t: float, pose: Any) -> Tick:
        if not -9e9 < t < 9e9:
            raise Invalid(errno.EINVAL, f"t={t!r}: not within 9e9 seconds")
        t_ns = round(t * 1e9)
        if t_ns < self._last_ns:
            raise Invalid(errno.EINVAL, f"t={t!r}: earlier than the step before")
        self._last_ns = t_ns
        if pose is not None:
            _fill_pose(self._sample, t_ns, pose)
            function("incise_plan_feed")(self._plan, self._sample, 1)
        tick = self._tick
        rc = function("incise_plan_tick")(self._plan, t_ns, tick)
        if rc < 0:
            self._fail(rc)
        return Tick(  # without values(), which takes longer than the tick
            tick.t_ns,
            tuple(tick.position_mm),
            tuple(tick.quaternion),
            tuple(tick.tool_mm),
            tuple(tick.proxy_mm),
            tuple(tick.normal),
            tick.depth_mm,
            tick.velocity_mm_s,
            tuple(tick.command_N),
            tick.flags,
            PHASES[tick.phase],
            TOOLS[tick.tool],
        )

    def run(self, poses: Any, *, arrival: Optional[str] = None) -> Columns:
        """Run the whole stroke in one C call; needs numpy.

        poses: a table such as ``rec.tracker``, a DataFrame, or {t_ns, x_mm, y_mm, z_mm[, qw, qx, qy,
        qz, station]}; ``arrival`` names the column of the times of arrival (default: arrival_ns if
        there, else t_ns). Ticks follow each other
        at rate_hz from the first pose to the last. Returns {column: array}: t_ns, position_mm,
        depth_mm, velocity_mm_s, command_N, flags, phase, tool, …, a row for each tick.
        """
        numpy = package("numpy", "Plan.run()")
        columns = _columns(poses)
        kind = numpy.dtype(SampleStruct)
        if arrival is None:
            arrival = "arrival_ns" if "arrival_ns" in columns else "t_ns"
        if arrival not in columns:
            raise Invalid(errno.EINVAL, f"poses have no column {arrival}")
        t_ns = numpy.asarray(columns[arrival])
        samples = numpy.zeros(len(t_ns), dtype=kind)
        try:
            samples["t_ns"] = t_ns
            for i, name in enumerate(("x_mm", "y_mm", "z_mm")):
                samples["position_mm"][:, i] = columns[name]
            samples["quaternion"][:, 0] = 1
            if "qw" in columns:
                for i, name in enumerate(("qw", "qx", "qy", "qz")):
                    samples["quaternion"][:, i] = columns[name]
            samples["station"] = columns["station"] if "station" in columns else 0
            status = columns["status"] if "status" in columns else b" "
            samples["status"] = numpy.asarray(status, dtype="S1")
        except (TypeError, ValueError) as failure:
            raise Invalid(errno.EINVAL, f"poses: {failure}") from None
        if not len(samples):
            raise Invalid(errno.EINVAL, "poses: there are none")
        start = int(samples["t_ns"][0])
        n = (int(samples["t_ns"][-1]) - start) // self._period_ns + 1
        if not 0 < n < 1 << 28:
            raise Invalid(errno.EINVAL, f"poses: {n} ticks from the first to the last; sort them")
        ticks = numpy.zeros(n, dtype=numpy.dtype(TickStruct))
        self._begin()
        try:
            done = function("incise_plan_run")(
                self._plan,
                (SampleStruct * len(samples)).from_buffer(samples),
                len(samples),
                start,
                self._period_ns,
                (TickStruct * n).from_buffer(ticks),
                n,
            )
        finally:
            self._use.release()
        if done < 0:
            raise Invalid(errno.EINVAL, f"poses: {arrival} has to rise from row to row")
        return Columns({name: ticks[name] for name in ticks.dtype.names}, f"ticks of {self.path}")
