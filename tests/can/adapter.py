# SPDX-License-Identifier: GPL-2.0-or-later
"""
A serial CAN adapter (slcan) that is not there: the host opens one end of a pty, as it would
/dev/ttyACM0, and the drive sits at the other. Frames are written and read by python-can's own
slcan code; the lines are cut in blocks, since it asks for every byte with two system calls.
"""

import errno
import logging
import os
import select
import tty
from types import SimpleNamespace

logging.getLogger("can").setLevel(logging.ERROR)

from can import BusABC, CanProtocol
from can.interfaces.slcan import slcanBus

FRAMES = "tTrR"


class Adapter(slcanBus):
    """Answers the host's commands as LAWICEL adapters do; quiet: as those that do not."""

    def __init__(self, quiet=False):
        self.near, self.far = os.openpty()
        tty.setraw(self.far)  # kept open: a pty whose other end is closed reads as broken
        os.set_blocking(self.near, False)
        self.path = os.ttyname(self.far)
        self.quiet = quiet
        self.is_open = False
        self.bitrate = None
        self.full = 0  # what did not fit since nobody reads
        self.odd = 0  # lines that are no command
        self._lines = []
        self._rest = b""
        self._listen_only = False
        self._can_protocol = CanProtocol.CAN_20
        self._queue = SimpleNamespace(qsize=lambda: 0)
        self.serialPortOrig = SimpleNamespace(write_timeout=None)
        BusABC.__init__(self, self.path)

    def fileno(self):
        return self.near

    def put(self, data):
        """Bytes as they are. A real one loses what does not fit, too."""
        try:
            if os.write(self.near, data) != len(data):
                self.full += 1
        except OSError as error:
            if error.errno != errno.EAGAIN:
                raise
            self.full += 1

    def _write(self, string):
        if self.is_open:
            self.put(string.encode() + b"\r")

    def _fill(self):
        try:
            data = os.read(self.near, 4096)
        except BlockingIOError:
            return
        *lines, self._rest = (self._rest + data).split(b"\r")
        self._lines += lines
        if len(self._rest) > 4096:
            self._rest = b""

    def _read(self, timeout):
        """The next line of the host that is a frame; commands are answered here."""
        if not self._lines:
            if timeout is None or timeout > 0:
                select.select([self.near], [], [], timeout)
            self._fill()
        while self._lines:
            line = self._lines.pop(0).decode("ascii", "replace")
            if line[:1] in FRAMES and line:
                if not self.is_open:
                    self._answer(b"\a")
                    continue
                self._answer(b"z\r" if line[0] in "tr" else b"Z\r")
                return line
            self._command(line)
        return None

    def _answer(self, data):
        if not self.quiet:
            self.put(data)

    def _command(self, line):
        kind = line[:1]
        if kind == "":
            self._answer(b"\r")  # hosts send empty lines to end what was there before
        elif kind == "S" and line[1:] in "012345678" and not self.is_open:
            rates = {code: rate for rate, code in self._BITRATES.items()}
            self.bitrate = rates[line]
            self._answer(b"\r")
        elif kind == "O":
            self.is_open = True
            self._answer(b"\r")
        elif kind == "C":
            self.is_open = False
            self._answer(b"\r")
        elif kind == "V":
            self._answer(b"V1013\r")
        elif kind == "N":
            self._answer(b"NBEEF\r")
        elif kind == "F":
            self._answer(b"F00\r")
        elif kind in "ZsMm":
            self._answer(b"\r")
        else:
            self.odd += 1
            self._answer(b"\a")

    def shutdown(self):
        BusABC.shutdown(self)
        os.close(self.near)
        os.close(self.far)
