#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A recording of an hour that is made up: what the virtual rig makes in a minute, again and
# again, with force at 10 kHz and a tracker at 240 Hz (twice the rig's). For measuring the
# export, by hand:
#
#     tests/bench/hour.sh BUILD hour.rec
#     /usr/bin/time -v BUILD/bin/incise export hour.rec -o hour.h5
set -eu
build=$1 rec=$2
"$build/bin/incise" capture -o "$rec" --rig sim:clock=simulated >/dev/null
sqlite3 "$rec/recording.db" <<'SQL'
PRAGMA journal_mode=OFF;
PRAGMA synchronous=OFF;
PRAGMA temp_store=MEMORY;
CREATE TEMP TABLE f AS SELECT seq, code FROM force WHERE seq < 600000 ORDER BY seq;
CREATE TEMP TABLE t AS SELECT * FROM tracker WHERE seq < 7200 ORDER BY seq;
CREATE TEMP TABLE d AS SELECT * FROM depth WHERE seq < 7200 ORDER BY seq;
DELETE FROM force;
DELETE FROM tracker;
DELETE FROM depth;
CREATE TEMP TABLE m AS WITH RECURSIVE m(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM m
	WHERE i < 59) SELECT i FROM m;
CREATE TEMP TABLE h AS WITH RECURSIVE h(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM h
	WHERE i < 119) SELECT i FROM h;
INSERT INTO force SELECT i * 600000 + seq, 1000000000 + (i * 600000 + seq) * 100000, code
	FROM m CROSS JOIN f;
INSERT INTO tracker(seq, t_ns, arrival_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz, status)
	SELECT i * 7200 + seq, 1000000000 + (i * 7200 + seq) * 12500000 / 3,
	1004200000 + (i * 7200 + seq) * 12500000 / 3, x_mm, y_mm, z_mm, qw, qx, qy, qz, status
	FROM h CROSS JOIN t;
INSERT INTO depth SELECT i * 7200 + seq, 1000000000 + (i * 7200 + seq) * 12500000 / 3,
	depth_mm, 2 * velocity_mm_s FROM h CROSS JOIN d;
UPDATE meta SET value = 36000000 WHERE key = 'force_rows';
UPDATE meta SET value = 864000 WHERE key IN ('tracker_rows', 'depth_rows');
UPDATE meta SET value = 240.0 WHERE key = 'tracker_hz';
SQL
du -sh "$rec"
