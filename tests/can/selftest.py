# SPDX-License-Identifier: GPL-2.0-or-later
"""
The drive of the CAN tests, tested by python-canopen's own master (RemoteNode, BaseNode402)
and python-can's own slcan: nothing here is incise's. Prints "ok …" or "not ok …" lines.

    selftest.py [--can NAME]   5 s; over slcan, or a CAN interface
"""

import json
import logging
import subprocess
import sys
import time
from pathlib import Path

for name in ("can", "canopen"):
    logging.getLogger(name).setLevel(logging.ERROR)

import canopen
from canopen.profiles.p402 import BaseNode402
from canopen.sdo import SdoAbortedError

from objects import dictionary

NODE, MASTER = 0x10, 0x7E


class Peer:
    """drive.py in a process of its own."""

    def __init__(self, *options):
        program = [sys.executable, "-B", str(Path(__file__).with_name("drive.py")), *options]
        self.process = subprocess.Popen(program, stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)
        self.device = self.process.stdout.readline().split()[1].split(":")[1]

    def ask(self, command):
        self.process.stdin.write(command + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def close(self):
        self.process.stdin.close()
        self.process.wait(5)


class Master:
    def __init__(self, device, interface):
        self.network = canopen.Network()
        self.network.NOTIFIER_CYCLE = 0.05
        options = {}
        if interface == "slcan":
            options = {"bitrate": 1000000, "sleep_after_open": 0}
        self.network.connect(interface=interface, channel=device, ignore_config=True, **options)
        self.node = BaseNode402(NODE, dictionary(NODE))
        # A busy machine may hold an answer up; 0.3 s is for a bus.
        self.node.sdo.RESPONSE_TIMEOUT = 10
        self.network.add_node(self.node)
        self.beating = None

    def map_pdos(self):
        node = self.node
        node.nmt.state = "PRE-OPERATIONAL"
        rpdo, tpdo = node.rpdo[1], node.tpdo[1]
        node.rpdo.read()
        node.tpdo.read()
        for pdo, objects, kind in ((rpdo, (0x6040, 0x607A), 1), (tpdo, (0x6041, 0x6064), 1)):
            pdo.clear()
            for index in objects:
                pdo.add_variable(index, 0)
            pdo.trans_type, pdo.enabled = kind, True
            pdo.save()

    def write(self, index, sub, value):
        entry = self.node.sdo[index]
        (entry[sub] if hasattr(entry, "__getitem__") else entry).raw = value

    def beat(self, period_s):
        self.beating = self.network.send_periodic(0x700 + MASTER, [5], period_s)

    def enable(self):
        """To operation enabled by SDO, as BaseNode402 has it."""
        self.node.nmt.state = "OPERATIONAL"
        for word in (0x06, 0x07, 0x0F):
            self.write(0x6040, 0, word)

    def cycle(self, word, target, wait_s=10):
        """One cycle; returns statusword and position that answered."""
        rpdo, tpdo = self.node.rpdo[1], self.node.tpdo[1]
        rpdo[0].raw, rpdo[1].raw = word, target
        with tpdo.receive_condition:
            tpdo.is_received = False
            rpdo.transmit()
            self.network.send_message(0x80, b"")
            tpdo.receive_condition.wait_for(lambda: tpdo.is_received, wait_s)
        return tpdo[0].raw, tpdo[1].raw

    def close(self):
        if self.beating:
            self.beating.stop()
        self.network.disconnect()


def until(check, limit_s=3.0):
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        if check():
            return True
        time.sleep(0.01)
    return False


def code_of(action):
    """The abort code of what should be refused."""
    try:
        action()
    except SdoAbortedError as error:
        return error.code
    return 0


def identity(peer, master):
    sdo = master.node.sdo
    assert sdo[0x1008].raw == "incise-test-drive", "name in segments"
    assert sdo[0x1018][2].raw == 0x402
    assert sdo[0x1000].raw & 0xFFFF == 402
    assert code_of(lambda: sdo.upload(0x2000, 0)) == 0x06020000
    assert code_of(lambda: sdo.upload(0x1018, 9)) == 0x06090011
    assert code_of(lambda: sdo.download(0x6064, 0, bytes(4))) == 0x06010002, "read only"
    assert code_of(lambda: sdo.download(0x6040, 0, bytes(4))) == 0x06070010, "length"


def mapping(peer, master):
    sdo = master.node.sdo
    master.node.nmt.state = "PRE-OPERATIONAL"
    write = master.write
    assert code_of(lambda: write(0x1600, 0, 0)) == 0x08000022, "the PDO exists"
    assert code_of(lambda: write(0x1400, 1, 0x333)) == 0x08000022, "the id of one that exists"
    write(0x1400, 1, 0x80000210)
    assert code_of(lambda: write(0x1600, 1, 0x60400010)) == 0x08000022, "entries before 0"
    write(0x1600, 0, 0)
    assert code_of(lambda: write(0x1600, 1, 0x60640020)) == 0x06040041, "it cannot be received"
    assert code_of(lambda: write(0x1600, 1, 0x20000020)) == 0x06020000
    write(0x1600, 1, 0x607A0020)
    write(0x1600, 2, 0x60FF0020)
    write(0x1600, 3, 0x60400010)
    assert code_of(lambda: write(0x1600, 0, 3)) == 0x06040042, "ten bytes"
    master.map_pdos()
    assert sdo[0x1600][2].raw == 0x607A0020


def states(peer, master):
    """BaseNode402 walks it through its states and back, by SDO."""
    node = master.node
    master.map_pdos()
    node.nmt.state = "OPERATIONAL"
    for word, status in ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27), (0x07, 0x23), (0x06, 0x21),
                         (0x0F, 0x27), (0x00, 0x40)):
        master.write(0x6040, 0, word)
        seen = node.sdo[0x6041].raw & (0x6F if status != 0x40 else 0x4F)
        assert seen == status, f"{word:#x}: {seen:#x}"
    node.setup_402_state_machine(read_pdos=False)
    node.tpdo_pointers.clear()
    node.rpdo_pointers.clear()
    node.tpdo_values.clear()
    node.state = "OPERATION ENABLED"
    assert peer.ask("state")["state"] == "operation enabled"
    node.state = "SWITCH ON DISABLED"
    assert peer.ask("state")["state"] == "switch-on disabled"


def follows(peer, master):
    master.map_pdos()
    master.write(0x6060, 0, 8)
    master.enable()
    peer.ask("restart")
    targets = [i * i // 8 for i in range(200)]
    answers = [master.cycle(0x0F, target) for target in targets]
    positions = [position for _, position in answers]
    assert positions[2:] == targets[1:-1], "one cycle behind its target"
    assert all(status & 0x106F == 0x1027 for status, _ in answers)
    report = peer.ask("report")
    assert (report["syncs"], report["rpdos"], report["missing"], report["doubled"]) == (
        200, 200, 0, 0), report
    assert report["largest_step"] == targets[-1] - targets[-2]
    master.network.send_message(0x80, b"")
    until(lambda: peer.ask("report")["syncs"] == 201)
    assert peer.ask("report")["missing"] == 1, "a SYNC without a set-point is seen"
    master.node.rpdo[1].transmit()
    master.cycle(0x0F, targets[-1])
    assert peer.ask("report")["doubled"] == 1, "so are two"


def heartbeat(peer, master):
    follows(peer, master)
    assert peer.ask("state")["state"] == "operation enabled"
    master.write(0x6007, 0, 3)
    master.write(0x605A, 0, 2)
    # A machine that is busy may hold both of them up for a while.
    master.write(0x1016, 1, MASTER << 16 | 500)
    time.sleep(0.7)
    assert peer.ask("state")["state"] == "operation enabled", "nothing is heard, none is missed"
    master.beat(0.03)
    time.sleep(1)
    assert peer.ask("state")["state"] == "operation enabled", "heard"
    master.beating.stop()
    master.beating = None
    assert until(lambda: peer.ask("state")["state"] == "switch-on disabled"), peer.ask("state")
    assert peer.ask("report")["silence_ms"] >= 500
    assert until(lambda: any(emcy.code == 0x8130 for emcy in master.node.emcy.log))
    master.cycle(0x0F, 0, wait_s=0.1)
    assert peer.ask("state")["state"] == "switch-on disabled", "nothing enables it again"


def faults(peer, master):
    follows(peer, master)
    peer.ask("block")
    assert until(lambda: master.cycle(0x0F, 100000)[0] & 0x4F == 0x08), "following error"
    assert master.node.sdo[0x603F].raw == 0x8611
    peer.ask("block off")
    master.write(0x6040, 0, 0x0F)
    assert peer.ask("state")["state"] == "fault"
    for word in (0x00, 0x80):
        master.write(0x6040, 0, word)
    assert peer.ask("state")["state"] == "switch-on disabled"
    assert until(lambda: [e.code for e in master.node.emcy.log][-2:] == [0x8611, 0])
    peer.ask("fault 0x3210 stays")
    for word in (0x00, 0x80):
        master.write(0x6040, 0, word)
    assert peer.ask("state")["state"] == "fault", "its cause is still there"


def deadline(peer, master):
    """1400:5 watches over set-points; heartbeats alone do not hold it."""
    master.map_pdos()
    master.write(0x1400, 5, 50)
    master.write(0x6060, 0, 8)
    master.write(0x6007, 0, 3)
    master.enable()
    time.sleep(0.2)
    assert peer.ask("state")["state"] == "operation enabled", "it starts with the first"
    master.cycle(0x0F, 0)
    assert until(lambda: peer.ask("state")["state"] == "switch-on disabled")
    assert until(lambda: any(emcy.code == 0x8250 for emcy in master.node.emcy.log))


def speeds(peer, master):
    """CSV in rpm: a quick stop goes down its ramp, and the set-point is not the only word."""
    write = master.write
    write(0x6060, 0, 9)
    write(0x607F, 0, 600)  # rpm
    write(0x6085, 0, 51200)  # counts/s²: a second from 60 rpm
    master.enable()
    write(0x60FF, 0, 60)
    time.sleep(0.2)
    state = peer.ask("state")
    assert state["velocity"] == 51200 and state["position"] > 5000, state
    write(0x60FF, 0, 6000)
    time.sleep(0.05)
    assert peer.ask("state")["velocity"] == 512000, "607F holds"
    assert peer.ask("state")["statusword"] & 0x0800, "and it says so"
    write(0x60FF, 0, 60)
    time.sleep(0.05)
    write(0x6040, 0, 0x02)
    assert peer.ask("state")["state"] == "quick stop"
    assert until(lambda: peer.ask("state")["state"] == "switch-on disabled")
    slowed = [e["ms"] for e in peer.ask("report")["events"] if "quick stop" in e["what"]]
    assert slowed[1] - slowed[0] > 900, slowed


def torques(peer, master):
    write = master.write
    write(0x6060, 0, 10)
    write(0x6072, 0, 50)
    master.enable()
    write(0x6071, 0, 100)
    time.sleep(0.3)
    assert peer.ask("state")["velocity"] > 1000
    assert master.node.sdo[0x6077].raw == 50, "6072 holds"


def inputs(peer, master):
    """60FD in an event-driven TPDO2."""
    node = master.node
    node.nmt.state = "PRE-OPERATIONAL"
    node.tpdo.read()
    tpdo = node.tpdo[2]
    tpdo.clear()
    tpdo.add_variable(0x60FD, 0)
    tpdo.trans_type, tpdo.enabled = 255, True
    tpdo.save()
    seen = []
    tpdo.add_callback(lambda pdo: seen.append(pdo[0].raw))
    node.nmt.state = "OPERATIONAL"
    assert until(lambda: seen == [0]), "once at first"
    peer.ask("inputs 0x1")
    peer.ask("inputs 0x6")
    assert until(lambda: seen == [0, 1, 6]), seen


def homing(peer, master):
    master.map_pdos()
    master.write(0x6060, 0, 6)
    master.write(0x6098, 0, 17)
    master.write(0x6099, 1, 100000)
    master.enable()
    assert master.node.sdo[0x6041].raw & 0x3400 == 0x0400, "not started"
    master.write(0x6040, 0, 0x1F)
    assert until(lambda: master.node.sdo[0x6041].raw & 0x3400 == 0x1400), peer.ask("state")
    state = peer.ask("state")
    assert (state["shaft"], state["position"]) == (-19999, 0), state


def reboots(peer, master):
    follows(peer, master)
    boots = []
    master.node.nmt.add_heartbeat_callback(boots.append)
    peer.ask("reboot")
    assert until(lambda: 0 in boots), "boot-up message"
    assert peer.ask("state")["state"] == "switch-on disabled"
    assert master.node.sdo[0x1600][0].raw == 1, "its mapping is that of power-on"


TESTS = ((identity,), (mapping,), (states,), (follows,), (heartbeat,), (deadline,),
         (speeds, "--set", "0x60A9:0=0x00B44700"), (torques,), (inputs,), (faults,), (homing,),
         (reboots,))


def run(test, options, can_name):
    """None, or what is wrong."""
    peer = Peer(*options, *(["--can", can_name] if can_name else []))
    master = Master(peer.device, "socketcan" if can_name else "slcan")
    try:
        test(peer, master)
    except (AssertionError, SdoAbortedError, canopen.SdoCommunicationError) as error:
        line = error.__traceback__
        while line.tb_next and "selftest" in line.tb_next.tb_frame.f_code.co_filename:
            line = line.tb_next
        return f"line {line.tb_lineno}: {error!r}"
    finally:
        master.close()
        peer.close()
    return None


def main():
    words = sys.argv[1:]
    can_name = words[1] if words[:1] == ["--can"] else None
    failed = 0
    for test, *options in TESTS:
        wrong = run(test, options, can_name)
        print(f"not ok {test.__name__}: {wrong}" if wrong else f"ok {test.__name__}", flush=True)
        failed += wrong is not None
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
