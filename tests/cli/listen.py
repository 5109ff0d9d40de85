# SPDX-License-Identifier: GPL-2.0-or-later
"""The service manager's end of sd_notify(3): listen.py SOCKET prints each datagram on a line of
its own with the seconds since it began, its lines separated by a space, until it is killed."""
import os
import socket
import sys
import time

listener = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
listener.bind(sys.argv[1])
begin = time.monotonic()
print("listening", flush=True)
while True:
    text = listener.recv(4096).decode()
    print(f"{time.monotonic() - begin:.3f}", " ".join(text.split("\n")), flush=True)
