# SPDX-License-Identifier: LGPL-2.1-or-later
"""The cutting force in MuJoCo: on a body, at each mujoco.mj_step().

    tool = incise.mujoco.attach(model, data, body="blade", scene="neck", frame="patient")

MuJoCo has metres and newton metres, incise millimetres and newton millimetres: attach() converts.
The plugin of examples/mujoco gives the same forces to the bit, without Python.
"""

from __future__ import annotations

import errno
import warnings
from typing import Any, Tuple, Union

from ._host import FADES, Host
from ._library import Invalid, NotFound, PathLike
from ._plan import Tick, Vector

_attached: Tuple[Attachment, ...] = ()
_callback_before: Any = None  # the program's own, which runs first


def attach(
    model: Any, data: Any, body: str, scene: Union[PathLike, Host], frame: str = "world"
) -> Attachment:
    """Let the tissue of a scene push a body, from the next mj_step() of this data on.

    body: a body, or a site on one; it is the tip of the blade, with the axes of the scene's group
    "tool". scene: a .scene file, the name of a shipped one, or a Host with settings of its own,
    whose step_s is the model's timestep. A robot with the mass and the damping of the scene's group
    "device" comes to rest. frame: the body or site that the scene lies in; it may move.

    The wrench is in data.xfrc_applied of the body, which is then no longer yours. A time that goes
    back, as by mj_resetData(), heals the cuts. model and data are kept until detach().

    It is computed in MuJoCo's passive callback, of which a process has one: set one of your own
    before. While a callback in Python is set, MuJoCo compiles no model ("Python exception raised"):
    make all of them before. The plugin has neither limit.
    """
    try:
        import mujoco
    except ImportError:
        raise ImportError("incise.mujoco needs MuJoCo; pip install mujoco") from None
    if not isinstance(model, mujoco.MjModel) or not isinstance(data, mujoco.MjData):
        raise TypeError("attach() takes a mujoco.MjModel and its mujoco.MjData")
    if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        raise Invalid(
            errno.EINVAL,
            'integrator="RK4": it tries poses that never are, and a cut stays; take "implicitfast"',
        )
    return Attachment(mujoco, model, data, body, scene, frame)


def _find(model: Any, data: Any, option: str, name: str) -> Tuple[int, Any, Any]:
    """A body, or that of a site; position and axes of either in the world."""
    bodies = [model.body(i).name or None for i in range(model.nbody)]
    sites = [model.site(i).name or None for i in range(model.nsite)]
    if name in bodies:
        body = bodies.index(name)
        return body, data.xpos[body], data.xmat[body]
    if name in sites:
        site = sites.index(name)
        return int(model.site_bodyid[site]), data.site_xpos[site], data.site_xmat[site]
    names = ", ".join(filter(None, bodies + sites))
    raise NotFound(errno.ENOENT, f"{option}={name!r}: no such body or site; one of: {names}")


class Attachment:
    """A tissue that pushes a body; made by attach()."""

    def __init__(
        self, mujoco: Any, model: Any, data: Any, body: str, scene: Any, frame: str
    ) -> None:
        global _attached, _callback_before
        import numpy

        self._mujoco, self._data = mujoco, data
        self._body, self._tip, self._tip_axes = _find(model, data, "body", body)
        _, self._frame, self._frame_axes = _find(model, data, "frame", frame)
        if any(a._data is data and a._body == self._body for a in _attached):
            raise Invalid(errno.EBUSY, f"body={body!r}: a tissue pushes it already; detach() that")
        self.host = scene if isinstance(scene, Host) else Host(scene, step_s=model.opt.timestep)
        pose, wrench = self.host.pose, self.host.wrench
        self._pose = numpy.frombuffer(pose.position_mm), numpy.frombuffer(pose.quaternion)
        self._wrench = numpy.frombuffer(wrench.force_N), numpy.frombuffer(wrench.torque_N_mm)
        self._centre = data.xipos[self._body]
        self._force, self._torque = numpy.split(data.xfrc_applied[self._body], 2)
        self._from, self._lever, self._moment = numpy.zeros((3, 3))
        self._tip_turn, self._frame_turn, self._turn = numpy.zeros((3, 4))
        self._time = data.time
        if not _attached:
            _callback_before = mujoco.get_mjcb_passive()
            mujoco.set_mjcb_passive(_apply_all)
        _attached += (self,)

    @property
    def force_N(self) -> Vector:
        """The force on the body, in the frame of the world."""
        return tuple(self._force.tolist())

    @property
    def tick(self) -> Tick:
        """The last tick, in mm and in the frame of the scene."""
        return self.host.tick

    def detach(self) -> None:
        """End the force."""
        global _attached
        if self not in _attached:
            return
        _attached = tuple(a for a in _attached if a is not self)
        if not _attached:
            self._mujoco.set_mjcb_passive(_callback_before)
        self._force[:] = self._torque[:] = 0

    def _apply(self) -> None:
        mujoco, tip_turn, frame_turn = self._mujoco, self._tip_turn, self._frame_turn
        position, (force, torque) = self._pose[0], self._wrench
        if self._data.time < self._time:
            self.host.reset()
        self._time = self._data.time
        mujoco.mju_mat2Quat(tip_turn, self._tip_axes)
        mujoco.mju_mat2Quat(frame_turn, self._frame_axes)
        mujoco.mju_negPose(self._from, self._turn, self._frame, frame_turn)
        mujoco.mju_mulPose(*self._pose, self._from, self._turn, self._tip, tip_turn)
        position *= 1e3
        try:
            fades = self.host.advance(self._time)
        except Invalid:
            self._force[:] = self._torque[:] = 0
            raise
        if fades:
            warnings.warn(f"MuJoCo: {FADES[fades]}: the force ramps to 0", stacklevel=2)
        mujoco.mju_rotVecQuat(self._force, force, frame_turn)
        mujoco.mju_rotVecQuat(self._torque, torque, frame_turn)
        self._torque *= 1e-3
        mujoco.mju_sub3(self._lever, self._tip, self._centre)
        mujoco.mju_cross(self._moment, self._lever, self._force)
        self._torque += self._moment


def _apply_all(model: Any, data: Any) -> None:
    """MuJoCo's passive callback."""
    if _callback_before is not None:
        _callback_before(model, data)
    for attachment in _attached:
        if attachment._data is data:
            attachment._apply()
