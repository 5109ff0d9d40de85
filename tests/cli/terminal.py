# SPDX-License-Identifier: GPL-2.0-or-later
"""terminal.py STREAMS COMMAND...: run a command with some of its streams on a terminal.

STREAMS are numbers: 2 is stderr, 12 stdout and stderr. The others are those of this program.
Prints what came on the terminal, as it came but for its "\\r\\n", and exits as the command did.
"""
import os
import pty
import subprocess
import sys


def main(streams, command):
    ours, theirs = pty.openpty()
    on = {name: theirs for number, name in (("0", "stdin"), ("1", "stdout"), ("2", "stderr"))
          if number in streams}
    child = subprocess.Popen(command, **on)
    os.close(theirs)
    text = b""
    while True:
        try:
            got = os.read(ours, 4096)
        except OSError:  # EIO: the last end of the terminal is closed
            break
        if not got:
            break
        text += got
    status = child.wait()
    sys.stdout.buffer.write(text.replace(b"\r\n", b"\n"))
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
