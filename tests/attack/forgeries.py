#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""
Forgeries of a recording by someone who knows incise-recording(5) and recomputes every checksum,
and a second implementation of its blocks, seal and statement: with SQLite, hashlib and zlib only.

    forgeries.py STATEMENT_PROGRAM NAME.rec OTHER.rec COUNT SEED

NAME.rec is stated first, and forged COUNT times. The program must find each forgery, and name the
part that was forged. STATEMENT_PROGRAM is tests/attack/statement.
"""
import collections
import hashlib
import math
import os
import random
import shutil
import sqlite3
import struct
import subprocess
import sys
import zlib

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "../python"))
from read_blocks import COLUMNS, column, crc32c

STREAMS = ("force", "tracker", "camera", "wall")
START = {"boot", "host", "identity", "incise", "kernel", "started"}
CALIBRATION = {"calibration_conf", "depth_mm_px", "force_mV_N", "tip_x_mm", "tip_y_mm", "tip_z_mm"}
REWRITTEN = {"camera_note", "complete", "cut_ends_ns", "cuts", "depth_max_mm", "depth_rows", "force_clipped", "force_lost",
             "force_max_N", "force_rows", "force_zero_mV",
             "force_zero_samples", "force_zero_sd_mV", "frames_lost", "frames_rows",
             "frames_unlooked", "tracker_lost", "tracker_rows", "wall_rows"}
ORDER = {"events": "rowid", "knots": "stream, knot", "streams": "rowid", "meta": "key"}


# --- the format, a second time --------------------------------------------------------------

def sha(*parts):
    return hashlib.sha256(b"".join(parts)).digest()


def integers(*values):
    return b"".join(struct.pack("<q", v) for v in values)


DATA = {}  # of the rows of each block that was read, as it was written


def decode_rows(stream, count, data):
    """The rows of a block; None stands for NaN."""
    columns, at = [], 0
    for kind in COLUMNS[stream][1] if count else ():
        values, at = column(kind, data, at, count)
        columns.append([None if value != value else value for value in values])
    rows = [list(row) for row in zip(*columns)]
    DATA[str((stream, rows))] = data
    return rows


def encode_rows(stream, rows):
    """The data of a block, each value on its own where they are not those that were read."""
    known = DATA.get(str((stream, rows)))
    if known is not None:
        return known
    data = b""
    for kind, values in zip(COLUMNS[stream][1], zip(*rows)):
        if kind == "i":
            data += b"\x08" + bytes(16) + integers(*values)
        elif kind in "rn":
            data += b"\x08" + b"".join(
                struct.pack("<d", math.nan if value is None else value) for value in values)
        else:
            size = {"c": 1, "s": 24, "h": 32}[kind]
            data += bytes((size,)) + b"".join(
                (value if kind == "h" else value.encode()).ljust(size, b"\0") for value in values)
    return data


def encode_value(value):
    """A value of a table that the seals of the ledger have."""
    if value is None:
        return b"n"
    if isinstance(value, int):
        return b"i" + integers(value)
    if isinstance(value, float):
        return b"r" + struct.pack("<d", value)
    content = value.encode() if isinstance(value, str) else value
    return (b"t" if isinstance(value, str) else b"b") + integers(len(content)) + content


class Recording:
    """The tables of a recording, which may be changed and are written back with save()."""

    def __init__(self, path):
        self.path = path
        db = sqlite3.connect(path + "/recording.db")
        self.tables = {table: [list(row) for row in db.execute(
            f"SELECT * FROM {table} ORDER BY {order}")] for table, order in ORDER.items()}
        self.ledger = {name: [block] for name, *block in db.execute("SELECT * FROM ledger")}
        self.rows = {stream: [] for stream in STREAMS}
        for stream, *block, data in db.execute("SELECT * FROM blocks ORDER BY stream, block"):
            self.ledger.setdefault(stream, []).append(block)
            self.rows[stream] += decode_rows(stream, block[5], data)
        self.seal = [list(row) for row in db.execute("SELECT * FROM seal ORDER BY number")]
        db.close()
        self.head = self.length = None
        file = path + "/camera.mkv"
        if os.path.exists(file):
            with open(file, "rb") as opened:
                self.mkv = opened.read()
            self.read_file()

    def read_file(self):
        end = self.mkv[:65536].find(b"\x1f\x43\xb6\x75")
        self.head = self.mkv[:end if end >= 0 else 65536]
        self.length = len(self.mkv)

    def meta(self, key):
        return next((value for k, value in self.tables["meta"] if k == key), None)

    def set_meta(self, key, value):
        for row in self.tables["meta"]:
            if row[0] == key:
                row[1] = value

    # The ledger: block, first_seq, last_seq, first_ns, last_ns, count, lost, crc; of streams sha256 too.

    def rows_of(self, stream):
        """The rows of each block, by the numbers in the ledger; those behind the last are its."""
        rows, at = self.rows[stream], 0
        blocks = self.ledger.get(stream, [])
        last = max((block[0] for block in blocks if block[5]), default=-1)
        for block in blocks:
            first = at
            while block[5] and at < len(rows) and (rows[at][0] <= block[2] or block[0] == last):
                at += 1
            yield block, rows[first:at]

    def drop_empty_blocks(self, stream):
        """A block whose rows were all removed, so that nothing shows that it was there."""
        index = 2 + STREAMS.index(stream)
        for block, rows in list(self.rows_of(stream)):
            if rows or not block[5]:
                continue
            for row in self.seal:
                row[index] -= row[index] > block[0]
            self.ledger[stream].remove(block)
        for number, block in enumerate(self.ledger.get(stream, [])):
            block[0] = number

    def make_ledger(self, digests):
        for stream in STREAMS:
            self.drop_empty_blocks(stream)
            last_seq, last_ns, lost = -1, 0, 0
            for block, rows in list(self.rows_of(stream)):
                if rows:
                    numbers = [row[0] for row in rows]
                    block[1:7] = [numbers[0], numbers[-1], rows[0][1], rows[-1][1], len(rows),
                                  numbers[-1] - last_seq - len(rows)]
                    if block[0] == 0:
                        block[6] = numbers[-1] - numbers[0] + 1 - len(rows)
                    last_seq, last_ns = numbers[-1], rows[-1][1]
                elif block[5] == 0:
                    block[1:5] = [last_seq + 1, last_seq + block[6], last_ns, last_ns]
                lost += block[6]
                data = encode_rows(stream, rows)
                block[7] = crc32c(crc32c(0, data), integers(*block[:7]))
                block[8] = sha(data) if digests else block[8]
            if stream in ("force", "tracker", "camera") and stream in self.ledger:
                name = "frames" if stream == "camera" else stream
                self.set_meta(name + "_rows", len(self.rows[stream]))
                self.set_meta(name + "_lost", lost)
                for row in self.tables["streams"]:
                    if row[0] == stream:
                        row[7], row[8] = len(self.rows[stream]), lost
            elif stream == "wall":
                self.set_meta("wall_rows", len(self.rows[stream]))
        if self.meta("complete"):
            for table in ORDER:
                self.ledger["table:" + table] = [self.seal_of(
                    b"".join(encode_value(v) for row in self.tables[table] for v in row),
                    len(self.tables[table]), 0)]
            if self.head is not None:
                self.ledger["file:camera.mkv"] = [self.seal_of(
                    self.head, len(self.head), self.length)]

    @staticmethod
    def seal_of(content, count, last_seq):
        entry = [0, 0, last_seq, 0, 0, count, 0]
        return entry + [crc32c(crc32c(0, content), integers(*entry))]

    # The seal.

    def keys(self, which):
        return sha(*(encode_value(key) + encode_value(value)
                     for key, value in self.tables["meta"] if which(key)))

    def parts(self):
        """The digests of all parts but the streams, which chain() gives."""
        digests = {
            "start": self.keys(lambda key: key in START),
            "configuration": self.keys(lambda key: key not in START | CALIBRATION | REWRITTEN),
            "calibration": self.keys(lambda key: key in CALIBRATION),
            "meta": self.keys(lambda key: key in REWRITTEN),
            "depth": sha(),
        }
        for table in ("events", "knots", "streams"):
            digests[table] = sha(*(encode_value(v) for row in self.tables[table] for v in row))
        if self.head is not None:
            length = self.ledger["file:camera.mkv"][0][2] if self.meta("complete") else 0
            digests["camera.mkv"] = sha(self.head, integers(length))
        return digests

    def chain(self):
        """The heads, and the digests of the streams, from all data."""
        parts = self.parts()
        head = sha(b"incise seal 2\n", parts["start"], parts["configuration"],
                   parts["calibration"])
        digests = {stream: bytes(32) for stream in STREAMS}
        left = {stream: list(self.rows_of(stream)) for stream in STREAMS}
        heads = []
        for number, t_ns, *counts, _ in self.seal:
            blocks = b""
            for index, stream in enumerate(STREAMS):
                done = len(self.ledger.get(stream, [])) - len(left[stream])
                for block, rows in left[stream][:counts[index] - done]:
                    fields, digest = integers(*block[:8]), sha(encode_rows(stream, rows))
                    blocks += integers(index) + fields + digest
                    digests[stream] = sha(digests[stream], fields, digest)
                del left[stream][:counts[index] - done]
            if self.meta("complete") and number == self.seal[-1][0]:
                for table in ("depth", "events", "knots", "streams", "meta"):
                    blocks += parts[table]
                blocks += parts.get("camera.mkv", b"")
            head = sha(head, blocks, integers(number, t_ns, *counts))
            heads.append(head)
        return heads, digests

    def make_seal(self):
        for row, head in zip(self.seal, self.chain()[0]):
            row[6] = head

    def statement(self, name):
        heads, digests = self.chain()
        digests.update(self.parts())
        last = self.seal[-1][0]
        rows = {table: len(content) for table, content in self.tables.items()}
        rows.update({stream: len(content) for stream, content in self.rows.items()})
        rows.update(zip(("start", "configuration", "calibration", "meta"), (
            sum(which(key) for key, _ in self.tables["meta"]) for which in (
                lambda key: key in START, lambda key: key not in START | CALIBRATION | REWRITTEN,
                lambda key: key in CALIBRATION, lambda key: key in REWRITTEN))))
        rows["depth"] = 0
        rows["camera.mkv"] = self.length if self.head is not None and self.meta("complete") else 0
        lines = ["incise statement 1", "identity " + self.meta("identity"), "name " + name,
                 "software " + self.meta("incise"), "host " + self.meta("host"),
                 "started " + self.meta("started"),
                 "complete " + ("yes" if self.meta("complete") else "no"),
                 f"commit {last} {self.seal[-1][1]} {heads[-1].hex()}"]
        for part in ("start", "configuration", "calibration", *STREAMS, "depth", "events", "knots",
                     "streams", "meta", "camera.mkv"):
            lines.append(f"part {part} {rows[part]} {digests.get(part, bytes(32)).hex()}")
        n = min(last, 100)
        for i in range(n):
            at = i * last // n
            lines.append(f"earlier {at} {self.seal[at][1]} {heads[at].hex()}")
        return "\n".join(lines) + "\nend\n"

    def commit_of(self, stream, number):
        """The commit that a row came with, by its number."""
        before = 0
        for block, _ in self.rows_of(stream):
            before += 1
            if number <= block[2]:
                break
        index = 2 + STREAMS.index(stream)
        return next(row[0] for row in self.seal if row[index] >= before)

    def save(self):
        db = sqlite3.connect(self.path + "/recording.db")
        contents = dict(self.tables)
        contents["ledger"] = [[name] + block for name, blocks in self.ledger.items()
                              for block in blocks if name not in STREAMS]
        contents["blocks"] = [[stream] + block + [encode_rows(stream, rows)] for stream in STREAMS
                              for block, rows in self.rows_of(stream)]
        contents["seal"] = self.seal
        for table, rows in contents.items():
            db.execute(f"DELETE FROM {table}")
            if rows:
                db.executemany(f"INSERT INTO {table} VALUES({','.join('?' * len(rows[0]))})", rows)
        db.commit()
        db.close()
        if self.head is not None:
            with open(self.path + "/camera.mkv", "wb") as opened:
                opened.write(self.mkv)


# --- camera.mkv -----------------------------------------------------------------------------

def element(data, at):
    """ID, start and end of the content of the element of Matroska at a place."""
    n = 9 - data[at].bit_length()
    identity, at = data[at:at + n], at + n
    n = 9 - data[at].bit_length()
    size = int.from_bytes(data[at:at + n], "big") & (1 << 7 * n) - 1
    if size == (1 << 7 * n) - 1:
        size = len(data) - at - n  # unknown: to the end
    return identity, at + n, at + n + size


def elements(data, start, end):
    while start < end:
        identity, content, after = element(data, start)
        yield identity, content, after
        start = after


Frame = collections.namedtuple("Frame", "data note cluster")  # (start, end) of each


def frames_of(data):
    found = []
    for identity, start, end in elements(data, 0, len(data)):
        if identity != b"\x18\x53\x80\x67":
            continue
        for cluster, first, last in elements(data, start, end):
            if cluster != b"\x1f\x43\xb6\x75":
                continue
            block = note = None
            for group, a, b in elements(data, first, last):
                if group != b"\xa0":
                    continue
                for part, c, d in elements(data, a, b):
                    if part == b"\xa1":
                        block = (c + 4, d)  # track, time and flags before it
                    if part == b"\x75\xa1":
                        for more, e, f in elements(data, c, d):
                            for last_part, g, h in elements(data, e, f):
                                if last_part == b"\xa5":
                                    note = (g, h)
            found.append(Frame(block, note, (first, last)))
    return found


def set_frame(recording, index, content):
    """Other bytes of the same length for a frame, with all of its checksums."""
    data = bytearray(recording.mkv)
    frame = frames_of(data)[index]
    data[frame.data[0]:frame.data[1]] = content
    data[frame.note[0] + 4:frame.note[0] + 8] = struct.pack(">I", zlib.crc32(content))
    first, last = frame.cluster
    identity, start, end = element(data, first)
    if identity == b"\xbf":  # the CRC-32 of the cluster
        data[start:end] = struct.pack("<I", zlib.crc32(bytes(data[end:last])))
    recording.mkv = bytes(data)
    row = recording.rows["camera"][index]
    row[5], row[10] = zlib.crc32(content), sha(content)


# --- forgeries: each returns the parts one of which must be named, and the commit or None --------

def one_row(stream, column, change):
    def forge(recording, chance):
        row = chance.choice(recording.rows[stream][1:-1])
        commit = recording.commit_of(stream, row[0])
        row[column] = change(row[column], chance)
        return {stream}, commit
    return forge


def code(value, chance):
    return (value + chance.randint(1, 4094)) % 4096


def later(value, chance):
    return value + chance.randint(1, 1000)


def moved(value, chance):
    return (value or 0.0) + chance.choice((-1, 1)) * 10 ** chance.uniform(-6, 1)


def grown(value, chance):
    """A range at or below 0 is refused before anything is compared."""
    return value + 10 ** chance.uniform(-6, 1)


def swap_values(stream, column):
    def forge(recording, chance):
        rows = recording.rows[stream]
        a, b = chance.sample(range(len(rows)), 2)
        if rows[a][column] == rows[b][column]:
            rows[a][column] = code(rows[a][column], chance)
        rows[a][column], rows[b][column] = rows[b][column], rows[a][column]
        return {stream}, None
    return forge


def remove_row(stream):
    def forge(recording, chance):
        rows = recording.rows[stream]
        at = chance.randrange(1, len(rows) - 1)
        commit = recording.commit_of(stream, rows[at][0])
        del rows[at]
        return {stream}, commit
    return forge


def remove_block(recording, chance):
    block, rows = chance.choice(list(recording.rows_of("force"))[1:-2])
    commit = recording.commit_of("force", block[1])
    recording.rows["force"] = [row for row in recording.rows["force"] if row not in rows]
    return {"force"}, commit


def add_row(recording, chance):
    rows = recording.rows["force"]
    row = list(rows[-1])
    rows.append([row[0] + 1, row[1] + 100000, chance.randrange(4096)])
    return {"force"}, None


def shift_all(recording, chance):
    by = chance.randint(1, 10 ** 9)
    for row in recording.rows["tracker"]:
        row[1] += by
    return {"tracker"}, None


def remove_frame(recording, chance):
    at = chance.randrange(1, len(recording.rows["camera"]) - 1)
    start, end = frames_of(recording.mkv)[at].cluster
    start = recording.mkv.rindex(b"\x1f\x43\xb6\x75", 0, start)
    recording.mkv = recording.mkv[:start] + recording.mkv[end:]
    recording.read_file()
    del recording.rows["camera"][at]
    return {"camera"}, None


def forge_frame(recording, chance):
    at = chance.randrange(len(recording.rows["camera"]))
    start, end = frames_of(recording.mkv)[at].data
    content = bytearray(recording.mkv[start:end])
    content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    commit = recording.commit_of("camera", recording.rows["camera"][at][0])
    set_frame(recording, at, bytes(content))
    return {"camera"}, commit


def swap_frames(recording, chance):
    """Two rows get each other's frame."""
    rows = recording.rows["camera"]
    a, b = chance.sample(range(len(rows)), 2)
    for column in (3, 4, 5, 10):
        rows[a][column], rows[b][column] = rows[b][column], rows[a][column]
    return {"camera"}, None


def longer_file(recording, chance):
    recording.mkv += b"\xec" + bytes((0x80 | 20,)) + chance.randbytes(20)  # an element Void
    recording.read_file()
    return {"camera.mkv"}, None


def other_head(recording, chance):
    at = recording.head.find(b"Lavf")
    recording.mkv = (recording.mkv[:at] + bytes((chance.randrange(97, 123),)) + b"avx" +
                     recording.mkv[at + 4:])
    recording.read_file()
    return {"camera.mkv"}, None


def table_value(table, column, change):
    def forge(recording, chance):
        row = chance.choice(recording.tables[table])
        row[column] = change(row[column], chance)
        return {table}, None
    return forge


def swap_events(recording, chance):
    events = recording.tables["events"]
    events[0], events[-1] = events[-1], events[0]
    return {"events"}, None


def remove_event(recording, chance):
    del recording.tables["events"][chance.randrange(len(recording.tables["events"]))]
    return {"events"}, None


def add_event(recording, chance):
    recording.tables["events"].insert(1, [recording.tables["events"][0][0] + 1, "marker",
                                          f"forged {chance.random()}"])
    return {"events"}, None


def key(name, part, change):
    def forge(recording, chance):
        recording.set_meta(name, change(recording.meta(name), chance))
        return {part}, None
    return forge


def add_key(recording, chance):
    recording.tables["meta"].append(["zz_forged", chance.randrange(1000)])
    return {"configuration"}, None


def remove_key(recording, chance):
    recording.tables["meta"] = [row for row in recording.tables["meta"] if row[0] != "rig_conf"]
    return {"configuration"}, None


def calibration_text(value, chance):
    return value.replace("1240", str(chance.randint(1000, 1239)))


def some_text(value, chance):
    return f"{value}{chance.randrange(10 ** 6)}"


def truncate(complete):
    """To an older head: all that came later is removed, and every checksum is right."""
    def forge(recording, chance):
        last = chance.randrange(3, len(recording.seal) - 3)
        recording.seal = recording.seal[:last + 1]
        for index, stream in enumerate(STREAMS):
            blocks = recording.ledger.get(stream, [])[:recording.seal[-1][2 + index]]
            recording.ledger[stream] = blocks
            end = blocks[-1][2] if blocks else -1
            recording.rows[stream] = [row for row in recording.rows[stream] if row[0] <= end]
        if not complete:
            recording.set_meta("complete", 0)
            for name in [name for name in recording.ledger if ":" in name]:
                del recording.ledger[name]
        return {"seal"}, None
    return forge


def reopen(recording, chance):
    """Only the last commit is removed, with which the recording was closed."""
    recording.seal.pop()
    recording.set_meta("complete", 0)
    for name in [name for name in recording.ledger if ":" in name]:
        del recording.ledger[name]
    return {"seal"}, None


def append_commit(recording, chance):
    row = list(recording.seal[-1])
    recording.seal.append([row[0] + 1, row[1] + chance.randint(1, 10 ** 8)] + row[2:])
    return {"seal"}, None


def time_of_commit(recording, chance):
    row = chance.choice(recording.seal[:-1])
    row[1] += chance.randint(1, 10 ** 6)
    return {"seal", "-"}, None


def lost_of_ledger(recording, chance):
    recording.ledger["tracker"][-1][6] += chance.randint(1, 100)
    return {"tracker"}, None


def other_stream(recording, chance):
    """The force of another recording."""
    other = Recording(sys.argv[3])
    recording.rows["force"] = other.rows["force"]
    recording.ledger["force"] = other.ledger["force"]
    return {"force"}, None


def other_recording(recording, chance):
    """Another recording under the statement of this one."""
    other = Recording(sys.argv[3])
    recording.rows, recording.tables = other.rows, other.tables
    recording.ledger, recording.seal = other.ledger, other.seal
    recording.mkv = other.mkv
    recording.read_file()
    return {"start"}, None


def other_with_identity(recording, chance):
    """And it has got the identity of this one."""
    identity = recording.meta("identity")
    other_recording(recording, chance)
    recording.set_meta("identity", identity)
    return {"start", "force"}, None


def remove_seal(recording, chance):
    recording.seal = []
    return {"seal"}, None


def downgrade(recording, chance):
    """Made to look like a recording of format 3, which has no seal: it is not read."""
    with open(os.path.join(os.path.dirname(__file__), "../forms/3.sql"), encoding="utf-8") as file:
        made = [line for line in file if line.startswith("CREATE TABLE ") and
                line[13:].split("(")[0] in ("force", "tracker", "depth", "frames", "wall")]
    db = sqlite3.connect(recording.path + "/recording.db")
    db.executescript("DROP TABLE seal; DROP TABLE blocks; PRAGMA user_version=3;" + "".join(made))
    for stream, rows in recording.rows.items():
        table, n = ("frames", 10) if stream == "camera" else (stream, len(rows[0]))
        db.executemany(f"INSERT INTO {table} VALUES({','.join('?' * n)})", [row[:n] for row in rows])
    db.commit()
    db.close()
    return {"older incise"}, None


def other_seal(recording, chance):
    """The seal of another recording in the place of this one's."""
    recording.seal = Recording(sys.argv[3]).seal
    return {"seal", "-"}, None


FORGERIES = {
    "force code": one_row("force", 2, code),
    "force time": one_row("force", 1, later),
    "force order": swap_values("force", 2),
    "force row removed": remove_row("force"),
    "force block removed": remove_block,
    "force row added": add_row,
    "force of another": other_stream,
    "tracker position": one_row("tracker", 3, moved),
    "tracker quaternion": one_row("tracker", 7, moved),
    "tracker status": one_row("tracker", 10, lambda value, chance: chance.choice("ABCDEFG")),
    "tracker button": one_row("tracker", 12, lambda value, chance: 1 - value),
    "tracker order": swap_values("tracker", 2),
    "tracker row removed": remove_row("tracker"),
    "tracker times": shift_all,
    "tracker losses": lost_of_ledger,
    "frame bytes": forge_frame,
    "frame quality": one_row("camera", 9, lambda value, chance: (value or 0.0) + 0.001),
    "frame time": one_row("camera", 2, later),
    "frame order": swap_frames,
    "frame removed": remove_frame,
    "file longer": longer_file,
    "file head": other_head,
    "wall time": one_row("wall", 2, later),
    "wall uncertainty": one_row("wall", 3, lambda value, chance: value / 2),
    "wall source": one_row("wall", 8, lambda value, chance: "ptp"),
    "wall row removed": remove_row("wall"),
    "event text": table_value("events", 2, some_text),
    "event time": table_value("events", 0, later),
    "event removed": remove_event,
    "event added": add_event,
    "event order": swap_events,
    "knot": table_value("knots", 3, later),
    "stream delay": table_value("streams", 4, later),
    "stream device": table_value("streams", 1, some_text),
    "zero": key("force_zero_mV", "meta", moved),
    "clipped": key("force_clipped", "meta", later),
    "calibration": key("calibration_conf", "calibration", calibration_text),
    "sensitivity": key("force_mV_N", "calibration", moved),
    "tip": key("tip_z_mm", "calibration", moved),
    "configuration": key("rig_conf", "configuration", some_text),
    "surface": key("surface_point_z_mm", "configuration", moved),
    "range": key("force_full_scale_V", "configuration", grown),
    "key added": add_key,
    "key removed": remove_key,
    "host": key("host", "start", some_text),
    "started": key("started", "start", lambda value, chance: f"20{chance.randint(10, 25)}" + value[4:]),
    "software": key("incise", "start", some_text),
    "identity": key("identity", "start", lambda value, chance: chance.randbytes(16).hex()),
    "older, interrupted": truncate(False),
    "older, closed": truncate(True),
    "not closed": reopen,
    "commit added": append_commit,
    "time of commit": time_of_commit,
    "another recording": other_recording,
    "another, with this identity": other_with_identity,
    "another seal": other_seal,
    "seal removed": remove_seal,
    "format 3": downgrade,
}
# Nothing is recomputed after these.
KEEP_SEAL = {"another seal", "seal removed", "format 3"}


def statement(program, *arguments):
    done = subprocess.run([program, *arguments], stdout=subprocess.PIPE, check=False)
    return done.returncode, done.stdout.decode()


def main():
    program, path, _, count, seed = sys.argv[1:6]
    chance = random.Random(int(seed))
    status, text = statement(program, path)
    name = os.path.basename(path).removesuffix(".rec")
    if status or text != Recording(path).statement(name):
        sys.exit(f"the second implementation of the seal differs:\n{text}\n"
                 f"{Recording(path).statement(name)}")
    frames = frames_of(Recording(path).mkv)
    for row, frame in zip(Recording(path).rows["camera"], frames, strict=True):
        assert row[10] == sha(Recording(path).mkv[slice(*frame.data)])
    with open("stated", "w", encoding="utf-8") as file:
        file.write(text)
    status, text = statement(program, path, "stated")
    if status:
        sys.exit(f"an untouched recording differs: {text}")

    # Checksums that are recomputed: none, those of the ledger (with the digests or without), and the seal too.
    names, found = list(FORGERIES), collections.Counter()
    for i in range(int(count)):
        kind, level = names[i % len(names)], 2 - i // len(names) % 3
        shutil.rmtree("forged.rec", ignore_errors=True)
        shutil.copytree(path, "forged.rec")
        recording = Recording("forged.rec")
        parts, commit = FORGERIES[kind](recording, chance)
        if level > 0:
            recording.make_ledger(level > 1 or chance.random() < 0.5)
        if level > 1 and kind not in KEEP_SEAL:
            recording.make_seal()
        if kind != "format 3":
            recording.save()
        if level > 1 and kind not in KEEP_SEAL:
            # Without a statement nothing could be found.
            status, own = statement(program, "forged.rec")
            assert not status and own == recording.statement("forged"), kind
        status, text = statement(program, "forged.rec", "stated")
        lines = [line.split(" ", 3) for line in text.splitlines()]
        named = [line for line in lines if line[0] in parts]
        if level < 2 or kind in KEEP_SEAL:
            # The ledger names tables, streams and the file in words.
            named += [line for line in lines for part in parts if part in line[3]]
        placed = level < 2 or commit is None or any(
            int(line[1]) <= commit <= int(line[2]) for line in named)
        if not status or not named or not placed:
            sys.exit(f"forgery {i}, {kind}, level {level}, commit {commit}: exit status {status}, "
                     f"{sorted(parts)} is not named:\n{text}")
        found[level] += 1
    print(f"{count} forgeries of {len(names)} kinds, {sum(found.values())} found and named: "
          f"{found[2]} with all checksums right, {found[1]} with those of the ledger, "
          f"{found[0]} with none")


if __name__ == "__main__":
    main()
