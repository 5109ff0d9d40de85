# SPDX-License-Identifier: GPL-2.0-or-later
"""A scene in a simulator's loop, from Python: the ticks of a plan, other rates, errors; and the example for SOFA, with
a stand-in for SOFA."""

import importlib.util
import math
import os
import sys
import types
import unittest

import incise
from fixtures import SOURCE, Case


def stroke(n):
    """Poses of a tip that goes 4 mm up and down about the skin of neck, and along it, while the blade tilts."""
    for k in range(n):
        tilt = 0.05 * math.sin(k * 0.003)
        yield (
            (60 + 5 * math.sin(k * 0.0007), 0.0, 4 - 8 * math.sin(k * 0.0025)),
            (math.cos(tilt), 0.0, math.sin(tilt), 0.0),
        )


class Hosts(Case):
    def test_a_host_at_the_ticks_rate_is_a_plan(self):
        for scene in ("neck", "liver", "wall"):
            host = incise.Host(scene, arithmetic="double")
            plan = incise.Plan(scene, arithmetic="double", tracker_hz=1000, latency_ms=0)
            most = 0.0
            for k, pose in enumerate(stroke(3000)):
                wrench, tick = host.step(k * 1e-3, pose), plan.step(2 + k * 1e-3, pose)
                self.assertEqual(wrench.force_N, tick.command_N)
                self.assertEqual((wrench.flags, wrench.fades), (tick.flags, ""))
                self.assertEqual(host.tick._replace(t_ns=0), tick._replace(t_ns=0))
                most = max(most, wrench.force_N[2])
            self.assertGreater(most, 0.2)

    def test_slow_steps(self):
        """The gain of steps of 10 ms is fitted, and the force follows."""
        host = incise.Host("neck", step_s=0.01, fit_gain=True)
        self.assertEqual(host.info.hold_ticks, 10)
        self.assertLessEqual(host.info.gain, host.info.scene_gain)
        forces = [host.step(k * 0.01, (60, 0, 4 - k * 0.05)).force_N[2] for k in range(160)]
        self.assertEqual(forces[0], 0)
        self.assertGreater(forces[-1], 0.2)
        late = host.step(5, (60, 0, -3))
        self.assertIn("longer", late.fades)
        self.assertIn("went back", host.step(4, (60, 0, -3)).fades)

    def test_a_reset_host_is_a_new_one(self):
        host = incise.Host("neck")
        episodes = []
        for _ in range(2):
            episodes.append([host.step(k * 1e-3, pose) for k, pose in enumerate(stroke(2000))])
            host.reset()
        self.assertEqual(*episodes)

    def test_the_wrench_is_about_the_pose(self):
        host = incise.Host("wall", tip_mm=(0, 0, -20))
        for k in range(2000):
            wrench = host.step(k * 1e-3, ((0, 0, max(25 - k * 0.005, 19)), (math.cos(0.1), math.sin(0.1), 0, 0)))
        lever = [0, 20 * math.sin(0.2), -20 * math.cos(0.2)]
        force = wrench.force_N
        self.assertGreater(force[2], 0.1)
        self.assertAlmostEqual(wrench.torque_N_mm[0], lever[1] * force[2] - lever[2] * force[1], places=6)

    def test_live(self):
        """By a clock the force fades or not, as the machine goes; it is never more than the scene's."""
        host = incise.Host("wall", live=True)
        for k in range(300):
            wrench = host.step(k * 1e-3, (0, 0, 1 - k * 0.01))
            self.assertLessEqual(abs(wrench.force_N[2]), 0.33 * 2.01)

    def test_errors(self):
        host = incise.Host("wall")
        self.assertIn("wall", repr(host))
        host.set_tool("blade")
        self.says(incise.NotFound, "one of: liver, neck, wall", incise.Host, "nek")
        self.says(incise.Invalid, "one of auto", incise.Host, "neck", tool="axe")
        self.says(incise.Invalid, "one of auto", host.set_tool, "axe")
        self.says(incise.Invalid, "host_period_s", incise.Host, "neck", step_s=-1)
        self.says(incise.Invalid, "tip_mm", incise.Host, "neck", tip_mm=(math.nan, 0, 0))
        for pose in ((1, 2), ("a", 0, 0), None, 5, ((1, 2), (1, 0, 0, 0)), (1, 2, 3, 4)):
            self.says(incise.Invalid, "a pose is", host.step, 0, pose)
        self.says(incise.Invalid, "velocity", host.step, 0, (0, 0, 5), (1, 2))
        for x in (math.nan, math.inf, -math.inf, 1e4, -1e300):
            self.says(incise.Invalid, "not finite or too far away", host.step, 0, (0, 0, x))
            self.assertEqual(tuple(host.wrench.force_N), (0, 0, 0))
        for t in (math.nan, math.inf, 1e30):
            self.says(incise.Invalid, "t=", host.step, t, (0, 0, 5))
        self.assertTrue(all(map(math.isfinite, host.step(0, (0, 0, -9999)).force_N)))


class Sofa(Case):
    """examples/sofa: its controller gives the blade of a stand-in what a Host gives, and the blade comes to rest."""

    def test_neck(self):
        class Object(types.SimpleNamespace):
            def __init__(self, kind="", **data):
                super().__init__(kind=kind, **{k: types.SimpleNamespace(value=v) for k, v in data.items()})

        class Node:
            def __init__(self):
                self.objects, self.time = [], types.SimpleNamespace(value=0.0)

            def addChild(self, name):
                return self

            def addObject(self, made, **data):
                self.objects.append(Object(made, **data) if isinstance(made, str) else made)
                return self.objects[-1]

        core = types.SimpleNamespace(Controller=type("Controller", (), {"__init__": lambda self, **named: None}))
        sys.modules["Sofa"] = types.SimpleNamespace(Core=core)
        self.addCleanup(sys.modules.pop, "Sofa")
        spec = importlib.util.spec_from_file_location("neck", os.path.join(SOURCE, "examples/sofa/neck.py"))
        neck = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(neck)
        root = neck.createScene(Node())
        tissue, state = root.objects[-1], next(o for o in root.objects if o.kind == "MechanicalObject")
        speed, pose, step = 0.0, state.position.value[0], root.dt
        for _ in range(500):
            tissue.onAnimateBeginEvent({"dt": step})
            push = tissue.field.forces.value[0]
            # m v' = F - b v, by the backward rule for the damping
            speed = (speed + step * (push[2] - neck.LEAN_N) / 0.05) / (1 + step * 10 / 0.05)
            pose[2] += speed * step
            root.time.value += step
        self.assertAlmostEqual(push[2], neck.LEAN_N, places=6)
        self.assertLess(abs(speed), 1e-9)
        self.assertAlmostEqual(pose[2], -1e-3 / (0.14 * tissue.host.info.gain), places=4)
        root.time.value = 0.0
        tissue.onAnimateBeginEvent({"dt": step})
        self.assertEqual(tissue.fades, "")


if __name__ == "__main__":
    unittest.main()
