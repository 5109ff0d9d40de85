#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A recording of an hour that is made up: what the virtual rig makes in a minute, again and
# again, with force at 10 kHz and a tracker at 240 Hz (twice the rig's). For measuring the
# export, by hand; with pictures at 60 Hz where "camera" is said:
#
#     tests/bench/hour.sh BUILD hour.rec [camera]
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
INSERT INTO tracker
	SELECT i * 7200 + seq, 1000000000 + (i * 7200 + seq) * 12500000 / 3,
	1004200000 + (i * 7200 + seq) * 12500000 / 3, x_mm, y_mm, z_mm, qw, qx, qy, qz, status,
	station, button FROM h CROSS JOIN t;
INSERT INTO depth SELECT i * 7200 + seq, 1000000000 + (i * 7200 + seq) * 12500000 / 3,
	depth_mm, 2 * velocity_mm_s FROM h CROSS JOIN d;
DELETE FROM ledger;
DELETE FROM frames;
DELETE FROM streams;
DELETE FROM knots;
INSERT INTO streams(name, device, stamped, nominal_hz, delay_ns, grain_ns, rows, lost, late,
	offset_sd_ns) VALUES ('force', 'made up', 1, 1e4, 0, 0, 36000000, 0, 0, 1e3),
	('tracker', 'made up', 0, 240, 4200000, 0, 864000, 0, 0, 1e5);
INSERT INTO knots SELECT 'tracker', i, i * 14400, 1000000000 + i * 60000000000, 1e5, i = 0
	FROM m;
UPDATE meta SET value = 36000000 WHERE key = 'force_rows';
UPDATE meta SET value = 864000 WHERE key IN ('tracker_rows', 'depth_rows');
UPDATE meta SET value = 240.0 WHERE key = 'tracker_hz';
SQL
[ "${3-}" != camera ] || sqlite3 "$rec/recording.db" <<'SQL'
PRAGMA journal_mode=OFF;
INSERT INTO streams(name, device, stamped, nominal_hz, delay_ns, grain_ns, rows, lost, late,
	offset_sd_ns) VALUES ('camera', 'made up', 1, 60, 2000000, 0, 216000, 0, 0, 1e5);
INSERT INTO frames WITH RECURSIVE f(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM f
	WHERE i < 215999) SELECT i, 1000000000 + i * 50000000 / 3,
	1002000000 + i * 50000000 / 3, i * 50 / 3, 30000, 0, 200 + 100 * sin(i / 10.0), 0.05,
	11.875 * (1 + sin(i / 10.0)), 0.9, zeroblob(32) FROM f;
SQL
du -sh "$rec"
