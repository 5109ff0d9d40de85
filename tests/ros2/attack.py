#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Send changed datagrams of RTPS to the only participant of DDS on 127.0.0.1.

    attack.py DOMAIN CASES SEED PID

Takes the server's prefix from what it sends to look for others, and puts it where the kept datagrams
(datagrams.txt) name their receiver. Each datagram has up to eight changes, in three of four cases behind the
head; the same ones for each SEED. The next ones wait until the server, process PID, has taken those before. Prints
JSON: how many were sent, and how many the kernel dropped.
"""
import json
import os
import random
import socket
import sys
import time
from pathlib import Path

NAME = b"incise serve"
HEAD, PORTS = 20, 7400
KINDS = [1, 6, 7, 8, 9, 12, 13, 14, 15, 18, 19, 21, 22, 0x80, 0xFF]
EXTREMES = [b"\0" * 4, b"\xff" * 4, b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\1\0\0\0", b"\xff\xff\0\0", b"\0\1\0\0"]


def submessages(datagram):
    """Offsets of their begins."""
    at, found = HEAD, []
    while at + 4 <= len(datagram):
        found.append(at)
        order = "little" if datagram[at + 1] & 1 else "big"
        size = int.from_bytes(datagram[at + 2 : at + 4], order)
        at += 4 + (size or len(datagram))
    return found


def changed(draw, kept):
    data = bytearray(draw.choice(kept))
    if draw.random() < 0.3:  # more submessages
        other = draw.choice(kept)
        data += other[draw.choice(submessages(other)) :]
    for _ in range(draw.choice([0, 1, 1, 1, 2, 2, 3, 8])):
        at = draw.randrange(HEAD if draw.random() < 0.75 else 0, len(data))
        way = draw.randrange(8)
        if way == 0:
            data[at] ^= 1 << draw.randrange(8)
        elif way == 1:
            data[at] = draw.randrange(256)
        elif way == 2:
            data[at : at + 4] = draw.choice(EXTREMES)
        elif way == 3:
            data[at : at + 2] = draw.randrange(1 << draw.randint(1, 16)).to_bytes(2, "little")
        elif way == 4 and len(data) > HEAD + 8:
            del data[at : at + draw.choice([1, 4, len(data)])]
        elif way == 5:
            data[at:at] = data[at : at + draw.choice([4, 16, 64])]
        elif way == 6:
            data[draw.choice(submessages(data) or [at])] = draw.choice(KINDS)
        else:  # the length of a submessage
            start = draw.choice(submessages(data) or [at])
            data[start + 2 : start + 4] = draw.choice([b"\0\0", b"\4\0", b"\xff\xff", b"\xfc\xff", b"\x20\0"])
        data += bytes(max(0, 2 * HEAD - len(data)))
    return bytes(data)


def server_prefix(base):
    """From the datagram by which it looks for the second participant."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", base + 12))
        receiver.settimeout(120)
        return receiver.recv(65536)[8:20]


def waiting(ports):
    """Bytes that wait at the ports, and datagrams that were dropped there."""
    size = dropped = 0
    for line in Path("/proc/net/udp").read_text(encoding="ascii").splitlines()[1:]:
        fields = line.split()
        if int(fields[1].split(":")[1], 16) in ports:
            size += int(fields[4].split(":")[1], 16)
            dropped += int(fields[12])
    return size, dropped


def main(domain, cases, seed, server):
    base = PORTS + 250 * int(domain)
    ports = (base + 10, base + 11)
    prefix = server_prefix(base)
    text = (Path(__file__).parent / "datagrams.txt").read_text(encoding="ascii")
    kept = [[], []]
    for port, data in (line.split() for line in text.splitlines() if not line.startswith("#")):
        kept[int(port)].append(bytes.fromhex(data).replace(NAME, prefix))
    draw = random.Random(seed)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for i in range(int(cases)):
            port = draw.randrange(2)
            sender.sendto(changed(draw, kept[port]), ("127.0.0.1", ports[port]))
            while i % 20 == 0 and waiting(ports)[0]:
                os.kill(int(server), 0)
                time.sleep(0.0005)
    json.dump({"sent": int(cases), "dropped": waiting(ports)[1]}, sys.stdout)


main(*sys.argv[1:])
