#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""device.py NAME: the device of device.c by mmap and struct alone, for `--rig local:NAME`.

Python has no memory barriers: use it on x86, which keeps the order of stores, and C elsewhere.
"""
import fcntl
import math
import mmap
import os
import signal
import struct
import sys
import time

PERIOD_NS, PERIOD_MOST_NS, RAMP_NS, PEAK_N = 1_000_000, 20_000_000, 100_000_000, 5.0
DEVICE, OWNER, USER, RING = 128, 1152, 1472, 1600
PARTS = (DEVICE, 1024, 1, 0, OWNER, 320, 1, 0, USER, 128, 1, 0, RING, 128, 32, 0)
READY, ENDED, FORCE = 1, 3, 1
VELOCITY = 1
# behind the sequence lock of each part, which is its first word
OWNER_HALF = struct.Struct("=IqQQII256s24x")  # state, heartbeat, samples, lost, error, 0, reason
USER_HALF = struct.Struct("=IIqq3d3d56x")  # seq, wants, heartbeat, period, force, torque
SAMPLE = struct.Struct("=IQqQ3d3d4dII8x")  # 0, number, time, sequence, x, v, q, buttons, flags
now = time.monotonic_ns


def create(name):
    """The page of zeros, locked; that of a dead owner is replaced."""
    path = "/dev/shm/incise-" + name
    for flags in (os.O_RDWR, os.O_RDWR | os.O_CREAT | os.O_EXCL):
        try:
            fd = os.open(path, flags, 0o600)
        except FileNotFoundError:
            continue
        fcntl.lockf(fd, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, 0)
        if flags == os.O_RDWR:
            os.unlink(path)
    os.ftruncate(fd, RING + 32 * 128)
    return path, mmap.mmap(fd, RING + 32 * 128)


def put(page, offset, half, *values):
    seq = struct.unpack_from("=I", page, offset)[0] & ~1
    struct.pack_into("=I", page, offset, (seq + 1) % 2**32)
    half.pack_into(page, offset + 4, *values)
    struct.pack_into("=I", page, offset, (seq + 2) % 2**32)


def get(page):
    """The user's half, or None where it is torn at three tries."""
    for _ in range(3):
        half = USER_HALF.unpack_from(page, USER)
        if not half[0] & 1 and struct.unpack_from("=I", page, USER)[0] == half[0]:
            return half
    return None


class Gate:
    """The user's force: none without a heartbeat or a valid request, then up by a ramp."""
    last, share = (0,) * 10, 0.0

    def force(self, half):
        if half:
            seq, wants, beat, period, *forces = half
            back = (seq - self.last[0]) % 2**32 >= 2**31
            if (wants != FORCE or not all(map(math.isfinite, forces)) or back or
                    not 0 < period <= PERIOD_MOST_NS or not 0 < beat <= now()):
                self.share = 0.0
                return 0.0
            self.last = half
        age = (now() - self.last[2]) / self.last[3] if self.last[3] else math.inf
        # torn: it fades in the second period
        self.share = min(self.share + PERIOD_NS / RAMP_NS, 1 if half else max(0, 2 - age)) if age <= 2 else 0.0
        return max(-PEAK_N, min(PEAK_N, self.share * self.last[4]))


def main(name):
    path, page = create(name)
    gate, x, v, n, stop = Gate(), 0.0, 0.0, 0, []
    signal.signal(signal.SIGTERM, lambda *_: stop.append(1))
    struct.pack_into("=256s64s200s304s14d2qd4I", page, DEVICE, f"local:{name}".encode(), b"spring in Python", b"", b"",
                     *(6 * [0.0]), PEAK_N, 0, 0, 0.1, 0.002, 0, 0, 1e9 / PERIOD_NS, PERIOD_NS, 0, 0, 0, VELOCITY, 0, 0)
    put(page, OWNER, OWNER_HALF, READY, now(), 0, 0, 0, 0, b"")
    struct.pack_into("=4I16I", page, 8, 1, 0, len(page), os.getpid(), *PARTS)
    page[0:8] = b"INCISEHP"  # last: now the page is complete
    while not stop:
        v += (gate.force(get(page)) - 0.2 * x - 0.002 * v) / 0.1
        x += v / 1000
        t = now()
        put(page, RING + n % 32 * 128, SAMPLE, 0, n, t, n, x, 0, 0, v, 0, 0, 1, 0, 0, 0, 0, 0)
        n += 1
        put(page, OWNER, OWNER_HALF, READY, t, n, 0, 0, 0, b"")
        time.sleep(PERIOD_NS / 1e9)
    put(page, OWNER, OWNER_HALF, ENDED, now(), n, 0, 0, 0, b"stopped; start it again")
    os.unlink(path)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "spring")
