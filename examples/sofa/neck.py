# Not run against the real thing: there was no SOFA here, and the test plays its part.
# SPDX-License-Identifier: GPL-2.0-or-later
"""A blade that leans on the neck in SOFA, by SofaPython3: runSofa examples/sofa/neck.py

Tissue is a controller. Before each step of SOFA it gives the pose of a Rigid3d to incise, and puts
the wrench into a ConstantForceField. Inside of a step of SOFA incise runs ticks of 1 ms.
"""

import Sofa

import incise

STEP_S, LEAN_N = 0.01, 1.0
PLUGINS = (
    "Sofa.Component.LinearSolver.Iterative",
    "Sofa.Component.Mass",
    "Sofa.Component.MechanicalLoad",
    "Sofa.Component.ODESolver.Backward",
    "Sofa.Component.StateContainer",
)


class Tissue(Sofa.Core.Controller):
    """The tissue of a scene, which pushes a rigid body of SOFA.

    root: whose time counts. state: the MechanicalObject, Rigid3d, whose first pose is that of the tip. field: a
    ConstantForceField on it. host: an incise.Host whose step_s is SOFA's dt. SOFA has no units:
    length_mm and force_N are those of the program.
    """

    def __init__(self, *args, root, state, field, host, length_mm=1000.0, force_N=1.0, **kwargs):
        Sofa.Core.Controller.__init__(self, *args, **kwargs)
        self.root, self.state, self.field, self.host = root, state, field, host
        self.length_mm, self.unit_N = length_mm, force_N
        self.time, self.fades = 0.0, ""

    def onAnimateBeginEvent(self, event):
        pose = [float(number) for number in self.state.position.value[0]]
        position = [number * self.length_mm for number in pose[:3]]
        x, y, z, w = pose[3:]
        if self.root.time.value < self.time:  # of another run: the cuts heal
            self.host.reset()
        self.time = self.root.time.value
        wrench = self.host.step(self.time, (position, (w, x, y, z)))
        if wrench.fades and wrench.fades != self.fades:
            print(f"incise: {wrench.fades}: the force ramps to 0")
        self.fades = wrench.fades
        force = [number / self.unit_N for number in wrench.force_N]
        torque = [number / (self.unit_N * self.length_mm) for number in wrench.torque_N_mm]
        self.field.forces.value = [force + torque]


def createScene(root):
    """A scalpel of 50 g in a hand that leans with 1 N, in metres."""
    root.dt = STEP_S
    root.gravity = [0, 0, 0]
    root.addObject("RequiredPlugin", pluginName=list(PLUGINS))
    root.addObject("DefaultAnimationLoop")
    blade = root.addChild("blade")
    blade.addObject("EulerImplicitSolver", rayleighMass=0.0, rayleighStiffness=0.0)
    blade.addObject("CGLinearSolver", iterations=25, tolerance=1e-9, threshold=1e-9)
    state = blade.addObject(
        "MechanicalObject", template="Rigid3d", position=[[0.06, 0, 0.002, 0, 0, 0, 1]]
    )
    # mass, volume, and the inertia of a unit mass
    blade.addObject("UniformMass", vertexMass="0.05 1 1e-3 0 0 0 1e-3 0 0 0 1e-3")
    blade.addObject("UniformVelocityDampingForceField", dampingCoefficient=10.0)
    blade.addObject(
        "ConstantForceField", name="hand", indices=[0], forces=[[0, 0, -LEAN_N, 0, 0, 0]]
    )
    field = blade.addObject("ConstantForceField", name="push", indices=[0], forces=[[0] * 6])
    host = incise.Host("neck", step_s=STEP_S, fit_gain=True)
    root.addObject(Tissue(name="tissue", root=root, state=state, field=field, host=host))
    return root
