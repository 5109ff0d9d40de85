# SPDX-License-Identifier: GPL-2.0-or-later
"""Scenes and calibrations in Python: the same ticks one by one and in one call, errors."""

import math
import os
import sys
import threading
import unittest

import incise
from incise import _plan
from fixtures import Case, has, run


def stroke(n):
    """Times and positions of a tip that goes 4 mm up and down about the skin of neck."""
    return [
        (1_000_000_000 + i * 8_333_333, (60.0, 0.0, 4 - 8 * math.sin(i * 0.02))) for i in range(n)
    ]


class Plans(Case):
    def test_stages_are_those_of_the_tool(self):
        import json

        told = json.loads(run("incise", "plan", "neck", "--json"))
        plan = incise.Plan("neck")
        self.assertEqual(plan.stages, [s for s in told["kept"] if s in plan.stages])
        self.assertGreater(len(plan.stages), 10)
        self.assertIn("actuate", plan.left_out)
        self.assertAlmostEqual(plan.stability.margin, told["margin"], places=6)
        self.assertAlmostEqual(plan.stability.stiffness_N_mm, told["stiffness_N_mm"], places=6)

    def test_step(self):
        plan = incise.Plan("neck")
        ticks = []
        poses = [position for _, position in stroke(125)]
        for k in range(1000):
            ticks.append(plan.step(1 + k * 1e-3, poses[k // 8] if k % 8 == 0 else None))
        contact = [tick for tick in ticks if tick.flags & incise.FLAGS["contact"]]
        self.assertGreater(len(contact), 100)
        self.assertGreater(max(tick.command_N[2] for tick in contact), 0.2)
        self.assertEqual(ticks[-1].tool, "blade")
        self.assertTrue(all(math.isfinite(x) for tick in ticks for x in tick.command_N))

    def test_whatever_comes_in_is_finite(self):
        plan = incise.Plan("liver")
        for k, x in enumerate((0, math.nan, math.inf, -math.inf, 1e300, -1e300, 0)):
            tick = plan.step(k * 1e-3, ((x, x, -x), (x, 0, 0, 1)))
            for value in (*tick.command_N, *tick.position_mm, tick.depth_mm):
                self.assertTrue(math.isfinite(value))

    def test_two_threads_at_once(self):
        """The second one is refused, while the first is at work; its ticks stay its own."""
        plan = incise.Plan("wall")
        inside, go_on, ticks = threading.Event(), threading.Event(), []

        class Slow(tuple):
            def __iter__(self):
                inside.set()
                go_on.wait(30)
                return super().__iter__()

        thread = threading.Thread(target=lambda: ticks.append(plan.step(1, Slow((1, 2, 3)))))
        thread.start()
        self.assertTrue(inside.wait(30))
        self.says(incise.Invalid, "another thread uses this Plan", plan.step, 1, (7, 8, 9))
        if has("numpy"):
            poses = {"t_ns": [0, 10**7], "x_mm": [0, 0], "y_mm": [0, 0], "z_mm": [5, 4]}
            self.says(incise.Invalid, "another thread uses this Plan", plan.run, poses)
        go_on.set()
        thread.join()
        self.assertEqual(ticks[0].position_mm, (1, 2, 3))
        plan.step(2, (7, 8, 9))

    def test_time_goes_on(self):
        plan = incise.Plan("wall")
        plan.step(1, (0, 0, 5))
        for t in (0.999, math.nan, math.inf, 1e30, -1e30):
            self.says(incise.Invalid, "t=", plan.step, t, None)
        plan.step(1.001, None)

    def test_scenes_are_beside_the_libraries(self):
        folder = self.path("opt/share/incise/scenes")
        os.makedirs(folder)
        with open(os.path.join(folder, "own.scene"), "w") as out:
            out.write("surface = {};")
        before = os.environ.get("INCISE_LIBDIR")
        os.environ["INCISE_LIBDIR"] = self.path("opt/lib")
        try:
            self.assertEqual(
                os.path.realpath(_plan.find_scene("own")),
                os.path.realpath(os.path.join(folder, "own.scene")),
            )
        finally:
            os.environ.pop("INCISE_LIBDIR")
            if before is not None:
                os.environ["INCISE_LIBDIR"] = before

    def test_errors(self):
        plan = incise.Plan("wall")
        self.says(incise.NotFound, "one of: liver, neck, wall", incise.Plan, "nek")
        self.says(incise.Invalid, "one of auto", incise.Plan, "neck", tool="axe")
        self.says(incise.Error, "arithmetic", incise.Plan, "neck", arithmetic="complex")
        self.says(incise.Error, "none.fis", incise.Plan, "liver", model=self.path("none.fis"))
        self.says(incise.Invalid, "a pose is", plan.step, 1, (1, 2))
        self.says(incise.Invalid, "a pose is", plan.step, 1, ("a", 0, 0))
        self.says(incise.Invalid, "tip_mm", incise.Plan, "wall", tip_mm=(math.nan, 0, 0))
        with open(self.path("bad.scene"), "w") as file:
            file.write("rate_hz = 1000.0;\ntisue = { plane_N_mm = 0.1; };\n")
        self.says(incise.Invalid, "tisue", incise.Plan, self.path("bad.scene"))
        with open(self.path("stiff.scene"), "w") as file:
            file.write("rate_hz = 1000.0;\ntissue = { spring_N_mm = 50.0; };\n")
        self.says(incise.Error, "", incise.Plan, self.path("stiff.scene"))

    @unittest.skipUnless(has("numpy"), "numpy is not installed")
    def test_run_is_step_by_step(self):
        """One C call gives the bits of as many."""
        import numpy

        # a pose every 8 ticks, which arrives at the time of its tick
        poses = [(10**9 + i * 8_000_000, position) for i, (_, position) in enumerate(stroke(240))]
        columns = {
            "t_ns": [t for t, _ in poses],
            **{f"{axis}_mm": [p[i] for _, p in poses] for i, axis in enumerate("xyz")},
        }
        ticks = incise.Plan("neck").run(columns)
        plan = incise.Plan("neck")
        for k in range(len(ticks["t_ns"])):
            tick = plan.step(1 + k * 1e-3, poses[k // 8][1] if k % 8 == 0 else None)
            self.assertEqual(tick.t_ns, ticks["t_ns"][k])
            self.assertEqual(list(tick.command_N), ticks["command_N"][k].tolist())
            self.assertEqual(tick.flags, ticks["flags"][k])
        self.assertEqual(k, 239 * 8)
        self.assertGreater((ticks["flags"] & 1).sum(), 100)
        self.assertTrue(numpy.isfinite(ticks["command_N"]).all())

    @unittest.skipUnless(has("numpy"), "numpy is not installed")
    def test_run_of_a_recording(self):
        rec = incise.open(os.path.join(self.shared, "short.rec"))
        plan = incise.Plan("liver")
        ticks = plan.run(rec.tracker)
        self.assertGreater(ticks["depth_mm"].max(), 5)
        self.assertGreater(ticks["command_N"][:, 2].max(), 0.5)
        for bad, said in (
            (5, "poses are a table"),
            ({"t_ns": [1]}, "no column x_mm"),
            ({"t_ns": [], "x_mm": [], "y_mm": [], "z_mm": []}, "there are none"),
            ({"t_ns": [2, 1], "x_mm": [0, 0], "y_mm": [0, 0], "z_mm": [0, 0]}, "ticks from"),
            ({"t_ns": [1, 3, 2, 9], **{a: [0] * 4 for a in ("x_mm", "y_mm", "z_mm")}}, "rise"),
            ({"t_ns": [1], "x_mm": ["a"], "y_mm": [0], "z_mm": [0]}, "poses:"),
        ):
            self.says(incise.Invalid, said, plan.run, bad)
        self.says(incise.Invalid, "no column hour", plan.run, rec.tracker, arrival="hour")


class Haptics(Case):
    def test_a_run_has_the_ticks_of_the_command(self):
        log = self.path("ticks.csv")
        rig = "sim:clock=simulated"
        run("incise", "haptic", "neck", "--rig", rig, "--duration", "2s", "-o", log)
        session = self.path("a.session")
        loop = incise.Haptic("neck", rig, duration_s=2, procedure=False, session=session)
        ticks = loop.wait()
        self.assertIs(loop.wait(), ticks)
        wanted = incise.read_log(log)
        self.assertEqual(list(ticks), list(wanted))
        for name, values in wanted.items():
            self.assertEqual(list(ticks[name]), list(values), name)
        self.assertEqual(loop.report["ticks"], 2000)
        trace = incise.read_log(session)
        self.assertEqual(list(trace)[:2], ["t_s", "tool"])
        self.assertEqual(trace.metadata["ticks"], 2000)

    def test_it_ends_behind_the_block(self):
        with incise.Haptic("neck", "sim:", realtime=False) as loop:
            self.assertIn("runs", repr(loop))
        self.assertIn("has ended", repr(loop))
        self.assertIsNotNone(loop._process.returncode)
        loop.stop()
        self.assertIsNone(loop.wait())

    def test_it_ends_without_a_terminal(self):
        """It listens once it catches SIGTERM, bit 14; SIGHUP would read the scene again."""
        program = (
            "import incise, re\n"
            "loop = incise.Haptic('neck', 'sim:', realtime=False)\n"
            "status = f'/proc/{loop._process.pid}/status'\n"
            "while not int(re.search('SigCgt:\\t(.*)', open(status).read())[1], 16) >> 14 & 1: pass\n"
            "loop.stop()\n"
            "print(loop._process.returncode, len(loop.report) > 0)\n"
        )
        said = run(sys.executable, "-c", program, start_new_session=True, timeout=120)
        self.assertEqual(said, "0 True\n")

    def test_a_loop_that_was_killed(self):
        loop = incise.Haptic("neck", "sim:", realtime=False)
        loop._process.kill()
        self.says(incise.Error, "ended with -9", loop.wait)

    def test_it_ends_with_python(self):
        start = "loop = incise.Haptic('neck', 'sim:', realtime=False)"
        pid = int(run(sys.executable, "-c", f"import incise; {start}; print(loop._process.pid)"))
        self.assertRaises(ProcessLookupError, os.kill, pid, 0)


class Calibrations(Case):
    def test_force_by_its_formula(self):
        """Readings made of the formula give its sensitivity back, to rounding."""
        masses = [0, 50, 100, 200, 300, 200, 100, 50, 0]
        g = incise.calibrate.gravity(48, 200)
        self.assertAlmostEqual(g, 9.8083, places=3)
        readings = [180 + 1240e-3 * g * m * (1 - 1.2 / 7950) for m in masses]
        found = incise.calibrate.force(
            masses, readings, descending=[i > 4 for i in range(9)], gravity_m_s2=g
        )
        self.assertAlmostEqual(found.sensitivity_mV_N, 1240, places=9)
        self.assertAlmostEqual(found.zero_mV, 180, places=9)
        self.assertTrue(found.passed)
        self.assertIn("gravity", [part.source for part in found.budget])
        self.says(incise.Invalid, "different lengths", incise.calibrate.force, masses, [1])
        self.says(incise.Invalid, "no such setting", incise.calibrate.force, masses, readings,
                  gravty=9.8)
        self.says(incise.Error, "", incise.calibrate.force, [1], [2])
        self.says(incise.Invalid, "mass_g", incise.calibrate.force, ["a"], [2])

    def test_depth(self):
        depths = [0, 2, 4, 6, 8, 10, 12]
        found = incise.calibrate.depth(depths, [400 - d / 0.118 for d in depths])
        self.assertAlmostEqual(found.mm_px, 0.118, places=12)
        self.says(incise.Error, "", incise.calibrate.depth, [0, 1], [400, 390])

    def test_tip(self):
        """A tool of 100 mm that turns about a dimple."""
        tip, pivot, poses = (3.0, -20.0, 60.0), (10.0, 20.0, 30.0), {}
        names = ("t_ns", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
        columns = {name: [] for name in names}
        for i in range(400):
            about, tilt = i * 0.37, 0.6 * math.sin(i * 0.11)
            q = (math.cos(tilt / 2), math.sin(tilt / 2) * math.cos(about),
                 math.sin(tilt / 2) * math.sin(about), 0.0)
            w, x, y, z = q
            cross = (y * tip[2] - z * tip[1], z * tip[0] - x * tip[2], x * tip[1] - y * tip[0])
            turned = [
                tip[k] + 2 * (w * cross[k] + (y * cross[2] - z * cross[1],
                                              z * cross[0] - x * cross[2],
                                              x * cross[1] - y * cross[0])[k])
                for k in range(3)
            ]
            for name, value in zip(names, (i, *(pivot[k] - turned[k] for k in range(3)), *q)):
                columns[name].append(value)
        found = incise.calibrate.tip(columns)
        for k in range(3):
            self.assertAlmostEqual(found.tip_mm[k], tip[k], places=9)
            self.assertAlmostEqual(found.pivot_mm[k], pivot[k], places=9)
        del columns["qw"]
        self.says(incise.Invalid, "no column qw", incise.calibrate.tip, columns)


if __name__ == "__main__":
    unittest.main()
