#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""A strict reader of MCAP files, after https://mcap.dev/spec, that shares nothing with the
writer. Checks every record, length, checksum and index, and counts messages by topic.

    check.py FILE            one JSON object: topics, metadata, first and last message
    check.py --package FILE  the same read once more by the package `mcap` of PyPI, which
                             has to be there, and compared
"""
import json
import struct
import sys
import zlib

MAGIC = b"\x89MCAP0\r\n"
NAMES = {1: "Header", 2: "Footer", 3: "Schema", 4: "Channel", 5: "Message", 6: "Chunk",
         7: "MessageIndex", 8: "ChunkIndex", 0x0B: "Statistics", 0x0C: "Metadata",
         0x0D: "MetadataIndex", 0x0E: "SummaryOffset", 0x0F: "DataEnd"}


class Fields:
    def __init__(self, data):
        self.data, self.at = data, 0

    def number(self, size):
        value = self.data[self.at:self.at + size]
        assert len(value) == size, "a field is cut short"
        self.at += size
        return int.from_bytes(value, "little")

    def take(self, n):
        value = self.data[self.at:self.at + n]
        assert len(value) == n, "a field is cut short"
        self.at += n
        return value

    def text(self):
        return self.take(self.number(4)).decode("utf-8")

    def part(self):
        return Fields(self.take(self.number(4)))

    def map(self, key, value):
        part, found = self.part(), {}
        while part.at < len(part.data):
            k = key(part)
            assert k not in found, "a key stands twice"
            found[k] = value(part)
        return found

    def done(self):
        assert self.at == len(self.data), "bytes are left over in a record"


def records(data, at, end):
    """(opcode, content, offset, whole length) of each record."""
    while at < end:
        opcode, length = struct.unpack_from("<BQ", data, at)
        assert opcode in NAMES, f"opcode {opcode} at {at}"
        assert at + 9 + length <= end, f"record at {at} is longer than its section"
        yield opcode, Fields(data[at + 9:at + 9 + length]), at, 9 + length
        at += 9 + length


def schema(f):
    s = (f.number(2), f.text(), f.text(), bytes(f.take(f.number(4))))
    f.done()
    assert s[0] != 0 and s[2] in ("jsonschema", "ros2msg")
    assert s[2] == "ros2msg" or json.loads(s[3])["type"] == "object"
    return s


def channel(f):
    c = (f.number(2), f.number(2), f.text(), f.text(), f.map(Fields.text, Fields.text))
    f.done()
    assert c[3] in ("json", "cdr")
    return c


def content(channel_encoding, data):
    """JSON, or the text of other bytes."""
    return json.loads(data.decode("utf-8")) if channel_encoding == "json" else data.hex()


def matches(value, s, path="message"):
    kinds = {"object": dict, "number": (int, float), "integer": int, "string": str,
             "boolean": bool}
    assert isinstance(value, kinds[s["type"]]), path
    assert (s["type"] == "boolean") == isinstance(value, bool), path
    if s["type"] == "object":
        assert set(value) == set(s["properties"]), path
        for key in value:
            matches(value[key], s["properties"][key], path + "." + key)


def check(data):
    assert data[:8] == MAGIC and data[-8:] == MAGIC, "magic"
    footer = data[-8 - 29:-8]
    opcode, length, summary, offsets, crc = struct.unpack("<BQQQI", footer)
    assert (opcode, length) == (2, 20), "Footer"
    assert crc == zlib.crc32(data[summary:len(data) - 12]), "summary_crc"

    schemas, channels, counts, last = {}, {}, {}, {}
    chunks, indexes, metadata, order = {}, {}, {}, []
    first = final = None
    end = None
    previous = None
    for opcode, f, at, length in records(data, 8, summary):
        order.append(NAMES[opcode])
        assert end is None, "a record behind DataEnd"
        if opcode == 1:
            assert at == 8
            profile, _ = f.text(), f.text()
            f.done()
        elif opcode == 3:
            s = schema(f)
            schemas[s[0]] = s
        elif opcode == 4:
            c = channel(f)
            assert c[1] in schemas
            channels[c[0]] = c
            counts[c[0]] = 0
        elif opcode == 0x0C:
            metadata[at] = (f.text(), f.map(Fields.text, Fields.text), length)
            f.done()
        elif opcode == 6:
            start, stop, size, crc = f.number(8), f.number(8), f.number(8), f.number(4)
            assert f.text() == ""
            inside = f.take(f.number(8))
            f.done()
            assert len(inside) == size and zlib.crc32(inside) == crc, "a chunk's crc"
            times, found = [], {}
            for op, m, where, _ in records(inside, 0, len(inside)):
                assert op == 5
                number, sequence = m.number(2), m.number(4)
                log, publish = m.number(8), m.number(8)
                encoding = channels[number][3]
                value = content(encoding, m.take(len(m.data) - m.at))
                assert log == publish
                assert sequence == counts[number] & 0xFFFFFFFF, "sequence"
                assert previous is None or log >= previous, "messages are out of order"
                previous = log
                if encoding == "json":
                    matches(value, json.loads(schemas[channels[number][1]][3]))
                else:
                    assert value.startswith("00010000"), "little-endian CDR"
                counts[number] += 1
                times.append(log)
                found.setdefault(number, []).append((log, where))
                first = first or [channels[number][2], log, value]
                final = [channels[number][2], log, value]
            assert (min(times), max(times)) == (start, stop), "a chunk's times"
            last = {"at": at, "length": length, "start": start, "stop": stop,
                    "size": size, "index": {}, "index_length": 0, "found": found}
            chunks[at] = last
        elif opcode == 7:
            number, part = f.number(2), f.part()
            f.done()
            entries = []
            while part.at < len(part.data):
                entries.append((part.number(8), part.number(8)))
            assert entries == last["found"].pop(number), "a MessageIndex"
            last["index"][number] = at
            last["index_length"] += length
        elif opcode == 0x0F:
            assert f.number(4) == zlib.crc32(data[:at]), "data_section_crc"
            f.done()
            end = at
        else:
            raise AssertionError(f"{NAMES[opcode]} in the data section")
    assert end is not None, "DataEnd"
    assert all(not c["found"] for c in chunks.values()), "a message is in no index"

    groups = {}
    again, known = {"s": {}, "c": {}}, 0
    for opcode, f, at, length in records(data, summary, offsets):
        if opcode in groups:
            assert groups[opcode][0] + groups[opcode][1] == at, "a group is torn"
        groups[opcode] = [groups.get(opcode, [at])[0],
                          groups.get(opcode, [0, 0])[1] + length]
        if opcode == 3:
            s = schema(f)
            again["s"][s[0]] = s
        elif opcode == 4:
            c = channel(f)
            again["c"][c[0]] = c
        elif opcode == 0x0B:
            stats = [f.number(n) for n in (8, 2, 4, 4, 4, 4, 8, 8)]
            per = f.map(lambda p: p.number(2), lambda p: p.number(8))
            f.done()
            times = [min(c["start"] for c in chunks.values()),
                     max(c["stop"] for c in chunks.values())] if chunks else [0, 0]
            assert stats == [sum(counts.values()), len(schemas), len(channels), 0,
                             len(metadata), len(chunks)] + times, "Statistics"
            assert per == counts, "channel_message_counts"
        elif opcode == 8:
            start, stop, at, n = (f.number(8) for _ in range(4))
            where = f.map(lambda p: p.number(2), lambda p: p.number(8))
            rest = [f.number(8), f.text(), f.number(8), f.number(8)]
            f.done()
            c = chunks[at]
            assert (start, stop, n, where) == (c["start"], c["stop"], c["length"], c["index"])
            assert rest == [c["index_length"], "", c["size"], c["size"]], "ChunkIndex"
            known += 1
        elif opcode == 0x0D:
            at, n, name = f.number(8), f.number(8), f.text()
            f.done()
            assert metadata[at][0] == name and metadata[at][2] == n, "MetadataIndex"
        else:
            raise AssertionError(f"{NAMES[opcode]} in the summary")
    assert again["s"] == schemas and again["c"] == channels, "summary repeats others"
    assert known == len(chunks), "a chunk is in no index"
    told = {}
    for opcode, f, _, _ in records(data, offsets, len(data) - 8 - 29):
        assert opcode == 0x0E
        group = f.number(1)
        told[group] = [f.number(8), f.number(8)]
        f.done()
    assert told == groups, "SummaryOffset"
    return {"profile": profile, "topics": {c[2]: counts[i] for i, c in channels.items()},
            "metadata": {m[0]: m[1] for m in metadata.values()},
            "chunks": len(chunks), "first": first, "last": final}


def by_package(path):
    from mcap.reader import SeekingReader
    from mcap.stream_reader import StreamReader

    with open(path, "rb") as file:
        for _ in StreamReader(file, validate_crcs=True).records:
            pass
    topics, first, last = {}, None, None
    with open(path, "rb") as file:
        reader = SeekingReader(file, validate_crcs=True)
        for c in reader.get_summary().channels.values():
            topics[c.topic] = 0
        for _, c, message in reader.iter_messages():
            topics[c.topic] += 1
            last = [c.topic, message.log_time, content(c.message_encoding, message.data)]
            first = first or last
        metadata = {m.name: m.metadata for m in reader.iter_metadata()}
    return topics, metadata, first, last


def main():
    path = sys.argv[-1]
    with open(path, "rb") as file:
        found = check(file.read())
    if sys.argv[1] == "--package":
        assert by_package(path) == (found["topics"], found["metadata"], found["first"],
                                    found["last"]), "the package mcap reads otherwise"
    print(json.dumps(found))


main()
