#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""An Inverse Service without hardware, for tests: one Inverse3 with a VerseGrip.

Of Python's standard library alone, WebSocket included, and without code of incise: written from
RFC 6455 and from what Haply publishes of its service. Strict: it complains of each message that
the service would not expect.

    emulator.py [--format 3.0|3.1|3.5] [--port N] [--grip wired|wireless|none] [--more ID]…
                [--no-events] [--move]

prints "ready PORT". The events are at PORT + 19, as 10020 is to 10001. Commands on standard input,
a line each, print one line when they are done:

    say PATH JSON       set a value of the frames: inverse3.state.cursor_position.x 0.1
    drop PATH           take it out
    hold, release       no answers, and those that were held
    raw N TEXT          answer N messages by TEXT as it is
    id ID               the Inverse3 has another id: it was plugged in again; "" takes it away
    event JSON          send an event
    report              messages, last force, profile, complaints in JSON; complaints start anew
    close               close all connections
    deaf                close those of the events
"""
import argparse
import asyncio
import base64
import hashlib
import json
import math
import sys

MAGIC = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11"


async def shake_hands(reader, writer):
    """Answer the request to open a WebSocket."""
    lines = (await reader.readuntil(b"\r\n\r\n")).decode().split("\r\n")
    headers = dict(line.lower().split(": ", 1) if line.split(":")[0].lower() != "sec-websocket-key"
                   else ("key", line.split(": ", 1)[1]) for line in lines[1:] if ": " in line)
    accept = base64.b64encode(hashlib.sha1((headers["key"] + MAGIC).encode()).digest()).decode()
    writer.write(("HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n"
                  "Connection: Upgrade\r\nSec-WebSocket-Accept: %s\r\n\r\n" % accept).encode())


def write_frame(writer, opcode, data, final=True):
    head = bytes([opcode | 0x80 * final])
    if len(data) < 126:
        head += bytes([len(data)])
    else:
        head += bytes([126]) + len(data).to_bytes(2, "big") if len(data) < 65536 else \
            bytes([127]) + len(data).to_bytes(8, "big")
    writer.write(head + data)


def write_text(writer, text):
    """In two pieces where it is long, since a server may cut a message anywhere."""
    data = text.encode()
    half = len(data) // 2
    if half > 1000:
        write_frame(writer, 1, data[:half], False)
        write_frame(writer, 0, data[half:])
    else:
        write_frame(writer, 1, data)


async def read_message(reader, writer):
    """A text; None: it was closed."""
    text = b""
    while True:
        first, second = await reader.readexactly(2)
        n = second & 127
        if n > 125:
            n = int.from_bytes(await reader.readexactly(2 if n == 126 else 8), "big")
        assert second & 128, "a client has to mask"
        mask = await reader.readexactly(4)
        data = await reader.readexactly(n)
        data = bytes(byte ^ mask[i % 4] for i, byte in enumerate(data))
        if first & 15 == 8:
            write_frame(writer, 8, data)
            return None
        if first & 15 == 9:
            write_frame(writer, 10, data)
        elif first & 15 < 2:
            text += data
            if first & 128:
                return text.decode()


class Service:
    def __init__(self, options):
        self.form = options.format
        self.move = options.move
        self.more = options.more
        self.id = "049D"
        self.messages = 0
        self.force = None
        self.profile = None
        self.complaints = []
        self.answers = asyncio.Event()
        self.answers.set()
        self.raw = [0, ""]
        self.writers, self.listeners = [], []
        config = {"type": "inverse3", "port": "/dev/ttyACM0",
                  "device_info": {"major_version": 7, "minor_version": 4, "id": "049D", "device_type": 4,
                                  "uuid": "0-0"},
                  "extended_device_id": "0-0", "extended_firmware_version": "0",
                  "gravity_compensation": {"enabled": True, "scaling_factor": 1.0},
                  "handedness": "right", "streaming_mode": "USB", "torque_scaling": {"enabled": True}}
        if self.form == "3.5":
            config.update(preset="defaults", basis={"permutation": "XYZ"},
                          filters={"force_gate": {"gain": 0.3}, "damping": {"scalar": 0.0}})
        zero = {"x": 0.0, "y": 0.0, "z": 0.0}
        self.parts = {"inverse3": {
            "config": config,
            "state": {"cursor_position": {"x": 0.0, "y": -0.12, "z": 0.15}, "cursor_velocity": dict(zero),
                      "angular_position": {"a0": 0.0, "a1": 0.0, "a2": 0.0},
                      "body_orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0},
                      "current_cursor_force": dict(zero), "mode": "idle", "control_mode": "idle"},
            "status": {"calibrated": True, "in_use": False, "power_supply": True, "ready": True,
                       "started": True}}}
        turned = {"x": 0.1, "y": 0.2, "z": -0.3, "w": math.sqrt(1 - 0.14)}
        if options.grip == "wired":
            self.parts["verse_grip"] = {
                "config": {"type": "verse_grip", "port": "/dev/ttyACM1"},
                "state": {"orientation": turned, "button": False, "hall": 0},
                "status": {"ready": True, "error": 0}}
        elif options.grip == "wireless":
            self.parts["wireless_verse_grip"] = {
                "config": {"type": "wireless_verse_grip", "port": "/dev/ttyACM1", "major_version": 1,
                           "minor_version": 0, "hardware_version": 1},
                "state": {"orientation": turned, "buttons": {"a": False, "b": False, "c": False},
                          "hall": 0, "battery_level": 0.8},
                "status": {"ready": True, "connected": True, "awake": True}}

    def frame(self, full):
        if self.move:
            place = self.parts["inverse3"]["state"]["cursor_position"]
            place["x"] = 0.03 * math.sin(self.messages * 1e-3)
            place["z"] = 0.15 + 0.005 * math.sin(self.messages * 3e-3)
        frame = {} if self.form == "3.0" else {"session_id": 7}
        ids = {"inverse3": self.id, "verse_grip": "8200", "wireless_verse_grip": "A0F1"}
        for kind, part in self.parts.items():
            part = {key: part[key] for key in part if full or key != "config"}
            if self.form == "3.0":
                frame[kind] = {ids[kind]: part} if ids[kind] else {}
            else:
                frame[kind] = [{"device_id": ids[kind], **part}] if ids[kind] else []
                if kind == "inverse3":
                    frame[kind] += [{"device_id": id, **part} for id in self.more]
        return json.dumps(frame)

    def take(self, text, first):
        """A message, and whether it is the first of its session; whether the answer is to have the config."""
        message = json.loads(text, parse_constant=lambda name: self.complaints.append(name))
        session = message.get("session", {})
        if "configure" in session:
            self.profile = session["configure"]["profile"]["name"]
            if not first:
                self.complaints.append("configured late, or twice")
        devices = message.get("inverse3", {} if self.form == "3.0" else [])
        if self.form == "3.0":
            devices = [{"device_id": key, **value} for key, value in devices.items()]
        for device in devices:
            if device["device_id"] != self.id:
                self.complaints.append("unknown id " + device["device_id"])
            command = device["commands"]["set_cursor_force"]
            vector = command["vector" if self.form == "3.5" else "values"]
            self.force = [vector[key] for key in "xyz"]
        self.messages += 1
        return "force_render_full_state" in session

    async def simulate(self, reader, writer):
        try:
            await shake_hands(reader, writer)
            self.writers.append(writer)
            write_text(writer, self.frame(True))
            first = True
            while True:
                text = await read_message(reader, writer)
                if text is None:
                    break
                try:
                    full = self.take(text, first)
                except (AttributeError, KeyError, TypeError, ValueError) as error:
                    self.complaints.append("%r: %s" % (error, text))
                    full = False
                first = False
                answer = self.frame(full)
                await self.answers.wait()
                if self.raw[0]:
                    self.raw[0] -= 1
                    answer = self.raw[1]
                write_frame(writer, 9, b"") if self.messages == 3 else None
                write_text(writer, answer)
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        writer.close()

    async def listen(self, reader, writer):
        await shake_hands(reader, writer)
        self.listeners.append(writer)
        try:
            while await read_message(reader, writer):
                pass
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        self.listeners.remove(writer)
        writer.close()

    def command(self, line):
        word, _, rest = line.strip().partition(" ")
        if word in ("say", "drop"):
            path, _, value = rest.partition(" ")
            *folders, name = path.split(".")
            at = self.parts
            for folder in folders:
                at = at.setdefault(folder, {})
            if word == "say":
                at[name] = json.loads(value)
            else:
                at.pop(name, None)
        elif word == "hold":
            self.answers.clear()
        elif word == "release":
            self.answers.set()
        elif word == "raw":
            self.raw = [int(rest.partition(" ")[0]), rest.partition(" ")[2]]
        elif word == "id":
            self.id = rest
        elif word == "event":
            for writer in self.listeners:
                write_text(writer, rest)
            return "events %d" % len(self.listeners)
        elif word == "report":
            report = json.dumps({"messages": self.messages, "force": self.force, "profile": self.profile,
                                 "complaints": self.complaints})
            self.complaints = []
            return report
        elif word in ("close", "deaf"):
            for writer in self.writers if word == "close" else self.listeners:
                writer.close()
        return "done"


async def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--format", default="3.5", choices=["3.0", "3.1", "3.5"])
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--grip", default="wired", choices=["wired", "wireless", "none"])
    parser.add_argument("--more", action="append", default=[])
    parser.add_argument("--no-events", action="store_true")
    parser.add_argument("--move", action="store_true")
    options = parser.parse_args()
    service = Service(options)
    # Both ports have to be free.
    while True:
        server = await asyncio.start_server(service.simulate, "127.0.0.1", options.port)
        port = server.sockets[0].getsockname()[1]
        try:
            events = None if options.no_events else \
                await asyncio.start_server(service.listen, "127.0.0.1", port + 19)
            break
        except (OSError, OverflowError):
            if options.port:
                raise
            server.close()
    print("ready", port, flush=True)
    loop = asyncio.get_running_loop()
    while True:
        line = await loop.run_in_executor(None, sys.stdin.readline)
        if not line:
            break
        print(service.command(line), flush=True)
    server.close()


asyncio.run(main())
