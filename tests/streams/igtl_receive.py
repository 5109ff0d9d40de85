# SPDX-License-Identifier: GPL-2.0-or-later
"""pyigtl as a client: igtl_receive.py PORT COUNT NAME...

Waits until COUNT messages of each device have come, and prints a JSON object of them: name to a list
of [timestamp, value], where a value is a matrix, a text, or the shape of an image.
"""
import json
import sys
import time

import pyigtl


def value_of(message):
    if message.message_type == "TRANSFORM":
        return message.matrix.tolist()
    if message.message_type == "STRING":
        return message.string
    return list(message.image.shape)


def main(port, count, *names):
    client = pyigtl.OpenIGTLinkClient("127.0.0.1", int(port))
    found = {name: [] for name in names}
    deadline = time.monotonic() + 300
    while any(len(rows) < int(count) for rows in found.values()):
        if time.monotonic() > deadline:
            sys.exit(f"only {({name: len(rows) for name, rows in found.items()})} in 300 s")
        for message in client.get_latest_messages():
            if message.device_name in found:
                found[message.device_name].append([message.timestamp, value_of(message)])
        time.sleep(0.001)
    client.stop()
    print(json.dumps(found))


main(*sys.argv[1:])
