# SPDX-License-Identifier: GPL-2.0-or-later
"""
Commands of a test to the drive: a line in is a command, a line out its answer, in
JSON. `help` lists them. The end of the input ends the drive.
"""

import json
import os
import sys


def on(words):
    return not words or words[0] != "off"


def where(words):
    """INDEX [SUB]; no SUB or "all" is the whole object."""
    sub = words[1] if len(words) > 1 else "all"
    return int(words[0], 0), None if sub == "all" else int(sub, 0)


def listed(objects):
    return [f"0x{index:04X}:{sub}" for index, sub in objects]


class Control:
    def __init__(self, drive):
        self.drive = drive
        self.loop = None
        self.done = False
        self._rest = b""

    def fileno(self):
        return sys.stdin.fileno()

    def take(self):
        data = os.read(self.fileno(), 4096)
        if not data:
            self.done = True
            return
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            words = line.decode("utf-8", "replace").split()
            if words:
                self.answer(self.obey(words))

    def answer(self, what):
        print(json.dumps(what), flush=True)

    def obey(self, words):
        action = getattr(self, words[0], None) if words[0] in COMMANDS else None
        if action is None:
            return {"error": f"no such command: {words[0]}"}
        try:
            return action(words[1:]) or {"ok": words[0]}
        except (ValueError, IndexError) as error:
            return {"error": f"{words[0]}: {error}"}

    def help(self, _):
        """this"""
        return {name: (getattr(self, name).__doc__ or "").strip() for name in COMMANDS}

    # Questions.

    def state(self, _):
        """where it is and how it is"""
        drive, machine = self.drive, self.drive.machine
        return {
            "state": machine.state, "mode": machine.mode, "nmt": drive.nmt,
            "position": machine.position, "shaft": round(machine.shaft),
            "velocity": round(machine.velocity), "statusword": machine.statusword,
            "inputs": machine.inputs, "error": machine.error, "homed": machine.homed,
            "master_lost": drive.lost,
        }

    def report(self, _):
        """state, counters, times between SYNCs, events"""
        made = self.state([])
        made.update(self.drive.record.report())
        bus = self.drive.network.bus
        made["bus_full"] = getattr(bus, "full", 0)
        made["bitrate"] = getattr(bus, "bitrate", None)
        made["odd_lines"] = getattr(bus, "odd", 0)
        made["events"] = self.drive.record.events
        return made

    def objects(self, _):
        """which objects SDOs wrote and read, in their order"""
        return {"written": listed(self.drive.sdo_writes), "read": listed(self.drive.sdo_reads)}

    # Faults.

    def emcy(self, words):
        """CODE [REGISTER]: an EMCY; nothing else happens"""
        self.drive.register = int(words[1], 0) if len(words) > 1 else self.drive.register
        self.drive.emcy(int(words[0], 0))

    def fault(self, words):
        """CODE [stays]: a fault; "stays": its cause is still there when it is reset"""
        self.drive.machine.fault_stays = words[1:] == ["stays"]
        self.drive.machine.fault(int(words[0], 0), "told to")

    def calm(self, _):
        """the cause of a fault that stays is gone"""
        self.drive.machine.fault_stays = False

    def heartbeat(self, words):
        """off|on: its own"""
        self.drive.heartbeat_on = on(words)

    def watch(self, words):
        """off|on: off, a lost master is ignored"""
        self.drive.ignores_master = not on(words)

    def tpdo(self, words):
        """off|on"""
        self.drive.tpdo_on = on(words)

    def silent(self, words):
        """[off]: sends nothing at all"""
        self.drive.network.silent = on(words)

    def hang(self, words):
        """MS: neither reads nor sends"""
        self.loop.hang(float(words[0]) / 1000)

    def unplug(self, _):
        """the serial adapter is pulled out"""
        self.loop.unplug()

    def nmt(self, words):
        """4|5|127: another master put it to stopped, operational or pre-operational"""
        self.drive.go_nmt(int(words[0]))

    def reboot(self, _):
        """mains gone and back"""
        self.drive.reboot()

    def disable(self, _):
        """the power stage goes off by itself, without a fault (safe torque off)"""
        self.drive.machine._go("switch-on disabled", "power stage off")

    def block(self, words):
        """[off]: the shaft is held"""
        self.drive.machine.blocked = on(words)

    def inputs(self, words):
        """BITS|off: 60FD"""
        self.drive.machine.forced_inputs = int(words[0], 0) if on(words) else None

    def abort(self, words):
        """INDEX [SUB|all [CODE]], or off: SDOs to it are aborted"""
        if words == ["off"]:
            self.drive.aborted.clear()
        else:
            code = int(words[2], 0) if len(words) > 2 else 0x06010000
            self.drive.aborted[where(words)] = code

    def mute(self, words):
        """INDEX [SUB|all], or off: SDOs to it are not answered"""
        if words == ["off"]:
            self.drive.muted.clear()
        else:
            self.drive.muted.add(where(words))

    def ignore(self, words):
        """INDEX SUB, or off: writes to it are confirmed and not kept"""
        if words == ["off"]:
            self.drive.forgotten.clear()
        else:
            self.drive.forgotten.add(where(words))

    def send(self, words):
        """ID HEX: any frame"""
        self.drive.network.send_message(int(words[0], 0), bytes.fromhex("".join(words[1:])))

    def raw(self, words):
        """HEX: bytes on the serial line, as they are"""
        self.drive.network.bus.put(bytes.fromhex("".join(words)))

    def restart(self, _):
        """counters from 0"""
        self.drive.record.restart()


COMMANDS = [name for name in vars(Control)
            if not name.startswith("_") and name not in ("fileno", "take", "answer", "obey")]
