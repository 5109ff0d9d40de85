# SPDX-License-Identifier: GPL-2.0-or-later
"""
The drives of moteus_drive.py, and the bytes of tests/unit/moteus/library.h, tested by mjbots' own
library: pip install moteus==1.1.1. Nothing here is incise's.

    moteus_selftest.py [BYTES]   "ok …" or "not ok …" lines; BYTES: prints the header instead
"""

import asyncio
import math
import sys
from pathlib import Path
from types import SimpleNamespace

import moteus
from moteus import multiplex

import moteus_drive as drives

HEADER = Path(__file__).resolve().parent.parent / "unit/moteus/library.h"
# N m, N m, s: a torque, the largest one, the time-out.
COMMANDS = [(0.125, 0.5, 0.05), (0, 0, 0.05), (-0.3, 0.3, 0.05), (1 / 3, 1.7, 0.1),
            (-1e-9, 1e3, 0.001), (math.pi, 4, 2)]
# Turns, turns/s, N m, V, C, fault.
STATES = [(0, 0, 0, 24, 31, 0), (1 / 3, -2 / 3, 0.1, 11.5, -20, 0), (-1e5 / 7, 1e-7, -3, 48, 76, 38),
          (math.pi, 1e6, 1e-6, 0.5, 100, 0)]


def controller(number):
    query = moteus.QueryResolution()
    query.position = query.velocity = query.torque = multiplex.F32
    position = moteus.PositionResolution()
    for name in vars(moteus.PositionResolution):
        if not name.startswith("_"):
            setattr(position, name, multiplex.F32)
    position.kp_scale = position.kd_scale = position.ilimit_scale = multiplex.INT8
    return moteus.Controller(id=number, query_resolution=query, position_resolution=position,
                             transport=object())


def torque_command(servo, torque, most, watchdog):
    return servo.make_position(position=math.nan, velocity=0.0, feedforward_torque=torque,
                               kp_scale=0.0, kd_scale=0.0, ilimit_scale=0.0,
                               maximum_torque=most, watchdog_timeout=watchdog, query=True)


def hexed(data):
    return drives.padded(data).hex()


def header():
    """What the library sends, and what it reads in answers of the drives."""
    servo = controller(3)
    lines = ["/* SPDX-License-Identifier: GPL-2.0-or-later */",
             "/* Bytes of moteus 1.1.1 for motor 3, by tests/can/moteus_selftest.py. */",
             "static const char library_query[] =", f'\t"{hexed(servo.make_query().data)}";',
             "static const char library_stop[] =",
             f'\t"{hexed(servo.make_stop(query=True).data)}";',
             "static const struct {", "\tdouble torque, most, watchdog;",
             "\tconst char *bytes;", "} library_torques[] = {"]
    for command in COMMANDS:
        data = hexed(torque_command(servo, *command).data)
        lines += [f"\t{{{', '.join(repr(float(v)) for v in command)},", f'\t "{data}"}},']
    lines += ["};", "static const struct {", "\tconst char *bytes; /* of the drive */",
              "\tdouble mode, position, velocity, torque, voltage, temperature, fault;",
              "} library_answers[] = {"]
    R = moteus.Register
    for state in STATES:
        drive = drives.Drive(3)
        drive.position, drive.velocity, _, drive.voltage, drive.temperature, drive.fault = state
        drive.mode = 10
        drive.command.update({0x20: math.nan, 0x23: 0.0, 0x22: state[2]})
        data = drive.take(0x8003, servo.make_query().data)
        values = servo.make_query().parse(SimpleNamespace(arbitration_id=0x300, data=data)).values
        row = [values[r] for r in (R.MODE, R.POSITION, R.VELOCITY, R.TORQUE, R.VOLTAGE,
                                   R.TEMPERATURE, R.FAULT)]
        lines += [f'\t{{"{data.hex()}",', f"\t {', '.join(repr(float(v)) for v in row)}}},"]
    return "\n".join(lines + ["};", ""])


class Desk:
    """The library's transport to drives in this process."""

    def __init__(self, *numbers):
        self.drives = {n: drives.Drive(n) for n in numbers}

    async def cycle(self, commands, *_, **__):
        results = []
        for command in commands:
            identifier = command.source << 8 | command.destination | command.reply_required << 15
            answer = self.drives[command.destination].take(identifier, command.data)
            if answer is not None:
                results.append(command.parse(SimpleNamespace(
                    arbitration_id=command.destination << 8, data=answer)))
        return results

    def advance(self, seconds):
        for _ in range(round(seconds * 1000)):
            for drive in self.drives.values():
                drive.advance(0.001)


def check(what, good):
    print(("ok " if good else "not ok ") + what)
    return good


async def talk():
    desk = Desk(3)
    servo = controller(3)
    servo.transport = desk
    drive = desk.drives[3]
    R = moteus.Register
    good = True

    async def mode():
        return (await servo.query()).values[R.MODE]

    good &= check("stopped", (await servo.set_stop(query=True)).values[R.MODE] == 0)
    await desk.cycle([torque_command(servo, 0.05, 0.5, 0.05)])
    desk.advance(0.04)
    good &= check("it starts", await mode() == 10 and abs(drive.torque - 0.05) < 1e-8)
    good &= check("it turns", (await servo.query()).values[R.VELOCITY] > 0)
    desk.advance(0.06)
    good &= check("its watchdog runs out", await mode() == 11 and drive.torque == 0)
    await desk.cycle([torque_command(servo, 0.05, 0.5, 0.05)])
    good &= check("only a stop ends that", await mode() == 11)
    await servo.set_stop(query=True)
    good &= check("a stop", await mode() == 0)
    drive.break_down(38)
    values = (await servo.query()).values
    good &= check("a fault", values[R.MODE] == 1 and values[R.FAULT] == 38)
    return good


if __name__ == "__main__":
    if sys.argv[1:]:
        print(header(), end="")
    else:
        same = check("the bytes of library.h", HEADER.read_text().split() == header().split())
        sys.exit(not (asyncio.run(talk()) and same))
