#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""A SCARA robot leans a blade on the neck, cuts along it, and stops: MuJoCo with the forces of incise.

    examples/mujoco/robot_cuts_neck.py [--figure FIGURE.png]

Needs mujoco, and matplotlib for a figure; both come by pip.
"""

import argparse
import math
import pathlib
import sys
from typing import Iterator, Sequence, Tuple

import incise

ARM_M, LEAN_N = 0.2, 1.0  # of either arm; of the quill
START_M, CUT_M, CUT_M_S = 0.28, 0.03, 0.01
LOWER_S, REST_S = 2.0, 1.0
Row = Tuple[float, float, float, Sequence[float]]


def aim(x: float, y: float) -> Tuple[float, float, float]:
    """Angles of shoulder, elbow and wrist with the quill at a point and the blade along x."""
    elbow = math.acos((x * x + y * y) / (2 * ARM_M**2) - 1)
    shoulder = math.atan2(y, x) - elbow / 2
    return shoulder, elbow, -shoulder - elbow


def run(scene: str) -> Iterator[Row]:
    """Yield time, way along the neck, depth and force, in s, mm and N, at each step."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(pathlib.Path(__file__).with_name("scara.xml")))
    data = mujoco.MjData(model)
    arm = [model.joint(name).qposadr[0] for name in ("shoulder", "elbow", "turn")]
    data.qpos[arm] = aim(START_M, 0)
    tissue = incise.mujoco.attach(model, data, body="tip", scene=scene, frame="patient")
    while data.time < LOWER_S + CUT_M / CUT_M_S + REST_S:
        way = min(max(data.time - LOWER_S, 0) * CUT_M_S, CUT_M)
        data.ctrl[:] = (*aim(START_M + way, 0), -LEAN_N)
        mujoco.mj_step(model, data)
        tick = tissue.tick
        yield data.time, tick.tool_mm[0], tick.depth_mm, tissue.force_N
    tissue.detach()


def draw(rows: Sequence[Row], file: str) -> None:
    """Draw depth and force by the time."""
    from matplotlib import pyplot

    time, _, depth, force = zip(*rows)
    figure, (above, below) = pyplot.subplots(2, sharex=True)
    above.plot(time, depth)
    above.set(ylabel="depth (mm)")
    below.plot(time, force, label=("along", "across", "up"))
    below.set(xlabel="time (s)", ylabel="force on the blade (N)")
    below.legend()
    figure.savefig(file)


def main() -> None:
    parser = argparse.ArgumentParser(description="A robot cuts the neck.")
    parser.add_argument("--scene", default="neck", help="a .scene file or the name of a shipped one")
    parser.add_argument("--figure", help="draw depth and force to this file")
    options = parser.parse_args()
    try:
        rows = list(run(options.scene))
    except (incise.Error, ImportError) as error:
        sys.exit(f"robot_cuts_neck.py: {error}")
    _, way, depth, force = rows[-1]
    last = [row[2] for row in rows if row[0] > rows[-1][0] - REST_S / 2]
    print(f"at rest: {depth:.2f} mm deep under {force[2]:.3f} N, {way - rows[0][1]:.1f} mm along, "
          f"swing {1e3 * (max(last) - min(last)):.1f} um")
    if options.figure:
        draw(rows, options.figure)


main()
