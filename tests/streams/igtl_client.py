# SPDX-License-Identifier: GPL-2.0-or-later
"""A client of OpenIGTLink by the protocol's description alone, and clients that misbehave.

igtl_client.py receive PORT COUNT [VERSION] [REQUEST[:NAME]]...
    Send the requests, then receive COUNT messages and print each as a line of JSON. If the last request
    is GET_CAPABIL, COUNT messages behind its answer: what is in front may have left before.
igtl_client.py full PORT COUNT
    Connect COUNT clients, which stay, and one more. Prints its messages as lines of JSON, until it is closed.
igtl_client.py crowd PORT COUNT
    Receive COUNT poses in five clients, while others hang, die, and send nonsense. Prints a line of
    JSON: for each of the five the number of poses, and whether their times are in order.
"""
import json
import os
import random
import socket
import struct
import sys
import threading
import time

TABLE = []
for byte in range(256):
    crc = byte << 56
    for _ in range(8):
        crc = (crc << 1 & 2**64 - 1) ^ (0x42F0E1EBA9EA3693 if crc >> 63 else 0)
    TABLE.append(crc)


def crc64(data):
    crc = 0
    for value in data:
        crc = (crc << 8 & 2**64 - 1) ^ TABLE[crc >> 56 ^ value]
    return crc


def pack(kind, name="", content=b"", version=1):
    if version == 2:
        content = struct.pack(">HHII", 12, 2, 0, 7) + content + b"\0\0"
    return struct.pack(">H12s20sQQQ", version, kind.encode(), name.encode(), 0, len(content),
                       crc64(content)) + content


def connect(port):
    return socket.create_connection(("127.0.0.1", port), timeout=300)


def exactly(sock, n):
    data = bytearray()
    while len(data) < n:
        part = sock.recv(min(n - len(data), 1 << 20))
        if not part:
            raise EOFError
        data += part
    return bytes(data)


def receive(sock, check=True):
    """A message as a dict; the CRC of images is left to the compiled client."""
    version, kind, name, seconds, fraction, size, crc = struct.unpack(
        ">H12s20sIIQQ", exactly(sock, 58))
    body = exactly(sock, size)
    message = {"version": version, "type": kind.rstrip(b"\0").decode(),
               "name": name.rstrip(b"\0").decode(), "utc_s": seconds + fraction / 2**32}
    if message["type"] != "IMAGE" and check and crc64(body) != crc:
        sys.exit(f"wrong CRC of {message}")
    if version == 2:
        extended, table, pairs, message["id"] = struct.unpack(">HHII", body[:12])
        rest = body[len(body) - table - pairs:]
        body = body[extended:len(body) - table - pairs]
        at = 2 + 8 * struct.unpack(">H", rest[:2])[0]
        message["metadata"] = {}
        for i in range(2, at, 8):
            key, _, value = struct.unpack(">HHI", rest[i:i + 8])
            message["metadata"][rest[at:at + key].decode()] = rest[at + key:at + key + value].decode()
            at += key + value
    if message["type"] == "TRANSFORM":
        message["matrix"] = struct.unpack(">12f", body)
    elif message["type"] == "STRING":
        message["text"] = json.loads(body[4:])
    elif message["type"] == "STATUS":
        code, sub_code, error = struct.unpack(">Hq20s", body[:30])
        message.update(code=code, sub_code=sub_code, error=error.rstrip(b"\0").decode(),
                       text=body[30:].rstrip(b"\0").decode())
    elif message["type"] == "IMAGE":
        message["size"] = struct.unpack(">HBBBBHHH", body[:12])
        message["bytes"] = len(body) - 72
    return message


def receive_all(port, count, version="1", *requests):
    sock = connect(int(port))
    for request in requests:
        kind, _, name = request.partition(":")
        sock.sendall(pack(kind, name, version=int(version)))
    left, answered = int(count), requests[-1:] != ("GET_CAPABIL",)
    while left:
        message = receive(sock)
        print(json.dumps(message), flush=True)
        left -= answered
        answered = answered or message["type"] == "CAPABILITY"


def full(port, count):
    socks = [connect(int(port)) for _ in range(int(count))]
    for sock in socks:
        receive(sock)
    late = connect(int(port))
    try:
        while True:
            print(json.dumps(receive(late)), flush=True)
    except EOFError:
        pass


# --- a crowd ------------------------------------------------------------------------------

def good(port, count, result):
    sock = connect(port)
    times = []
    while len(times) < count:
        message = receive(sock, check=False)
        if message["name"] == "TipToTracker":
            times.append(message["utc_s"])
    result.append({"poses": len(times),
                   "ordered": all(a < b for a, b in zip(times, times[1:]))})


def hung(port, done):
    """Never reads."""
    sock = connect(port)
    done.wait()
    sock.close()


def dead(port, done):
    """Goes away in the middle, with a reset."""
    while not done.wait(0.2):
        sock = connect(port)
        sock.recv(1000)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        sock.close()


def loris(port, done):
    """A header, a byte at a time, and never its end."""
    sock = connect(port)
    header = pack("GET_STATUS", content=b"x" * 100)
    try:
        for i in range(len(header) - 1):
            sock.sendall(header[i:i + 1])
            while not done.is_set() and i > 20:
                if not sock.recv(1 << 16):
                    return
    except OSError:
        pass


def hostile(port, done, seed):
    """Random bytes, damaged messages, floods of requests."""
    source = random.Random(seed)
    requests = [pack("GET_IMAGE"), pack("GET_STATUS"), pack("GET_CAPABIL"), pack("STP_TRANS"),
                pack("STT_TRANS", "Force"), pack("TRANSFORM", "x", bytes(48)), pack("X" * 12),
                struct.pack(">H12s20sQQQ", 1, b"HUGE", b"", 0, 2**63, 0)]
    while not done.is_set():
        try:
            sock = connect(port)
            sock.settimeout(0.2)
            for _ in range(200):
                data = bytearray(source.choice(requests))
                if source.random() < 0.2:
                    data[source.randrange(len(data))] ^= 1 << source.randrange(8)
                if source.random() < 0.02:
                    data = source.randbytes(source.randrange(1, 5000))
                sock.sendall(data)
                sock.recv(source.randrange(1, 1 << 16))
                if done.is_set():
                    break
            sock.close()
        except OSError:
            pass


def crowd(port, count):
    port, done, result = int(port), threading.Event(), []
    bad = [threading.Thread(target=hung, args=(port, done)),
           threading.Thread(target=dead, args=(port, done)),
           threading.Thread(target=loris, args=(port, done)),
           threading.Thread(target=hostile, args=(port, done, 1))]
    readers = [threading.Thread(target=good, args=(port, int(count), result)) for _ in range(5)]
    for thread in bad + readers:
        thread.start()
    for thread in readers:
        thread.join()
    done.set()
    for thread in bad:
        thread.join()
    print(json.dumps(result))


{"receive": receive_all, "full": full, "crowd": crowd}[sys.argv[1]](*sys.argv[2:])
