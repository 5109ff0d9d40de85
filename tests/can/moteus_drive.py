# SPDX-License-Identifier: GPL-2.0-or-later
"""
Moteus drives for tests, on CAN FD: written from the protocol's description, shares no code with
incise.

    host ── can0 ── Drive ── the shaft: inertia, friction, cogging

    moteus_drive.py --can vcan0 --ids 1,2,3

Commands on standard input, a line of JSON each as answer: `state ID`, `fault ID CODE`, `silent ID`,
`jump ID TURNS`, `nan ID`, `refuse ID REGISTER`, `push ID TORQUE_N_m`, `report`. Its end ends it.
"""

import argparse
import json
import math
import os
import select
import struct
import sys
import time

STOPPED, FAULT, STARTING, POSITION, TIMEOUT = 0, 1, 3, 10, 11
INT8, INT16, INT32, FLOAT = range(4)
SIZES, FORMATS = (1, 2, 4, 4), ("<b", "<h", "<i", "<f")
LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
PADDING = 0x50
START_S = 0.03  # measures its offsets
NO_SUCH_REGISTER = 1

# Units of int8, int16 and int32, by the protocol's description.
TURNS, TURNS_S, TORQUE = (0.01, 1e-4, 1e-5), (0.1, 2.5e-4, 1e-5), (0.5, 0.01, 0.001)
VOLTS, CELSIUS, WHOLE = (0.5, 0.1, 0.001), (1, 0.1, 0.001), (1, 1, 1)
SHARE, SECONDS = (1 / 127, 1 / 32767, 1 / 2147483647), (0.01, 0.001, 1e-6)
READ = {0: WHOLE, 1: TURNS, 2: TURNS_S, 3: TORQUE, 0xD: VOLTS, 0xE: CELSIUS, 0xF: WHOLE}
WRITE = {0: WHOLE, 0x20: TURNS, 0x21: TURNS_S, 0x22: TORQUE, 0x23: SHARE, 0x24: SHARE,
         0x25: TORQUE, 0x27: SECONDS, 0x2B: SHARE}


def varuint(data, at):
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if not byte & 0x80:
            return value, at


def subframes(data):
    """(kind without its number, type, first register, values or their number) of a command."""
    at = 0
    while at < len(data):
        kind, at = data[at], at + 1
        if kind == PADDING:
            continue
        if kind >= 0x20:
            raise ValueError(f"subframe 0x{kind:02x} is no command")
        number, kind, of_type = kind & 3, kind & 0x10, kind >> 2 & 3
        if not number:
            number, at = varuint(data, at)
        first, at = varuint(data, at)
        if kind:
            yield kind, of_type, first, number
            continue
        end = at + number * SIZES[of_type]
        if end > len(data):
            raise ValueError("a subframe is cut off")
        values = [v[0] for v in struct.iter_unpack(FORMATS[of_type], data[at:end])]
        at = end
        yield kind, of_type, first, values


def padded(data):
    length = min(n for n in LENGTHS if n >= len(data))
    return bytes(data) + bytes([PADDING]) * (length - len(data))


class Drive:
    """A motor; turns, turns/s, N m, s. Time is told by advance()."""

    def __init__(self, number):
        self.number = number
        self.mode = self.fault = 0
        self.mode_s = 0.0
        self.position = self.velocity = self.hand = 0.0
        self.voltage, self.temperature = 24.0, 31.0
        self.inertia, self.friction, self.cogging = 1e-5, 0.002, 0.001  # N m / (turn/s²), N m, N m
        self.forget()
        self.silent = self.gives_nan = False
        self.has_watchdog = True
        self.refused = None
        self.commands = self.answers = 0
        self.most_age = 0.0

    def forget(self):
        self.command = {0x20: 0.0, 0x21: 0.0, 0x22: 0.0, 0x23: 1.0, 0x24: 1.0, 0x25: math.nan,
                        0x27: 0.0, 0x2B: 1.0}
        self.age = 0.0

    def go(self, mode):
        if mode != self.mode:
            self.mode, self.mode_s = mode, 0.0

    def break_down(self, code):
        self.fault = code
        self.go(FAULT)

    @property
    def torque(self):
        if self.mode != POSITION:
            return 0.0
        assert math.isnan(self.command[0x20]) and not self.command[0x23], "a position command"
        most = self.command[0x25]
        wanted = self.command[0x22]
        return wanted if math.isnan(most) else max(-most, min(most, wanted))

    def advance(self, dt):
        self.mode_s += dt
        self.age += dt
        if self.mode == STARTING and self.mode_s >= START_S:
            self.go(POSITION)
            self.age = 0.0
        limit = self.command[0x27] or 0.1
        if self.mode == POSITION and self.has_watchdog and self.age > limit:
            self.go(TIMEOUT)
        push = self.torque + self.hand
        push += self.cogging * math.sin(2 * math.pi * 12 * self.position)
        if self.mode == TIMEOUT:
            self.velocity *= max(0.0, 1 - 50 * dt)
        after = self.velocity + push / self.inertia * dt
        slow = self.friction / self.inertia * dt
        self.velocity = math.copysign(max(0.0, abs(after) - slow), after)
        self.position += self.velocity * dt

    def write(self, of_type, register, value):
        if register == self.refused or register not in WRITE:
            return bytes([0x30]) + bytes([register & 0x7F, NO_SUCH_REGISTER])
        if of_type != FLOAT:
            least = -(1 << 8 * SIZES[of_type] - 1)
            value = math.nan if value == least else value * WRITE[register][of_type]
        if register:
            self.command[register] = value
            return b""
        if value == STOPPED:
            self.fault = 0
            self.go(STOPPED)
        elif value == POSITION:
            self.forget()
            if self.mode == STOPPED:
                self.go(STARTING)
        return b""

    def value(self, register):
        if register in (1, 2, 3) and self.gives_nan:
            return math.nan
        return {0: self.mode, 1: self.position, 2: self.velocity, 3: self.torque,
                0xD: self.voltage, 0xE: self.temperature, 0xF: self.fault}[register]

    def read(self, of_type, first, number):
        registers = range(first, first + number)
        for register in registers:
            if register == self.refused or register not in READ:
                return bytes([0x31, register & 0x7F, NO_SUCH_REGISTER])
        head = [0x20 | of_type << 2 | number, first] if number < 4 else \
            [0x20 | of_type << 2, number, first]
        body = b""
        for register in registers:
            value = self.value(register)
            if of_type != FLOAT:
                least = -(1 << 8 * SIZES[of_type] - 1)
                value = least if math.isnan(value) else \
                    max(least + 1, min(-least - 1, round(value / READ[register][of_type])))
            body += struct.pack(FORMATS[of_type], value)
        return bytes(head) + body

    def take(self, identifier, data):
        """The data of the answer, or None."""
        if identifier & 0x7F != self.number or identifier & 0x80 or self.silent:
            return None
        answer = b""
        try:
            for kind, of_type, first, what in subframes(data):
                if kind:
                    answer += self.read(of_type, first, what)
                    continue
                self.commands += 1
                for i, value in enumerate(what):
                    answer += self.write(of_type, first + i, value)
        except (ValueError, IndexError) as error:
            print(f"moteus: {error}", file=sys.stderr)
            return None
        if not identifier & 0x8000:
            return None
        self.answers += 1
        return padded(answer)

    def state(self):
        return {"mode": self.mode, "position": self.position, "torque": self.torque,
                "velocity": self.velocity, "commands": self.commands, "answers": self.answers}


def obey(drives, words):
    if words[0] == "report":
        return [drive.state() for drive in drives.values()]
    drive = drives[int(words[1])]
    number = float(words[2]) if len(words) > 2 else 0
    actions = {
        "state": lambda: None,
        "fault": lambda: drive.break_down(int(number)),
        "silent": lambda: setattr(drive, "silent", True),
        "nan": lambda: setattr(drive, "gives_nan", True),
        "jump": lambda: setattr(drive, "position", drive.position + number),
        "refuse": lambda: setattr(drive, "refused", int(number)),
        "watchdog": lambda: setattr(drive, "has_watchdog", bool(number)),
        "push": lambda: setattr(drive, "hand", number),
    }
    actions[words[0]]()
    return drive.state()


def serve(bus, drives):
    """Frames and commands as they come; the shafts move in steps of a millisecond at most."""
    import can
    before = time.monotonic()
    while True:
        ready, _, _ = select.select([bus, sys.stdin], [], [], 0.001)
        now = time.monotonic()
        while before < now:
            step = min(0.001, now - before)
            before += step
            for drive in drives.values():
                drive.advance(step)
        if bus in ready:
            frame = bus.recv(0)
            identifier = frame.arbitration_id & 0xFFFF if frame else 0
            drive = drives.get(identifier & 0x7F)
            answer = drive.take(identifier, frame.data) if drive else None
            if answer is not None:
                to = drive.number << 8 | identifier >> 8 & 0x7F
                bus.send(can.Message(arbitration_id=to, is_extended_id=to > 0x7FF, data=answer,
                                     is_fd=True, bitrate_switch=True))
        if sys.stdin in ready:
            line = sys.stdin.readline()
            if not line:
                return
            try:
                print(json.dumps(obey(drives, line.split())), flush=True)
            except (KeyError, ValueError, IndexError) as error:
                print(json.dumps({"error": f"{error}"}), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 2)[1])
    parser.add_argument("--can", required=True)
    parser.add_argument("--ids", default="1")
    parser.add_argument("--without-watchdog", action="store_true")
    args = parser.parse_args()
    import can
    drives = {int(number): Drive(int(number)) for number in args.ids.split(",")}
    for drive in drives.values():
        drive.has_watchdog = not args.without_watchdog
    with can.Bus(interface="socketcan", channel=args.can, fd=True, ignore_config=True) as bus:
        print(f"ready moteus:{args.can}:{args.ids}", flush=True)
        serve(bus, drives)


if __name__ == "__main__":
    main()
