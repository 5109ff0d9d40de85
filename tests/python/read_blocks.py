# SPDX-License-Identifier: GPL-2.0-or-later
"""The samples of a recording of format 5, read as incise-recording(5) describes them, without incise.

    for stream, block, columns in read_blocks.blocks("NAME.rec"): …

ValueError names the first block whose CRC32C, SHA-256 or length is wrong.
"""
import hashlib
import sqlite3
import struct

COLUMNS = {
    "force": ("seq t_ns code", "iii"),
    "tracker": ("seq t_ns arrival_ns x_mm y_mm z_mm qw qx qy qz status station button",
                "iiirrrrrrrcii"),
    "camera": ("seq t_ns arrival_ns pts bytes crc length_px sd_px depth_mm quality sha256",
               "iiiiiinnnnh"),
    "wall": ("seq t_ns tai_ns uncertainty_ns rate_ppb rate_uncertainty_ppb utc_offset_s held source"
             " reference leap restart", "iiinrriissss"),
}
FORMS = {1: "B", 2: "H", 4: "I", 8: "Q", "c": "c", "s": "24s", "h": "32s"}
CRC = list(range(256))
for _ in range(8):
    CRC = [c >> 1 ^ (0x82F63B78 if c & 1 else 0) for c in CRC]


def crc32c(crc, data):
    crc ^= 0xFFFFFFFF
    for byte in data:
        crc = CRC[(crc ^ byte) & 255] ^ crc >> 8
    return crc ^ 0xFFFFFFFF


def column(kind, data, at, n):
    """The n values of a column that begins there, and its end."""
    width = data[at]
    if kind == "i":
        base, span = struct.unpack_from("<qQ", data, at + 1)
        off = struct.unpack_from(f"<{n}{FORMS[width]}", data, at + 17) if width else (0,) * n
        values = (base + span * k // max(n - 1, 1) + off[k] for k in range(n))
        return [(v + 2**63) % 2**64 - 2**63 for v in values], at + 17 + n * width
    form = "<" + (FORMS.get(kind) or ("f" if width == 4 else "d")) * (n if width else 1)
    values = [v.rstrip(b"\0").decode() if kind in "cs" else v
              for v in struct.unpack_from(form, data, at + 1)]
    return values * (n // len(values)), at + 1 + struct.calcsize(form)


def blocks(path):
    with sqlite3.connect(f"file:{path}/recording.db?mode=ro", uri=True) as db:
        rows = db.execute("SELECT * FROM blocks ORDER BY stream, block").fetchall()
    for stream, *block, crc, sha256, data in rows:
        made = crc32c(crc32c(0, data), struct.pack("<7q", *block)), hashlib.sha256(data).digest()
        if made != (crc, sha256):
            raise ValueError(f"{stream}, block {block[0]} is not as it was written")
        columns, at = {}, 0
        for name, kind in zip(COLUMNS[stream][0].split(), COLUMNS[stream][1]):
            columns[name], at = column(kind, data, at, block[5]) if block[5] else ([], 0)
        if at != len(data):
            raise ValueError(f"{stream}, block {block[0]} is longer than its count")
        yield stream, block, columns
