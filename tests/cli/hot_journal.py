#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""A copy of a closed recording as one that was killed while it gave up its log: with a hot journal.

  hot_journal.py CLOSED.rec NEW.rec [FILE]

With FILE the journal ends in its name, as that of a "super-journal": SQLite removes the file that it names
once it has played the journal.
"""
import os
import shutil
import sqlite3
import struct
import sys

closed, new = sys.argv[1:3]
shutil.copytree(closed, new + ".work")
database = sqlite3.connect(new + ".work/recording.db", isolation_level=None)
# So little room that changed pages come to the file before the commit.
database.execute("PRAGMA cache_size = 5")
page_bytes = database.execute("PRAGMA page_size").fetchone()[0]
database.execute("BEGIN IMMEDIATE")
database.execute("UPDATE blocks SET data = zeroblob(length(data))")
shutil.copytree(new + ".work", new)
database.execute("ROLLBACK")
database.close()
shutil.rmtree(new + ".work")
if len(sys.argv) > 3:
    name = os.path.abspath(sys.argv[3]).encode()
    total = sum(byte if byte < 128 else byte - 256 for byte in name) & 0xFFFFFFFF
    with open(new + "/recording.db-journal", "ab") as journal:
        journal.write(struct.pack(">I", 0x40000000 // page_bytes + 1) + name)
        journal.write(struct.pack(">II", len(name), total) + bytes.fromhex("d9d505f920a163d7"))
