# SPDX-License-Identifier: GPL-2.0-or-later
"""
A CiA 402 drive for tests: independent of incise's own CANopen, on python-canopen.

    host ── slcan on a pty, or can0 ── adapter.py ── drive.py ── machine.py
                                    objects.py ─╯   ╰─ record.py, control.py

SDO, NMT, EMCY and the packing of PDOs are python-canopen's; what its LocalNode leaves out is
here: heartbeats are consumed, PDOs follow SYNC, mapping has the standard's rules, object 6007
says what happens when the master is gone. One thread; one loop. See README.md.
"""

import argparse
import os
import select
import struct
import sys
import time

import adapter  # silences a warning of python-can, so it comes first
import can
from canopen import LocalNode, Network, SdoAbortedError

from control import Control
from machine import CSP, CST, CSV, HOMING, NO_POWER, Machine
from objects import MAPPED_MOST, PDOS, dictionary
from record import Record

PRE_OPERATIONAL, OPERATIONAL, STOPPED = 127, 5, 4
NOT_VALID = 1 << 31
TICK_S = 0.001

ABORT_RANGE = 0x06090030
ABORT_STATE = 0x08000022  # because of the present device state
ABORT_NOT_MAPPABLE = 0x06040041
ABORT_PDO_LENGTH = 0x06040042


class Wire(Network):
    """python-canopen's network without its threads; can be made silent."""

    silent = False

    def send_message(self, can_id, data, remote=False):
        if not self.silent:
            try:
                super().send_message(can_id, data, remote)
            except can.CanError as error:
                print(f"drive: {error}", file=sys.stderr)


class Node(LocalNode):
    """LocalNode that asks the drive for what it measures, and before and after writes."""

    def __init__(self, number, objects, drive):
        super().__init__(number, objects)
        self.drive = drive
        self.cache = {}
        self._write_callbacks.clear()  # heartbeats are the drive's own
        self.nmt.start_heartbeat = self.nmt.stop_heartbeat = lambda *_: None

    def get_data(self, index, subindex, check_readable=False):
        live = self.drive.live.get(index)
        if live:
            od = self._find_object(index, subindex)
            return od.encode_raw(live())
        return super().get_data(index, subindex, check_readable)

    def set_data(self, index, subindex, data, check_writable=False):
        od = self._find_object(index, subindex)
        if check_writable and not od.writable:
            raise SdoAbortedError(0x06010002)
        if od.data_type != 9 and len(data) * 8 != len(od):
            raise SdoAbortedError(0x06070010)
        value = od.decode_raw(bytes(data))
        self.drive.check_write(index, subindex, value)
        if (index, subindex) in self.drive.forgotten:
            return
        super().set_data(index, subindex, data, check_writable)
        self.cache[index, subindex] = value
        self.drive.written(index, subindex, value)

    def _find_object(self, index, subindex):
        """LocalNode takes any sub-index of a variable for it."""
        od = super()._find_object(index, subindex)
        if od.subindex != subindex:
            raise SdoAbortedError(0x06090011)
        return od

    def value(self, index, sub):
        """An object as a number; 0 where it has none."""
        key = (index, sub)
        if key not in self.cache:
            try:
                od = self._find_object(index, sub)
            except SdoAbortedError:
                return 0
            self.cache[key] = od.decode_raw(bytes(super().get_data(index, sub)))
        return self.cache[key]

    def forget(self, least, most):
        """Values from power-on, of a range of objects."""
        for index in [i for i in self.data_store if least <= i <= most]:
            del self.data_store[index]
        self.cache.clear()


class Pdo:
    """One PDO: python-canopen's map, and what it last sent or received."""

    def __init__(self, pdo_map, com, mapping, receives):
        self.map, self.com, self.mapping, self.receives = pdo_map, com, mapping, receives
        self.fresh = False
        self.sent = None
        self.sent_at = self.received_at = 0.0
        self.countdown = 0
        self.deadline = None


class Drive:
    def __init__(self, bus, args):
        self.now = time.monotonic()
        self.record = Record(self.now)
        self.network = Wire(bus)
        self.live = {}
        self.forgotten = set()  # objects whose writes are not kept
        self.aborted = {}  # (index, sub or None): code
        self.muted = set()  # objects whose SDOs are not answered
        self.sdo_reads, self.sdo_writes = {}, {}  # in the order they first came
        self.tpdo_on = self.heartbeat_on = True
        self.ignores_master = False
        self.booted = False
        self.register = 0
        self.node = Node(args.node, dictionary(args.node, args.set, args.without), self)
        self.machine = Machine(self.node.value, self.event, args.span, args.shaft)
        self.machine.homed = args.homed
        self.network.add_node(self.node)
        self.network.unsubscribe(0x600 + args.node)
        self.network.unsubscribe(0)
        self.network.subscribe(0x600 + args.node, self.on_sdo)
        self.network.subscribe(0, self.on_nmt)
        self.network.subscribe(0x80, self.on_sync)
        self.pdos = [self._pdo(*pdo[:2]) for pdo in PDOS]
        machine = self.machine
        self.live = {
            0x1001: lambda: self.register, 0x603F: lambda: machine.error,
            0x6041: lambda: machine.statusword, 0x6061: lambda: machine.mode,
            0x6064: lambda: machine.position, 0x60FD: lambda: machine.inputs,
            0x606C: lambda: round(machine.velocity / machine.velocity_unit),
            0x6077: lambda: machine.torque,
            0x60F4: lambda: round((machine.demand or machine.position) - machine.position),
        }
        self.boot()

    def _pdo(self, com, mapping):
        receives = com < 0x1800
        maps = self.node.rpdo if receives else self.node.tpdo
        pdo = Pdo(maps[com - (0x1400 if receives else 0x1800) + 1], com, mapping, receives)
        if receives:
            pdo.map.add_callback(lambda _: self.on_rpdo(pdo))
        return pdo

    def event(self, what):
        self.record.event(self.now, what)
        if "-> operation enabled" in what:
            self.record.enabled(self.now)

    # Power, NMT, heartbeats.

    def boot(self):
        """From power-on, or a reset, to pre-operational."""
        self.watch_node, self.watch_s, self.heartbeat_at, self.lost = 0, 0.0, None, False
        self.beat_at = None
        self.nmt = PRE_OPERATIONAL
        for pdo in self.pdos:
            self.load_pdo(pdo)
        self.event("boot-up")
        self.network.send_message(0x700 + self.node.id, [0])
        self.booted = True

    def reboot(self):
        """Its mains went away and came back."""
        self.node.forget(0x1000, 0xFFFF)
        self.register = 0
        self.machine.power_on()
        self.event("power lost")
        self.boot()

    def on_nmt(self, _, data, __):
        if len(data) < 2 or data[1] not in (0, self.node.id):
            return
        command = data[0]
        if command in (1, 128):
            self.go_nmt(OPERATIONAL if command == 1 else PRE_OPERATIONAL)
        elif command == 2:
            self.go_nmt(STOPPED)
            self.machine.abort_connection("NMT stop")
        elif command in (129, 130):
            self.machine.abort_connection("NMT reset")
            self.node.forget(0x1000, 0xFFFF if command == 129 else 0x1FFF)
            if command == 129:
                self.machine.power_on()
            self.boot()

    def go_nmt(self, state):
        if state == self.nmt:
            return
        self.nmt = state
        self.event({OPERATIONAL: "operational", STOPPED: "stopped"}.get(state, "pre-operational"))
        for pdo in self.pdos:
            pdo.fresh, pdo.sent, pdo.deadline = False, None, None

    def beat(self):
        """Its own heartbeat, when it is due."""
        period = self.node.value(0x1017, 0) / 1000
        if not period:
            self.beat_at = None
        elif self.beat_at is None:
            self.beat_at = self.now + period
        elif self.now >= self.beat_at:
            self.beat_at = max(self.beat_at + period, self.now)
            if self.heartbeat_on:
                self.network.send_message(0x700 + self.node.id, [self.nmt])

    def on_heartbeat(self, _, __, ___):
        self.record.heartbeats += 1
        self.heartbeat_at = self.now
        if self.lost:
            self.lost = False
            self.event("heartbeat of the master is back")

    def watch(self):
        """The master's heartbeat; and set-points, where 1400:5 asks for that."""
        if self.ignores_master:
            return
        if self.heartbeat_at is not None and not self.lost and self.watch_s:
            if self.now - self.heartbeat_at > self.watch_s:
                self.lost = True
                self.connection_lost(0x8130, "heartbeat lost", self.heartbeat_at)
        for pdo in self.pdos:
            if pdo.deadline is not None and self.now > pdo.deadline:
                pdo.deadline = None
                self.connection_lost(0x8250, "RPDO time-out", pdo.received_at)

    def connection_lost(self, code, why, since):
        silence = (self.now - since) * 1000
        self.record.silence_ms = round(silence, 1)
        self.event(f"{why} after {silence:.1f} ms")
        self.register |= 0x11
        self.emcy(code)
        self.machine.abort_connection(why)
        if self.node.value(0x1029, 1) == 0 and self.nmt == OPERATIONAL:
            self.go_nmt(PRE_OPERATIONAL)

    def emcy(self, code, vendor=b""):
        self.record.emcys += 1
        if not self.node.value(0x1014, 0) & NOT_VALID:
            self.node.emcy.send(code, self.register, vendor)

    # SDO.

    def on_sdo(self, can_id, data, timestamp):
        if self.nmt == STOPPED or len(data) != 8:
            return
        self.record.sdo(self.now)
        kind = data[0] & 0xE0
        if kind in (0x20, 0x40):
            index, sub = struct.unpack_from("<HB", data, 1)
            (self.sdo_writes if kind == 0x20 else self.sdo_reads)[index, sub] = True
            if self._any(self.muted, index, sub):
                return
            code = self.aborted.get((index, sub), self.aborted.get((index, None)))
            if code is not None:
                self.network.send_message(0x580 + self.node.id,
                                          struct.pack("<BHBL", 0x80, index, sub, code))
                return
        self.node.sdo.on_request(can_id, data, timestamp)

    @staticmethod
    def _any(objects, index, sub):
        return (index, sub) in objects or (index, None) in objects

    def check_write(self, index, sub, value):
        """Abort what the standard forbids."""
        ok = True
        if index == 0x6060:
            ok = value == 0 or 1 <= value <= 32 and self.node.value(0x6502, 0) >> value - 1 & 1
        elif index == 0x605A:
            ok = value in (0, 1, 2, 3, 5, 6)
        elif index == 0x6007:
            ok = value in (0, 1, 2, 3)
        elif (index, sub) == (0x60C2, 2):
            ok = -6 <= value <= 0
        elif (index, sub) == (0x60C2, 1):
            ok = value > 0
        if not ok:
            raise SdoAbortedError(ABORT_RANGE)
        for pdo in self.pdos:
            if index == pdo.com and sub:
                self.check_communication(pdo, sub, value)
            elif index == pdo.mapping:
                self.check_mapping(pdo, sub, value)

    def check_communication(self, pdo, sub, value):
        valid = not self.node.value(pdo.com, 1) & NOT_VALID
        if self.nmt == OPERATIONAL:
            raise SdoAbortedError(ABORT_STATE)
        if sub == 1 and valid and not value & NOT_VALID:
            if (value ^ self.node.value(pdo.com, 1)) & 0x1FFFFFFF:
                raise SdoAbortedError(ABORT_STATE)  # the id may change only while not valid
        elif sub == 2 and 241 <= value <= (253 if pdo.receives else 251):
            raise SdoAbortedError(ABORT_RANGE)
        elif sub == 3 and valid:
            raise SdoAbortedError(ABORT_STATE)

    def check_mapping(self, pdo, sub, value):
        if self.nmt == OPERATIONAL or not self.node.value(pdo.com, 1) & NOT_VALID:
            raise SdoAbortedError(ABORT_STATE)
        if sub == 0:
            if value > MAPPED_MOST:
                raise SdoAbortedError(ABORT_RANGE)
            entries = [self.node.value(pdo.mapping, i + 1) for i in range(value)]
            if sum(entry & 0xFF for entry in entries) > 64:
                raise SdoAbortedError(ABORT_PDO_LENGTH)
            if 0 in entries:
                raise SdoAbortedError(ABORT_NOT_MAPPABLE)
            return
        if self.node.value(pdo.mapping, 0):
            raise SdoAbortedError(ABORT_STATE)
        if value:
            self.check_entry(pdo, value)

    def check_entry(self, pdo, value):
        index, sub, bits = value >> 16, value >> 8 & 0xFF, value & 0xFF
        od = self.node._find_object(index, sub)
        if not od.pdo_mappable or len(od) != bits:
            raise SdoAbortedError(ABORT_NOT_MAPPABLE)
        if pdo.receives and not od.writable:
            raise SdoAbortedError(ABORT_NOT_MAPPABLE)

    def written(self, index, sub, value):
        """An object has changed, by SDO or by RPDO."""
        if index == 0x6040:
            self.machine.control(value)
        elif index == 0x6060:
            self.machine.mode = value
            self.machine.demand = None
        elif (index, sub) == (0x1016, 1):
            self.watch_heartbeat(value)
        elif index == 0x1017:
            self.beat_at = None
        for pdo in self.pdos:
            if index == pdo.com and sub in (1, 2):
                self.load_pdo(pdo)

    def watch_heartbeat(self, value):
        """1016:1 was written: monitoring starts with the first heartbeat that comes."""
        if self.watch_node:
            self.network.unsubscribe(0x700 + self.watch_node, self.on_heartbeat)
        node, ms = value >> 16 & 0x7F, value & 0xFFFF
        self.watch_node, self.watch_s = (node, ms / 1000) if node and ms else (0, 0.0)
        self.heartbeat_at, self.lost = None, False
        if self.watch_node:
            self.network.subscribe(0x700 + node, self.on_heartbeat)

    # PDO.

    def load_pdo(self, pdo):
        subscribed = self.network.subscribers.get(pdo.map.cob_id, [])
        if pdo.map.on_message in subscribed:
            self.network.unsubscribe(pdo.map.cob_id, pdo.map.on_message)
        pdo.map.read()
        if not pdo.receives and pdo.map.enabled:
            self.network.unsubscribe(pdo.map.cob_id, pdo.map.on_message)
        pdo.fresh, pdo.sent, pdo.countdown, pdo.deadline = False, None, 0, None
        pdo.bytes = (pdo.map.length + 7) // 8

    def on_rpdo(self, pdo):
        if self.nmt != OPERATIONAL:
            return
        if len(pdo.map.data) < pdo.bytes:
            self.register |= 0x10
            self.emcy(0x8210)  # not processed: too short
            return
        pdo.received_at = self.now
        self.record.set_point(self.machine.state == "operation enabled")
        timer = self.node.value(pdo.com, 5)
        pdo.deadline = self.now + timer / 1000 if timer else None
        pdo.fresh = True
        if pdo.map.trans_type > 240:
            self.apply(pdo)

    def apply(self, pdo):
        pdo.fresh = False
        for variable in pdo.map.map:
            self.node.set_data(variable.index, variable.subindex, bytes(variable.get_data()))

    def on_sync(self, _, __, ___):
        if self.nmt != OPERATIONAL:
            return
        for pdo in self.pdos:
            if pdo.receives and pdo.fresh:
                self.apply(pdo)
        machine = self.machine
        enabled = machine.state == "operation enabled"
        target = self.node.value(0x607A, 0) if machine.mode == CSP else None
        self.record.sync(self.now, enabled, target)
        machine.synced(self.period())
        self.send_at_sync()

    def send_at_sync(self):
        for pdo in self.pdos:
            if pdo.receives or not pdo.map.enabled or not 1 <= pdo.map.trans_type <= 240:
                continue
            pdo.countdown += 1
            if pdo.countdown >= pdo.map.trans_type and self.tpdo_on:
                pdo.countdown = 0
                self.sample(pdo)
                self.send(pdo)

    def period(self):
        """Between two SYNCs, s: 60C2."""
        return self.node.value(0x60C2, 1) * 10.0 ** self.node.value(0x60C2, 2)

    def sample(self, pdo):
        for variable in pdo.map.map:
            variable.set_data(self.node.get_data(variable.index, variable.subindex))

    def send(self, pdo):
        self.record.tpdos += 1
        pdo.sent, pdo.sent_at = bytes(pdo.map.data), self.now
        pdo.map.transmit()

    def send_events(self):
        """PDOs of types 254 and 255: when what they hold has changed."""
        if self.nmt != OPERATIONAL:
            return
        for pdo in self.pdos:
            if pdo.receives or not pdo.map.enabled or pdo.map.trans_type < 254:
                continue
            self.sample(pdo)
            timer = self.node.value(pdo.com, 5) / 1000
            inhibit = self.node.value(pdo.com, 3) / 10000
            due = pdo.map.data != pdo.sent or timer and self.now >= pdo.sent_at + timer
            if due and self.tpdo_on and (pdo.sent is None or self.now >= pdo.sent_at + inhibit):
                self.send(pdo)

    # Time.

    def moves(self):
        machine = self.machine
        return machine.state in ("quick stop", "fault reaction") or (
            machine.state == "operation enabled" and machine.mode in (HOMING, CSV, CST))

    def pause(self):
        """How long nothing is due, s."""
        if self.moves():
            return TICK_S
        due = [self.now + 0.05]
        if self.beat_at is not None:
            due.append(self.beat_at)
        if self.heartbeat_at is not None and self.watch_s and not self.lost:
            due.append(self.heartbeat_at + self.watch_s + 0.0001)
        due += [pdo.deadline for pdo in self.pdos if pdo.deadline is not None]
        return max(0.0, min(due) - self.now)

    def turn(self, dt):
        """Once round the loop, after what came was taken."""
        state = self.machine.state
        self.machine.advance(dt)
        self.watch()
        self.beat()
        self.tell_fault(state)
        self.send_events()

    def tell_fault(self, before):
        error = self.machine.error
        if error and not self.register & 1:
            self.register |= 1
            if error != 0x8130:
                self.emcy(error)
        elif not error and self.register and self.machine.state not in ("fault reaction", "fault"):
            if not self.lost and self.register & 1:
                self.register = 0
                self.emcy(0)


class Loop:
    def __init__(self, drive, bus, control):
        self.drive, self.bus, self.control = drive, bus, control
        self.unplugged = False

    def take(self):
        """All frames that are there; the drive's clock goes on with each."""
        drive = self.drive
        while True:
            try:
                message = self.bus.recv(0)
            except can.CanError as error:  # such as an interface that goes down
                drive.event(f"bus: {error}")
                return
            except ValueError as error:  # a line that was cut off
                drive.event(f"no frame: {error}")
                continue
            if message is None:
                return
            if message.is_extended_id or message.is_remote_frame or message.is_error_frame:
                continue
            drive.now = time.monotonic()
            drive.network.notify(message.arbitration_id, message.data, message.timestamp)

    def run(self):
        drive, last = self.drive, time.monotonic()
        while not self.control.done:
            files = [self.control] if self.unplugged else [self.control, self.bus]
            ready = select.select(files, [], [], drive.pause())[0]
            drive.now = time.monotonic()
            if self.control in ready:
                self.control.take()
            if self.bus in ready and not self.unplugged:
                self.take()
            drive.now = time.monotonic()
            drive.turn(drive.now - last)
            last = drive.now

    def hang(self, seconds):
        """Nothing is read and nothing is sent; what comes waits."""
        time.sleep(seconds)

    def unplug(self):
        """The serial adapter is pulled out."""
        self.unplugged = True
        self.drive.network.silent = True
        self.bus.shutdown()


def number(text):
    return int(text, 0)


def place(text):
    """0x607D:1 is (0x607D, 1); 0x607D is (0x607D, None)."""
    index, _, sub = text.partition(":")
    return int(index, 0), int(sub, 0) if sub else None


def assignment(text):
    where, _, value = text.partition("=")
    index, sub = place(where)
    return (index, sub or 0), int(value, 0)


def span(text):
    low, _, high = text.partition(":")
    return int(low), int(high)


def arguments():
    parser = argparse.ArgumentParser(prog="drive", description="a CiA 402 drive for tests")
    parser.add_argument("--can", metavar="NAME", help="on this CAN interface; else slcan on a pty")
    parser.add_argument("--quiet", action="store_true", help="the adapter answers no command")
    parser.add_argument("--node", type=number, default=0x10)
    parser.add_argument("--set", type=assignment, action="append", default=[],
                        metavar="INDEX:SUB=VALUE", help="a value at power-on")
    parser.add_argument("--without", type=place, action="append", default=[],
                        metavar="INDEX[:SUB]", help="an object that it lacks")
    parser.add_argument("--span", type=span, default=(-20000, 600000), metavar="LOW:HIGH",
                        help="limit switches, counts")
    parser.add_argument("--shaft", type=int, default=0, help="where it stands at first, counts")
    parser.add_argument("--homed", action="store_true", help="its position is the machine's")
    parser.add_argument("--range", type=span, default=(-12800, 396800), metavar="LOW:HIGH",
                        help="its 607D where it is homed: as incise leaves it, with 30 mm of "
                             "travel, 12800 counts per mm and 1 mm to follow")
    args = parser.parse_args()
    if args.homed:
        args.set = [((0x607D, 1), args.range[0]), ((0x607D, 2), args.range[1])] + args.set
    return args


def main():
    args = arguments()
    if args.can:
        bus = can.Bus(interface="socketcan", channel=args.can, ignore_config=True)
        where = f"can:{args.can}:{args.node:#x}"
    else:
        bus = adapter.Adapter(args.quiet)
        where = f"slcan:{bus.path}:{args.node:#x}"
    drive = Drive(bus, args)
    control = Control(drive)
    control.loop = loop = Loop(drive, bus, control)
    print("ready", where, flush=True)
    try:
        loop.run()
    except KeyboardInterrupt:
        pass
    control.answer(control.report([]))
    if not loop.unplugged:
        bus.shutdown()


if __name__ == "__main__":
    main()
