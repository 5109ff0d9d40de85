# SPDX-License-Identifier: GPL-2.0-or-later
"""incise in MuJoCo: attach() and the plugin give the forces of a plan, to the bit; the robot of the example rests.

Needs mujoco of pip. CASES=all: 100 000 steps of a path, else a twentieth."""

import math
import os
import shutil
import subprocess
import sys
import time
import unittest
import warnings

import incise
from fixtures import BUILD, SOURCE, Case, has

STEPS = 100_000 if os.environ.get("CASES") == "all" else 5_000
EXAMPLE = os.path.join(SOURCE, "examples", "mujoco")
NECK = os.path.join(SOURCE, "scenes", "neck.scene")

if has("mujoco"):
    import mujoco
    import numpy

# A blade that is moved by hand, tip away from its centre of mass, over a patient that lies askew.
MOVED = """
<mujoco>
  <extension><plugin plugin="incise.tissue"/></extension>
  <option timestep="{step}" integrator="{integrator}"/>
  <worldbody>
    <body name="bed" mocap="true" pos="0.1 0.2 0.3" quat="0.9 0.1 0.3 -0.2"><site name="patient" pos="0.02 0 0"/></body>
    <body name="blade"><freejoint/><geom size="0.01" pos="0 0 0.05" mass="0.1"/>
      <site name="tip" pos="0 0.003 -0.01" euler="0 0 0.4"/>{plugin}
    </body>
  </worldbody>
</mujoco>
"""
PLUGIN = """<plugin plugin="incise.tissue"><config key="scene" value="{scene}"/><config key="tip" value="{tip}"/>
      <config key="frame" value="{frame}"/></plugin>"""


def plugin(scene=NECK, tip="", frame=""):
    return PLUGIN.format(scene=scene, tip=tip, frame=frame)


def pose_at(k):
    """A blade that cuts, turns round and comes again, in m."""
    tilt = 0.05 * math.sin(k * 0.003)
    position = 0.06 + 0.02 * math.sin(k * 4e-4), 0.002 * math.sin(k * 7e-4), 0.004 - 0.008 * math.sin(k * 0.0025)
    return position, (math.cos(tilt), 0.3 * math.sin(tilt), math.sin(tilt), 0.0)


@unittest.skipUnless(has("mujoco"), "mujoco is not installed")
class MuJoCo(Case):
    @classmethod
    def setUpClass(cls):
        """Build the plugin as its user does, and load it; it stays in the process."""
        folder = os.path.join(os.environ.get("BATS_FILE_TMPDIR", BUILD), "tests/mujoco-examples")
        shutil.copytree(os.path.join(SOURCE, "examples"), folder, dirs_exist_ok=True)
        include, library = os.path.join(SOURCE, "lib/include"), os.path.join(BUILD, "lib")
        made = ["make", "-s", "-B", "-C", folder, "mujoco/incise_plugin.so", f"PYTHON={sys.executable}", "CFLAGS=-O2 -Werror", "example_cflags=-Wall -Wextra",
                f"CPPFLAGS=-I{include}", f"LDFLAGS=-L{library} -Wl,-rpath,{library}", "example_libs=-lincise -lm"]  # fmt: skip
        environment = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "LD_PRELOAD")}
        done = subprocess.run(made, env=environment, text=True, stderr=subprocess.PIPE)
        assert done.returncode == 0, done.stderr
        mujoco.mj_loadPluginLibrary(os.path.join(folder, "mujoco/incise_plugin.so"))

    def model(self, made="", step=0.001, integrator="implicitfast"):
        model = mujoco.MjModel.from_xml_string(MOVED.format(plugin=made, step=step, integrator=integrator))
        return model, mujoco.MjData(model)

    def robot(self):
        """The robot of the example, with the plugin."""
        with open(os.path.join(EXAMPLE, "scara.xml")) as file:
            text = file.read()
        for before, added in (
            ("<worldbody>", '<extension><plugin plugin="incise.tissue"/></extension>'),
            ('<site name="tip"', plugin(tip="tip", frame="patient")),
        ):
            text = text.replace(before, added + before, 1)
        return mujoco.MjModel.from_xml_string(text)

    def attach(self, *arguments, **named):
        attached = incise.mujoco.attach(*arguments, **named)
        self.addCleanup(attached.detach)
        return attached

    def move(self, model, data, k):
        """One step with the blade where the path has it."""
        position, quaternion = pose_at(k)
        data.qpos[:7] = *position, *quaternion
        data.qvel[:] = 0
        mujoco.mj_step(model, data)

    def test_forces_are_those_of_a_plan(self):
        model, data = self.model()
        made, of_plugin = self.model(plugin())
        tissue = self.attach(model, data, body="blade", scene="neck")
        host = incise.Host("neck")
        plan = incise.Plan("neck", tracker_hz=1000, latency_ms=0)
        columns = {name: [] for name in "t_ns x_mm y_mm z_mm qw qx qy qz".split()}
        forces = numpy.zeros((STEPS, 3))
        times = numpy.zeros((STEPS, 5))
        for k in range(STEPS):
            times[k, 0] = time.perf_counter()
            self.move(model, data, k)
            times[k, 1] = time.perf_counter()
            self.move(made, of_plugin, k)
            times[k, 2] = time.perf_counter()
            forces[k] = tissue.force_N
            self.assertEqual(data.xfrc_applied.tobytes(), of_plugin.xfrc_applied.tobytes())
            pose = tissue.host.pose.position_mm[:], tissue.host.pose.quaternion[:]
            times[k, 3] = time.perf_counter()
            wrench = host.step(k * 1e-3, pose)
            times[k, 4] = time.perf_counter()
            self.assertEqual(tissue.force_N, wrench.force_N)
            self.assertEqual(tissue.force_N, plan.step(2 + k * 1e-3, pose).command_N)
            for name, value in zip(columns, (2 * 10**9 + k * 10**6, *pose[0], *pose[1])):
                columns[name].append(value)
        self.assertGreater(forces[:, 2].max(), 0.5)
        in_c = incise.Plan("neck", tracker_hz=1000, latency_ms=0).run(columns)
        self.assertEqual(in_c["command_N"].tobytes(), forces.tobytes())
        attached, of_plugin, _, stepped = 1e6 * numpy.median(numpy.diff(times), axis=0)
        print(f"{STEPS} steps: attach() costs {attached - of_plugin:.1f} us more than the plugin; Host.step() {stepped:.1f} us")

    def test_sites_and_frames(self):
        """A site, and a patient that moves and lies askew: the wrench is turned, and taken to the centre of mass."""
        model, data = self.model()
        made, of_plugin = self.model(plugin(tip="tip", frame="patient"))
        tissue = self.attach(model, data, body="tip", scene="neck", frame="patient")
        patient, tip, blade = data.site("patient"), data.site("tip"), model.body("blade").id
        position, turn, most = numpy.zeros(3), numpy.zeros(4), 0.0
        for k in range(2000):
            for m, d in ((model, data), (made, of_plugin)):
                d.mocap_pos[0] = 0.1, 0.2 + 0.01 * math.sin(k * 0.002), 0.3
                mujoco.mj_kinematics(m, d)
            place, attitude = map(numpy.array, pose_at(k))
            mujoco.mju_mat2Quat(turn, patient.xmat)
            mujoco.mju_mulPose(position, turn, patient.xpos, turn.copy(), place + [0, 0, 0.01], attitude)
            for m, d in ((model, data), (made, of_plugin)):
                d.qpos[:7] = *position, *turn
                d.qvel[:] = 0
                mujoco.mj_step(m, d)
            self.assertEqual(data.xfrc_applied.tobytes(), of_plugin.xfrc_applied.tobytes())
            wrench, axes = tissue.host.wrench, patient.xmat.reshape(3, 3)
            force, twist = (axes @ numpy.array(part) for part in (wrench.force_N, wrench.torque_N_mm))
            moment = 1e-3 * twist + numpy.cross(tip.xpos - data.xipos[blade], force)
            numpy.testing.assert_allclose(data.xfrc_applied[blade], [*force, *moment], atol=1e-12)
            most = max(most, numpy.linalg.norm(force))
        self.assertGreater(most, 0.2)

    def test_the_robot_rests(self):
        """The example: at rest under the lean, without swing, by attach() and by the plugin alike."""
        environment = {**os.environ, "PYTHONPATH": os.path.join(SOURCE, "python")}
        program = os.path.join(EXAMPLE, "robot_cuts_neck.py")
        done = subprocess.run([sys.executable, program], check=True, env=environment, text=True, stdout=subprocess.PIPE)
        self.assertRegex(done.stdout, r"^at rest: 7\.1\d mm deep under 1\.000 N, (29|30)\.\d mm along, swing 0\.0 um\n$")
        done = subprocess.run([sys.executable, program, "--scene", "nek"], env=environment, text=True, stderr=subprocess.PIPE)
        self.assertEqual(done.returncode, 1)
        self.assertIn("one of: liver, neck, wall", done.stderr)
        model, made = mujoco.MjModel.from_xml_path(os.path.join(EXAMPLE, "scara.xml")), self.robot()
        data, of_plugin = mujoco.MjData(model), mujoco.MjData(made)
        tissue = self.attach(model, data, body="tip", scene="neck", frame="patient")
        for m, d in ((model, data), (made, of_plugin)):
            d.qpos[:] = -0.66, 1.3, 0, -0.7
            d.ctrl[:] = -0.6, 1.3, -0.7, -1
            mujoco.mj_step(m, d, 1500)
        self.assertGreater(data.xfrc_applied[:, 2].max(), 0.5)
        self.assertEqual(data.qpos.tobytes(), of_plugin.qpos.tobytes())

    def test_the_robot_rests_under_any_lean(self):
        """The robot has the damping of the scene's device; it falls on the neck, with steps of MuJoCo up to 8 ms."""
        model = mujoco.MjModel.from_xml_path(os.path.join(EXAMPLE, "scara.xml"))
        for step in (0.001, 0.002, 0.008):
            model.opt.timestep = step
            data = mujoco.MjData(model)
            tissue = self.attach(model, data, body="tip", scene="neck", frame="patient")
            for lean in (0.5, 1, 2, 3.5):
                mujoco.mj_resetData(model, data)
                data.qpos[:] = -0.66, 1.3, 0, -0.7
                data.ctrl[:] = -0.66, 1.3, -0.7, -lean
                mujoco.mj_step(model, data, int(4 / step))
                before = data.site("tip").xpos.copy()
                moved = []
                for _ in range(int(1 / step)):
                    mujoco.mj_step(model, data)
                    moved.append(numpy.abs(data.site("tip").xpos - before).max())
                self.assertLess(max(moved), 1e-6, (step, lean))
                self.assertAlmostEqual(tissue.force_N[2], lean, places=3)
            tissue.detach()

    def test_rollouts(self):
        """The plugin in rollouts of two threads: each as by itself."""
        from mujoco import rollout

        model, kind = self.robot(), mujoco.mjtState.mjSTATE_FULLPHYSICS
        data, start = mujoco.MjData(model), numpy.zeros(mujoco.mj_stateSize(model, kind))
        data.qpos[:] = -0.66, 1.3, 0, -0.7
        mujoco.mj_getState(model, data, start, kind)
        controls = numpy.zeros((4, 600, model.nu))
        controls[:] = -0.66, 1.3, -0.7, 0
        controls[:, :, 3] = numpy.array([[-0.5], [-1], [-2], [-3]])
        states, _ = rollout.rollout(model, [mujoco.MjData(model) for _ in range(2)], numpy.tile(start, (4, 1)), controls)
        for control, state in zip(controls, states):
            mujoco.mj_setState(model, data, start, kind)
            for k in range(600):
                data.ctrl[:] = control[k]
                mujoco.mj_step(model, data)
            self.assertGreater(data.xfrc_applied[:, 2].max(), 0.1)
            self.assertEqual(data.qpos.tobytes(), state[-1, 1 : 1 + model.nq].tobytes())

    def test_episodes(self):
        """After mj_resetData() the cuts are healed, also with a Host of one's own."""
        model, data = self.model(step=0.002)
        made, of_plugin = self.model(plugin())
        self.attach(model, data, body="blade", scene=incise.Host("neck", step_s=0.002, fit_gain=True))
        episodes = []
        for _ in range(2):
            mujoco.mj_resetData(model, data)
            mujoco.mj_resetData(made, of_plugin)
            rows = []
            for k in range(800):
                self.move(model, data, k)
                self.move(made, of_plugin, k)
                rows.append(data.xfrc_applied.tobytes() + of_plugin.xfrc_applied.tobytes())
            episodes.append(rows)
        self.assertEqual(*episodes)

    def test_detach(self):
        """It leaves nothing behind, and a callback of one's own goes on."""
        seen = []
        before = lambda model, data: seen.append(data.time)  # noqa: E731
        model, data = self.model()
        mujoco.set_mjcb_passive(before)
        self.addCleanup(mujoco.set_mjcb_passive, None)
        other = mujoco.MjData(model)
        tissue = self.attach(model, data, body="blade", scene="wall")
        self.says(incise.Invalid, "detach() that", incise.mujoco.attach, model, data, body="tip", scene="wall")
        for k in range(150, 400):
            self.move(model, data, k)
            self.move(model, other, k)
        self.assertEqual(len(seen), 500)
        self.assertGreater(tissue.force_N[2], 0.1)
        self.assertEqual(tissue.tick.tool, "blade")
        self.assertFalse(other.xfrc_applied.any())
        tissue.detach()
        tissue.detach()
        self.assertFalse(data.xfrc_applied.any())
        self.assertIs(mujoco.get_mjcb_passive(), before)
        mujoco.mj_step(model, data)
        self.assertFalse(data.xfrc_applied.any())

    def test_a_longer_step_is_said(self):
        model, data = self.model()
        self.attach(model, data, body="blade", scene="wall")
        mujoco.mj_step(model, data)
        data.time += 1
        with self.assertWarnsRegex(UserWarning, "longer than the host's step_s.*ramps to 0"):
            mujoco.mj_step(model, data)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            mujoco.mj_step(model, data)

    def test_a_wrong_pose_leaves_no_force(self):
        model, data = self.model()
        tissue = self.attach(model, data, body="blade", scene="wall")
        for k in range(150, 400):
            self.move(model, data, k)
        self.assertGreater(tissue.force_N[2], 0.1)
        tissue._frame = numpy.full(3, numpy.nan)
        self.says(incise.Invalid, "the pose is not finite", tissue._apply)
        self.assertFalse(data.xfrc_applied.any())

    def test_errors(self):
        model, data = self.model()
        attach = incise.mujoco.attach
        self.says(incise.NotFound, "one of: world, bed, blade, patient, tip", attach, model, data, "blad", "neck")
        self.says(incise.NotFound, "frame='here'", attach, model, data, "blade", "neck", "here")
        self.says(incise.NotFound, "no such scene", attach, model, data, "blade", "nek")
        self.says(TypeError, "MjModel", attach, "model.xml", None, "blade", "neck")
        self.says(incise.Invalid, "implicitfast", attach, *self.model(integrator="RK4"), "blade", "neck")
        for message, options in (
            ('tip "blad": no such body or site', {"made": plugin(tip="blad")}),
            ("none.scene: ", {"made": plugin(scene="none.scene")}),
            ("implicitfast", {"made": plugin(), "integrator": "RK4"}),
        ):
            with self.assertRaisesRegex(ValueError, message):
                self.model(**options)


class Without(Case):
    def test_mujoco_is_not_there(self):
        program = "import sys; sys.modules['mujoco'] = None; import incise; incise.mujoco.attach(0, 0, 'a', 'neck')"
        done = subprocess.run([sys.executable, "-c", program], text=True, stderr=subprocess.PIPE)
        self.assertEqual(done.stderr.splitlines()[-1], "ImportError: incise.mujoco needs MuJoCo; pip install mujoco")


if __name__ == "__main__":
    unittest.main()
