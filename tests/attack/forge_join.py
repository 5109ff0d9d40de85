#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""
Forge a join by someone who knows incise-recording(5): change one value of its tables and recompute
their checksum, with SQLite alone.

    forge_join.py NAME.rec SEED

Prints what was changed.
"""
import random
import sqlite3
import sys

from forgeries import crc32c

COLUMNS = {
    "members": ("name", "host", "method", "matches", "agreement_ns", "agreement_bound_ns"),
    "maps": ("t_ns", "session_ns", "bound_ns"),
}
SEALED = (
    "SELECT key, value FROM session WHERE key <> 'seal' ORDER BY key",
    "SELECT member, name, host, method, ledger, matches, agreement_ns, agreement_bound_ns "
    "FROM members ORDER BY member",
    "SELECT member, knot, t_ns, session_ns, bound_ns FROM maps ORDER BY member, knot",
)


def main():
    path, seed = sys.argv[1:]
    chance = random.Random(int(seed))
    db = sqlite3.connect(path + "/recording.db")
    table = chance.choice(list(COLUMNS))
    column = chance.choice(COLUMNS[table])
    key = chance.choice(db.execute(
        f"SELECT {'member' if table == 'members' else 'member, knot'} FROM {table}").fetchall())
    where = "member = ?" + (" AND knot = ?" if len(key) == 2 else "")
    value, = db.execute(f"SELECT {column} FROM {table} WHERE {where}", key).fetchone()
    if isinstance(value, str):
        new = value + chance.choice("xyz")
    elif value is None:
        new = chance.uniform(0, 1e6)
    else:
        new = type(value)(value + chance.choice((-1, 1)) * chance.randint(1, 1000))
    db.execute(f"UPDATE {table} SET {column} = ? WHERE {where}", (new, *key))
    crc = 0
    for query in SEALED:
        names = [name for name, *_ in db.execute(query).description]
        texts = ", ".join(f"CAST({name} AS TEXT)" for name in names)
        for row in db.execute(f"SELECT {texts} FROM ({query})"):
            for text in row:
                crc = crc32c(crc, (text or "").encode() + b"\0")
    db.execute("UPDATE session SET value = ? WHERE key = 'seal'", (crc,))
    db.commit()
    print(f"{table}.{column} of {key}: {value} -> {new}")


if __name__ == "__main__":
    main()
