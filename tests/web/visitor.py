# SPDX-License-Identifier: GPL-2.0-or-later
"""A visitor of incise serve --http with Python's standard library alone, and one that misbehaves.

    visitor.py FILE WHAT [ARGUMENT…]      FILE: as of --url
"""
import base64
import json
import os
import random
import socket
import struct
import sys

PATIENCE_S = 400


class Refused(Exception):
    """The server did not answer with a WebSocket, or closed it."""


class Visitor:
    def __init__(self, url, host=None, origin=None, path="/ws", more="", small=False):
        self.where, _, tokens = url.strip().removeprefix("http://").partition("/#")
        self.tokens = tokens.split(".")
        address, _, port = self.where.rpartition(":")
        self.socket = socket.socket()
        if small:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        self.socket.settimeout(PATIENCE_S)
        self.socket.connect((address, int(port)))
        host = self.where if host is None else host
        origin = f"http://{host}" if origin is None else origin
        key = base64.b64encode(bytes(16)).decode()
        self.raw((f"GET {path} HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                  f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
                  + (f"Origin: {origin}\r\n" if origin else "") + more + "\r\n").encode())
        self.status = self.head_of_reply()
        if " 101 " not in self.status + " ":
            raise Refused(self.status)

    def raw(self, data):
        self.socket.sendall(data)

    def head_of_reply(self):
        reply = b""
        while b"\r\n\r\n" not in reply:
            more = self.socket.recv(1)
            if not more:
                raise Refused("closed")
            reply += more
        return reply.split(b"\r\n")[0].decode()

    def send(self, what, first=0x81):
        data = what if isinstance(what, bytes) else json.dumps(what).encode()
        size = (bytes([0x80 | len(data)]) if len(data) < 126 else
                bytes([0x80 | 126]) + struct.pack(">H", len(data)) if len(data) < 65536 else
                bytes([0x80 | 127]) + struct.pack(">Q", len(data)))
        self.raw(bytes([first]) + size + bytes(4) + data)  # a mask of zeros is one

    def take(self, n):
        data = b""
        while len(data) < n:
            try:
                more = self.socket.recv(n - len(data))
            except ConnectionError:
                more = b""
            if not more:
                raise Refused("closed")
            data += more
        return data

    def receive(self):
        """The next message: an object of JSON, or bytes."""
        data, kind = b"", 0
        while True:
            first, size = self.take(2)
            size &= 127
            size = (struct.unpack(">H", self.take(2))[0] if size == 126 else
                    struct.unpack(">Q", self.take(8))[0] if size == 127 else size)
            part = self.take(size)
            if first & 15 == 8:
                raise Refused(part[2:].decode() or "closed")
            if first & 15 > 8:
                continue  # a ping, or its answer
            data, kind = data + part, kind or first & 15
            if first & 128:
                return data if kind == 2 else json.loads(data)

    def enter(self, control=False):
        self.send({"token": self.tokens[0], **({"control": self.tokens[1]} if control else {})})
        return self.until(lambda m: "head" in m)["head"]

    def until(self, wanted):
        while True:
            message = self.receive()
            if isinstance(message, dict) and wanted(message):
                return message

    def ask(self, **request):
        self.send({"id": 7, **request})
        return self.until(lambda m: m.get("id") == 7)


def refused(what, *arguments, **options):
    """That a visitor is refused, by this status or these words."""
    try:
        visitor = Visitor(*arguments, **options)
        visitor.enter()
    except (Refused, ConnectionError) as error:
        print(f"{what}: {error}")
        return
    raise SystemExit(f"{what}: was let in")


def get(url, path="/", method="GET", host=None, more=""):
    """The head and the body of an answer over HTTP."""
    where = url.strip().removeprefix("http://").split("/#")[0]
    address, _, port = where.rpartition(":")
    with socket.create_connection((address, int(port)), PATIENCE_S) as link:
        link.sendall(f"{method} {path} HTTP/1.1\r\nHost: {host or where}\r\n{more}Connection: close\r\n\r\n".encode())
        data = b""
        try:
            while more := link.recv(65536):
                data += more
        except ConnectionError:
            pass
    head, _, body = data.partition(b"\r\n\r\n")
    return head.decode("latin-1"), body


def refusals(url):
    head, body = get(url)
    assert " 200 " in head and b"<canvas" in body and "default-src 'none'" in head, head
    assert not any(token.encode() in body for token in url.strip().split("#")[1].split("."))
    for path in ("/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "//etc/passwd", "/ws/../x", "/liver.rec"):
        head, _ = get(url, path)
        assert " 200 " not in head, (path, head)
    for method in ("POST", "PUT", "DELETE", "OPTIONS", "BREW"):
        head, _ = get(url, method=method, more="Content-Length: 0\r\n")
        assert " 200 " not in head, (method, head)
    head, _ = get(url, host="rebound.example")
    assert " 403 " in head, head
    head, _ = get(url, more="X: " + "x" * 100000 + "\r\n")
    assert " 200 " not in head, head
    refused("another origin", url, origin="http://evil.example")
    refused("another scheme", url, origin="https://" + url.split("//")[1].split("/")[0])
    refused("no origin", url, origin="")
    refused("a rebound name", url, host="rebound.example")
    refused("a name that begins as ours", url, host="127.0.0.1.evil.example")
    wrong = url.strip().split("#")[0] + "#" + "0" * 32
    refused("a wrong token", wrong)
    for first in (b"", b"{}", b"[]", b"null", b'{"token":1}', b'{"token":""}', b"\xff" * 10, b"[" * 4000):
        visitor = Visitor(url)
        visitor.send(first)
        try:
            visitor.receive()
        except Refused:
            continue
        raise SystemExit(f"let in by {first[:20]}")
    visitor = Visitor(url)
    visitor.enter()
    visitor.send(b" " * 100000)
    try:
        visitor.until(lambda m: False)
    except Refused as error:
        print(f"a huge message: {error}")


def crowd(url):
    """More visitors than there are places: the rest is refused, and the first ones stay."""
    visitors = []
    for _ in range(40):
        try:
            visitor = Visitor(url)
            visitor.enter()
        except (Refused, ConnectionError):
            break
        visitors.append(visitor)
    else:
        raise SystemExit("40 visitors were let in")
    assert "error" in visitors[0].ask(nothing=1)
    print(len(visitors))


def look(url, to_s):
    visitor = Visitor(url)
    head = visitor.enter()
    while not (whole := visitor.ask(get={"from": head["from"], "to": head["to"], "columns": 500})["part"])["done"] == 1:
        pass
    assert len(whole["tracks"]) == len(head["tracks"])
    low, high = (whole["tracks"][0][k] for k in ("low", "high"))
    most = max(v for v in high if v is not None)
    # A part at a time has the extremes of the whole.
    parts = [visitor.ask(get={"from": to_s * i / 10, "to": to_s * (i + 1) / 10, "columns": 300})["part"]
             for i in range(10)]
    values = [v for p in parts for k in ("low", "high", "y") for v in p["tracks"][0].get(k, []) if v is not None]
    assert abs(max(values) - most) < 1e-6 and min(values) >= min(v for v in low if v is not None) - 1e-6
    for wrong in ({"from": 1, "to": 0, "columns": 10}, {"from": 0, "to": 1, "columns": 0}, {"columns": 10},
                  {"from": 0, "to": 1, "columns": 1e9}, {"from": "a", "to": [], "columns": {}}):
        assert "error" in visitor.ask(get=wrong), wrong
    print(json.dumps(head))


def damaged(url):
    """A head that says that the file could not be read to its end."""
    def says_so(head):
        return any(name == "read in part" and "damaged" in text for name, text in head["facts"])

    visitor = Visitor(url)
    if not says_so(visitor.enter()):
        visitor.until(lambda m: "head" in m and says_so(m["head"]))
    part = visitor.ask(get={"from": 0, "to": 4, "columns": 10})["part"]
    assert part["done"] == 1 and any(v is not None for v in part["tracks"][0]["low"])


def live(url, n):
    """The head, and the newest times of so many messages."""
    visitor = Visitor(url)
    head = visitor.enter()
    tracks = [0] * len(head["tracks"])
    last = [0.0] * len(tracks)
    for _ in range(n):
        message = visitor.until(lambda m: "live" in m)["live"]
        for i, track in enumerate(message["tracks"]):
            if track:
                assert len(track) == len(message["t"]) and message["t"][0] > last[i]
                last[i] = message["t"][-1]
                tracks[i] += len(track)
    print(json.dumps({"head": head, "tracks": tracks}))


def slow(url, frames):
    """One that takes nothing beside one that takes all: so many frames."""
    lazy, visitor = Visitor(url, small=True), Visitor(url)
    lazy.enter()
    visitor.enter()
    while frames:
        message = visitor.receive()
        if isinstance(message, bytes):
            number, width, height, channels, _ = struct.unpack("<IIIId", message[:24])
            assert number == 0 and len(message) == 24 + width * height * channels and width <= 480
            frames -= 1


def orders(url, name):
    """A capture with a mark; the same without the second token."""
    visitor = Visitor(url)
    visitor.enter()
    assert "error" in visitor.ask(do="capture", name=name)
    visitor = Visitor(url)
    assert visitor.enter(control=True).get("control")
    for wrong in ("../x", "", "a/b", "-x", "x" * 200, "a\nb"):
        assert "error" in visitor.ask(do="capture", name=wrong), wrong
    assert "error" in visitor.ask(do="stop")
    assert "error" in visitor.ask(do="force", text="1")
    print(visitor.ask(do="capture", name=name))
    assert "error" in visitor.ask(do="capture", name=name + "2")
    for _ in range(20):
        visitor.until(lambda m: "live" in m)
    print(visitor.ask(do="mark", text="here"))
    print(visitor.ask(do="stop"))
    # One that ends at once has been written, or says that it has not.
    assert "ok" in visitor.ask(do="capture", name=name + "2")
    assert ("ok" in visitor.ask(do="stop")) == os.path.exists(name + "2.rec")


def tool(url, name):
    visitor = Visitor(url)
    visitor.enter(control=True)
    assert "ok" in visitor.ask(do="tool", tool=name)
    visitor.until(lambda m: m.get("state", {}).get("tool") == name)


def fuzz(url, n, seed):
    """Changed requests, headers and frames; the server goes on."""
    rng = random.Random(seed)
    seeds = [b'{"id":1,"get":{"from":0.5,"to":2.5,"columns":1200}}', b'{"id":8,"frame":1.234}',
             b'{"id":9,"do":"mark","text":"a"}', b'{"id":9,"do":"capture","name":"../../x"}',
             b'{"token":"a","control":"b"}', b'{"id":1,"get":{"from":-1e308,"to":1e308,"columns":4000}}',
             b'{"id":1e300,"frame":1e300}', b'{"id":-9223372036854775808,"frame":-1e9}', b"\x00\xff" * 8]
    visitor, waiting = None, 0
    for i in range(n):
        data = bytearray(rng.choice(seeds))
        for _ in range(rng.choice((0, 1, 1, 2, 8))):
            at = rng.randrange(len(data) + 1)
            if rng.random() < 0.5 and at < len(data):
                data[at] = rng.randrange(256)
            else:
                data[at:at] = rng.choice((b"9" * 30, b"\"", b"{", b"[[", b"null", b"-", b"1e999", b"\xc3"))
        try:
            if visitor is None:
                visitor, waiting = Visitor(url), 0
                if rng.random() < 0.9:
                    visitor.enter(control=len(visitor.tokens) > 1)
            if rng.random() < 0.02:
                visitor.raw(bytes(rng.randrange(256) for _ in range(rng.randrange(1, 40))))
                visitor = None
            elif rng.random() < 0.02:
                link = socket.create_connection(visitor.socket.getpeername())
                link.sendall(bytes(rng.choice(b"GET /ws HTP1.:\r\nHostUpgrade\x00\xff") for _ in range(rng.randrange(400))))
                link.close()
            else:
                visitor.send(bytes(data[:4000]), rng.choice((0x81, 0x81, 0x81, 0x81, 0x82, 0x01, 0x80, 0x89)))
                waiting += 1
            if visitor and waiting == 4:
                waiting = 0
                visitor.ask(nothing=1)
        except (Refused, OSError, ValueError):
            visitor = None
    visitor = Visitor(url)
    visitor.enter()
    assert "error" in visitor.ask(nothing=1)


if __name__ == "__main__":
    with open(sys.argv[1], encoding="ascii") as file:
        address = file.read()
    globals()[sys.argv[2]](address, *(json.loads(a) if a[:1].isdigit() else a for a in sys.argv[3:]))
