# SPDX-License-Identifier: GPL-2.0-or-later
"""An OpenIGTLink server on 127.0.0.1 that sends poses, by pyigtl or, hostile, by hand.

    igtl_send.py [--seconds S] [--rate HZ] [--name NAME]… [--do WHAT]

Pose i of each NAME is at (i % 1000) / 64, 2, 10 mm, turned by 90 degrees about z. WHAT:

    poses     (the default) poses by pyigtl
    silence   accepts, and sends nothing
    noise     random bytes
    half      half of a message, then nothing
    nan       poses by hand; of each 10, one is not a number
    mirror    one of 10 is a mirror
    crc       one of 10 has a wrong CRC
    unseen    one of 10 follows a STATUS that it is not there
    drop      closes the connection after each 150 poses; poses go on without a listener

It prints its port when it listens. By hand, pose i has the timestamp START + i / rate.
"""
import argparse
import os
import socket
import struct
import time


def crc64(data):
    crc = 0
    for byte in data:
        crc ^= byte << 56
        for _ in range(8):
            crc = (crc << 1) ^ (0x42F0E1EBA9EA3693 if crc >> 63 else 0)
            crc &= 0xFFFFFFFFFFFFFFFF
    return crc


def message(kind, name, body, stamp, wrong=False):
    seconds = int(stamp)
    return (
        struct.pack(
            ">H12s20sIIQQ",
            1,
            kind,
            name.encode(),
            seconds,
            int((stamp - seconds) * 2**32),
            len(body),
            crc64(body) ^ wrong,
        )
        + body
    )


def transform(name, i, stamp, kind):
    now = i % 10 == 5
    x = float("nan") if kind == "nan" and now else i % 1000 / 64
    z = -1 if kind == "mirror" and now else 1
    # columns of the rotation, then the translation
    body = struct.pack(">12f", 0, 1, 0, -1, 0, 0, 0, 0, z, x, 2, 10)
    return message(b"TRANSFORM", name, body, stamp, kind == "crc" and now)


def by_hand(options, server):
    start, i = time.time(), 0
    end = start + options.seconds
    while time.time() < end:
        try:
            peer, _ = server.accept()
        except socket.timeout:
            continue
        with peer:
            try:
                if options.do == "noise":
                    peer.sendall(os.urandom(5000))
                elif options.do == "half":
                    peer.sendall(transform(options.name[0], 0, start, "")[:60])
                if options.do in ("silence", "noise", "half"):
                    peer.settimeout(max(0.1, end - time.time()))
                    peer.recv(1)
                    continue
                sent, i = 0, int((time.time() - start) * options.rate)
                while time.time() < end and not (options.do == "drop" and sent >= 150):
                    due = int((time.time() - start) * options.rate)
                    for i in range(i, due):
                        if options.do == "unseen":
                            code = 16 if i % 10 == 5 else 1
                            body = struct.pack(">Hq20s", code, 0, b"") + b"\0"
                            peer.sendall(message(b"STATUS", options.name[0], body, start))
                        peer.sendall(
                            transform(options.name[0], i, start + i / options.rate, options.do)
                        )
                        sent += 1
                    i = max(i, due)
                    time.sleep(0.002)
            except OSError:
                pass


def by_pyigtl(options):
    import numpy
    import pyigtl

    server = pyigtl.OpenIGTLinkServer(port=0, local_server=True)
    print(server.server_address[1], flush=True)
    start = time.time()
    for i in range(int(options.seconds * options.rate)):
        pose = numpy.eye(4)
        pose[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
        pose[:3, 3] = [i % 1000 / 64, 2, 10]
        for name in options.name:
            server.send_message(
                pyigtl.TransformMessage(pose, device_name=name, timestamp=time.time())
            )
        time.sleep(max(0, start + (i + 1) / options.rate - time.time()))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=3600)
    parser.add_argument("--rate", type=float, default=100)
    parser.add_argument("--name", action="append")
    parser.add_argument("--do", default="poses")
    options = parser.parse_args()
    options.name = options.name or ["Stylus"]
    if options.do == "poses":
        by_pyigtl(options)
        return
    server = socket.socket()
    server.bind(("127.0.0.1", 0))
    server.listen()
    server.settimeout(0.2)
    print(server.getsockname()[1], flush=True)
    by_hand(options, server)


main()
