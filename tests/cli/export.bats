# SPDX-License-Identifier: GPL-2.0-or-later
# incise export, as a user meets it.

load cli

setup_file() {
	cd "$BATS_FILE_TMPDIR"
	incise capture -o liver.rec \
		--rig sim:clock=simulated,cut_s=2,pause_s=1 >/dev/null
}

setup() {
	work_folder
	ln -s "$BATS_FILE_TMPDIR/liver.rec" liver.rec
}

# Every line has so many fields, all but the first column's numbers that are finite.
well_formed() {
	awk -F, -v fields="$2" -v from="$3" '
		NF != fields { print "line " NR ": " $0; bad = 1 }
		NR > 1 { for (i = from; i <= NF; i++)
			if ($i !~ /^-?[0-9.]+(e[-+][0-9]+)?$/) { print "line " NR ": " $i; bad = 1 } }
		END { exit bad || NR < 2 }' "$1"
}

@test "export of what is not as it was recorded needs --damaged, and says what is wrong" {
	cp -r liver.rec/ altered.rec
	sqlite3 altered.rec/recording.db "UPDATE force SET code = code + 1 WHERE seq = 12345"
	fails incise export liver.rec altered.rec -o a.csv -- "altered.rec:" "force:"
	[[ "$stderr" == *"; 'incise verify altered.rec' lists all; --damaged uses it as it is" ]]
	[ ! -e a.csv ]
	run -0 --separate-stderr incise export --no-lineage liver.rec altered.rec -o a.csv --damaged
	[[ "$stderr" == "incise export: warning: altered.rec: not as it was recorded: force: "* ]]
	[ -s a.csv ]
	# what no block holds, and what is sealed
	sqlite3 altered.rec/recording.db "UPDATE force SET code = code - 1 WHERE seq = 12345;
		UPDATE events SET text = 'another' WHERE kind = 'start'"
	fails incise export altered.rec -o b.csv -- "altered.rec:" "table events"
	[ ! -e b.csv ]
}

# bats test_tags=check
@test "export raw at a rate, to standard output" {
	run -0 --separate-stderr incise export --no-lineage liver.rec --rate 100
	[ -z "$stderr" ]
	[ "${lines[0]}" = cut,t_s,depth_mm,velocity_mm_s,force_N,clipped,advancing,acceleration_mm_s2,tilt_deg,time_in_tissue_s,mean_speed_mm_s,deepest_mm,way_mm ]
	[[ "${lines[1]}" == liver-01,* ]]
	printf '%s\n' "${lines[@]}" >out.csv
	well_formed out.csv 13 2
	[ "$(cut -d, -f1 out.csv | sort -u | grep -c liver-)" -eq 14 ]
	# 14 cuts of not quite 2 s at 100 rows a second
	[ "${#lines[@]}" -gt 1400 ]
	[ "${#lines[@]}" -lt 2900 ]
}

# bats test_tags=check
@test "export of a part: its rows are those of the whole, and its lineage says which" {
	incise export --no-lineage liver.rec -o whole.csv
	run -0 incise export --no-lineage --range 10s..12.5s liver.rec -o part.csv
	awk -F, 'NR == 1 || ($2 >= 10 && $2 < 12.5)' whole.csv | cmp - part.csv
	incise export --cut 3 liver.rec -o cut.csv
	grep -qx "# part: from 0 s, cut 3" cut.csv
	cmp <(awk -F, 'NR == 1 || $1 == "liver-03"' whole.csv) <(grep -v "^#" cut.csv)
	incise export --no-lineage --resample --rate 100 liver.rec -o whole.csv --overwrite
	incise export --no-lineage --resample --rate 100 --range 10s..12.5s liver.rec -o part.csv --overwrite
	# but the noise that was read
	cmp <(awk -F, 'NR == 1 || ($3 >= 10 && $3 < 12.5)' whole.csv | cut -d, -f1-17,19-) \
		<(cut -d, -f1-17,19- part.csv)
	incise export --range 10s..12.5s liver.rec -o part.mcap
	[ "$(stat -c %s part.mcap)" -lt 4000000 ]
	fails incise export --cut 99 liver.rec -- "liver.rec:" "no cut 99"
	run --separate-stderr incise export --range 12s..10s liver.rec
	bad_usage "--range: it ends at 10 s, where it begins or before"
	misused incise export --cut 1 --resample liver.rec -- "--cut"
	# what is not asked for is not read
	cp -r liver.rec/ damaged.rec
	sqlite3 damaged.rec/recording.db "UPDATE blocks SET data = x'00' WHERE stream = 'force' AND block = 30"
	run -0 incise export --range 10s..12.5s damaged.rec -o /dev/null
	run --separate-stderr incise export --range 2s..4s damaged.rec -o other.csv
	failed_with "damaged.rec: damaged: stream force, block 30"
	[ ! -e other.csv ]
}

# bats test_tags=check
@test "export averaged by cut" {
	incise export --no-lineage liver.rec -a 12x10,by-cut -o a.csv
	[ "$(head -n 1 a.csv)" = cut,depth_mm,velocity_mm_s,force_N,sd_N,count,cuts,advancing,acceleration_mm_s2,tilt_deg,time_in_tissue_s,mean_speed_mm_s,deepest_mm ]
	well_formed a.csv 13 2
	[ "$(tail -n +2 a.csv | cut -d, -f1 | uniq | wc -l)" -eq 14 ]
}

@test "export keeps to the upper ends of the bins" {
	incise export --no-lineage liver.rec -a 5x5,depth=8,velocity=30 -o a.csv
	awk -F, 'NR > 1 && ($1 > 8 || $2 > 30) { bad = 1 } END { exit bad }' a.csv
}

@test "export --average N,count= leaves out what is thin" {
	incise export --no-lineage liver.rec -a 12x10,count=2000 -o a.csv
	awk -F, 'NR > 1 && $5 < 2000 { bad = 1 } END { exit bad }' a.csv
	run --separate-stderr incise export liver.rec -a 12x10,count=999999999 -o b.csv
	failed_with "no bin has 999999999 samples"
	[ ! -e b.csv ]
}

# bats test_tags=check
@test "export reports as JSON" {
	incise export --no-lineage liver.rec -a 12x10 -o a.csv --json >report.json
	[ "$(key report.json path)" = a.csv ]
	[ "$(key report.json rows)" -eq $(($(wc -l <a.csv) - 1)) ]
	[ "$(key report.json cuts)" = 14 ]
	[ "$(key report.json clipped)" = 0 ]
	[ "$(sqlite3 :memory: "SELECT json_extract(readfile('report.json'),
		'\$.depth_max_mm') BETWEEN 19 AND 22")" = 1 ]
	[ "$(sqlite3 :memory: "SELECT json_extract(readfile('report.json'),
		'\$.velocity_max_mm_s') BETWEEN 40 AND 200")" = 1 ]
}

@test "export of an interrupted recording" {
	incise capture -o cut.rec --rig sim:clock=simulated --duration 6s >/dev/null
	mv cut.rec cut.rec.part
	incise export --no-lineage cut.rec -a 3x3 -o a.csv
	well_formed a.csv 12 1
}

# bats test_tags=check
@test "export of what is no recording" {
	echo text >file.rec
	mkdir empty.rec garbage.rec
	seq 10000 >garbage.rec/recording.db
	for path in file.rec empty.rec garbage.rec none.rec; do
		fails incise export $path -o a.csv -- $path
	done
	[ ! -e a.csv ]
}

@test "export killed by a closed pipe is quiet" {
	bash -c "set -o pipefail; incise export liver.rec 2>err | head -n 1" >out || true
	[[ "$(cat out)" == "# incise: "* ]]
	[ ! -s err ]
}

@test "export as HDF5 needs a file and the module" {
	mkdir none
	INCISE_MODULE_PATH=$PWD/none run --separate-stderr incise export liver.rec -o a.h5
	failed_with "no module export_hdf5.so"
	[ ! -e a.h5 ]
	[ -e "$INCISE_BUILD/lib/incise/export_hdf5.so" ] || skip "the module of HDF5 is not built"
	incise export liver.rec --rate 100 -o a.hdf5
	[[ "$(head -c 4 a.hdf5)" == $'\x89HDF' ]]
	ln -s /dev/null null.h5
	fails incise export liver.rec -o null.h5 -- "cannot be written to a pipe"
	(ulimit -f 100; trap '' XFSZ
		fails incise export liver.rec -o small.h5 -- "File too large")
	[ ! -e small.h5 ]
}

@test "export tells where the blade advances, raw, averaged and resampled" {
	# hardly any way along the skin: the surgeon goes in, trembles at the bottom, and comes out
	incise capture -o deep.rec --rig sim:clock=simulated,cut_s=4,speed_mm_s=1,depth_mm=10,times=2
	incise export --no-lineage deep.rec --rate 100 -o raw.csv
	awk -F, 'NR > 1 { if ($1 != cut) { cut = $1; deepest = 0; out = 0 }
			if ($3 > deepest) deepest = $3; out = out || $3 < deepest - 1
			part = out ? "out" : deepest < 8 ? "in" : "bottom"; n[part]++; advancing[part] += $7 }
		END { exit !(n["in"] > 150 && n["out"] > 50 && advancing["in"] > 0.8 * n["in"] &&
			advancing["out"] < 0.05 * n["out"]) }' raw.csv
	incise export --no-lineage deep.rec --rate 100 --resample -o all.csv
	awk -F, 'NR > 1 && $14 == "nan" && $22 { bad = 1 } { n += $22 } END { exit bad || n < 200 }' all.csv
	# the same depths again on the way out, with less force
	incise export --no-lineage deep.rec --average 5x1,velocity=100 -o bins.csv
	awk -F, 'NR > 1 { force[int($1 / 2.1), $7] = $3 }
		END { for (bin = 0; bin < 4; bin++) if (!((bin, 0) in force) || !((bin, 1) in force) ||
				force[bin, 0] >= force[bin, 1]) exit 1 }' bins.csv
}

@test "export by another calibration" {
	echo 'force_mV_N = 2480;' >half.conf
	incise export --no-lineage liver.rec -a 3x3 -o a.csv
	incise export --no-lineage liver.rec -a 3x3 -c half.conf -o b.csv
	paste -d, a.csv b.csv | awk -F, '
		NR > 1 { d = $3 - 2 * $15; if (d > 1e-7 || d < -1e-7) bad = 1 } END { exit bad || NR < 2 }'
	echo 'force_mV_N = 0;' >bad.conf
	fails incise export liver.rec -c bad.conf -o c.csv -- "bad.conf"
	[ ! -e c.csv ]
}

@test "export tells where data are from, and training reads it" {
	incise export liver.rec -a 12x10 --no-lineage -o plain.csv
	! grep -q '^#' plain.csv
	incise export liver.rec -a 12x10 -o a.csv
	incise export liver.rec -a 12x10 | diff a.csv -
	diff plain.csv <(grep -v '^#' a.csv)
	grep -qx '# source: liver.rec' a.csv
	grep -qE '^# force_mV_N: 1240$' a.csv
	[ -x "$INCISE_BUILD/bin/incise-train" ] || skip "incise train is not built"
	incise train plain.csv -o plain.fis
	incise train a.csv -o a.fis
	[ -s a.fis ]
}

# Read by a reader of our own, and by that of the format's makers where it is there.
read_mcap() {
	if [ -x "$INCISE_BUILD/tests/mcap/check" ]; then
		"$INCISE_BUILD/tests/mcap/check" "$1"
	else
		echo "# the package mcap is not there: read by our own reader alone" >&3
		python3 "$BATS_TEST_DIRNAME/../mcap/check.py" "$1"
	fi
}

@test "export as MCAP" {
	command -v python3 >/dev/null || skip "python3 is not installed"
	incise capture -o short.rec --rig sim:clock=simulated --duration 6s >/dev/null
	sqlite3 short.rec/recording.db "INSERT INTO events VALUES (2000000000, 'note',
		'\"quoted\" \\ ' || char(10) || ' é ' || CAST(x'ff' AS TEXT))"
	# the line puts no record before the first force sample
	sqlite3 short.rec/recording.db "UPDATE knots SET t_ns = t_ns + 1000000"
	run -0 --separate-stderr incise export short.rec -o short.mcap --damaged
	[ "${#stderr_lines[@]}" -eq 1 ]
	[[ "$output" == "wrote short.mcap: "*" messages" ]]
	read_mcap short.mcap >found.json
	for table in force tracker depth events; do
		[ "$(sqlite3 :memory: "SELECT json_extract(readfile('found.json'),
			'\$.topics.\"/$table\"')")" = \
			"$(sqlite3 short.rec/recording.db "SELECT count(*) FROM $table")" ]
	done
	[ "$(key found.json metadata.incise.source)" = short.rec ]
	[ "$(key found.json chunks)" -ge 2 ]
	code=$(sqlite3 short.rec/recording.db "SELECT code FROM force ORDER BY seq LIMIT 1")
	[ "$(key found.json 'first[2].code')" = "$code" ]
	sqlite3 :memory: "SELECT abs(json_extract(readfile('found.json'), '\$.first[2].force_N')
		- ($code * 5000.0 / 4096 - $(sqlite3 short.rec/recording.db "SELECT value FROM meta
		WHERE key = 'force_zero_mV'")) / 1240) < 6e-6" | grep -qx 1
}

# bats test_tags=check
@test "export as MCAP takes one recording as it is" {
	for arguments in "liver.rec liver.rec" "liver.rec --rate 100" "liver.rec -a 3x3"; do
		# shellcheck disable=SC2086
		fails incise export $arguments -o a.mcap -- "a.mcap:"
		[ ! -e a.mcap ]
	done
	ln -s /dev/full full.mcap
	fails incise export liver.rec -o full.mcap -- "No space left"
}

@test "export as messages of ROS 2: the values of a CSV, read by rosbags" {
	command -v python3 >/dev/null || skip "python3 is not installed"
	incise capture -o c.rec --rig sim:clock=simulated,camera_hz=5 --camera frames \
		--duration 2s >/dev/null
	# a tip away from the tracked point, and one pose that no one may use
	sqlite3 c.rec/recording.db "UPDATE meta SET value = 3.0 WHERE key = 'tip_x_mm'"
	incise export --no-lineage c.rec -o c.csv --resample --damaged
	sqlite3 c.rec/recording.db "UPDATE tracker SET status = 'A' WHERE seq = 238"
	run -0 --separate-stderr incise export c.rec -o c.mcap --profile ros2 --damaged
	rows() { sqlite3 c.rec/recording.db "SELECT count(*) FROM $1"; }
	[ "$output" = "wrote c.mcap: $(($(rows force) + $(rows tracker) - 1 + $(rows events) +
		$(rows frames))) messages" ]
	read_mcap c.mcap >found.json
	[ "$(key found.json profile)" = ros2 ]
	[ "$(key found.json 'topics."/tip"')" = $(($(rows tracker) - 1)) ]
	[ "$(key found.json 'metadata."incise.wall".uncertainty_s')" = 1 ]
	[[ "$(key found.json 'metadata.rosbag2.serialized_metadata')" == "{version: 5, "*"/tip"* ]]
	started=$(date -d "$(sqlite3 c.rec/recording.db "SELECT value FROM meta
		WHERE key = 'started'")" +%s)
	[ "$(key found.json 'metadata."incise.wall".offset_ns')" = $((started * 1000000000 -
		$(sqlite3 c.rec/recording.db "SELECT t_ns FROM events WHERE kind = 'start'"))) ]
	[ -x "$INCISE_BUILD/tests/mcap/ros2" ] || skip "the package rosbags is not there"
	"$INCISE_BUILD/tests/mcap/ros2" c.mcap c.csv >ros2.json
	[ "$(key ros2.json 'topics."/force"')" = '["geometry_msgs/msg/WrenchStamped",20000]' ]
	[ "$(key ros2.json 'topics."/camera/image"[0]')" = sensor_msgs/msg/Image ]
	[ "$(key ros2.json frame)" = '[480,640,"rgb8",1920,921600]' ]
	[ "$(key ros2.json 'events[0]')" = '["start","recording started"]' ]
	[ "$(key ros2.json compared)" -gt 19000 ]
}

@test "export as messages of ROS 2 needs a time that ROS can have" {
	cp -r liver.rec/ late.rec
	sqlite3 late.rec/recording.db "UPDATE meta SET value = '2039-01-01T00:00:00Z'
		WHERE key = 'started'"
	run --separate-stderr incise export late.rec --damaged --profile ros2 -o a.mcap
	[ "$status" -eq 1 ]
	[[ "$stderr" == *"late.rec: started at '2039-01-01T00:00:00Z', but times of ROS lie between 1970 and 2038;"* ]]
	[ ! -e a.mcap ]
}

@test "export resampled with pictures" {
	cp -r liver.rec/ seen.rec
	sqlite3 seen.rec/recording.db "DELETE FROM knots;
		INSERT INTO frames SELECT seq, t_ns, t_ns, 0, 1, 0, 100.0, 0.5, depth_mm, 0.9, zeroblob(32) FROM depth"
	incise export --no-lineage seen.rec liver.rec --resample --rate 50 -o a.csv --damaged
	[[ "$(head -n 1 a.csv)" == *,tracker_error,advancing,acceleration_mm_s2,tilt_deg,time_in_tissue_s,mean_speed_mm_s,deepest_mm,camera_depth_mm,camera_depth_sd_mm,camera_depth_u_mm,quality,low_quality ]]
	# by the pictures as by the tracker; and none of what has no pictures
	awk -F, 'NR > 1 && $1 == "seen" && $14 != "nan" { n++; if ($14 != $28 || $32) bad = 1 }
		NR > 1 && $1 == "liver" && ($28 != "nan" || !$32) { bad = 1 }
		END { exit bad || n < 2100 }' a.csv
	echo 'depth_mm_px = 0.2375;' >twice.conf
	incise export seen.rec --resample --rate 50 -c twice.conf -o b.csv --damaged
	awk -F, 'FNR > 1 && /^seen/ && $14 != "nan" { n++; d = $28 - 2 * $14; if (d > 2e-4 || d < -2e-4) bad = 1 }
		END { exit bad || n < 2100 }' b.csv
	grep -qx '# depth_mm_px: 0.2375' b.csv
}

@test "export as HDF5 is what h5py reads" {
	[ -e "$INCISE_BUILD/lib/incise/export_hdf5.so" ] || skip "the module of HDF5 is not built"
	for python in python3 /usr/bin/python3; do
		$python -c 'import h5py' 2>/dev/null && break
		python=
	done
	[ "$python" ] || skip "python3-h5py is not installed"
	incise export liver.rec --resample --rate 1000 -o a.h5
	incise export --no-lineage liver.rec --resample --rate 1000 -o a.csv
	$python - <<-'END'
		import csv, h5py, math
		rows = list(csv.DictReader(open("a.csv")))
		with h5py.File("a.h5") as file:
		    assert file["recording_names"][0] == b"liver"
		    assert file.attrs["source"] in ("liver.rec", b"liver.rec")
		    # three chunks, the last of them cut short
		    assert len(rows) == 43000
		    for name in rows[0]:
		        column = file[name][:]
		        assert len(column) == len(rows), name
		        assert file[name].attrs["units"]
		        if name == "recording":
		            assert set(column) == {1}
		            continue
		        for value, row in zip(column, rows):
		            text = float(row[name])
		            # float32, and half of the last digit
		            half = {"velocity_mm_s": 5.1e-4, "mean_speed_mm_s": 5.1e-4, "acceleration_mm_s2": 5.1e-2, "tilt_deg": 5.1e-3,
		                    "time_in_tissue_s": 5.1e-5}.get(name, 5.1e-5 * name.endswith("_mm"))
		            assert math.isnan(value) and math.isnan(text) or abs(
		                value - text) < 2e-5 + half + 1e-6 * abs(text), (name, value, text)
	END
}

# A calibration with a covariance of the tip, and all else stated.
calibrated() {
	cat >c.conf <<-'END'
		force_mV_N = 1230.0; tip_mm = [1.0, 0.0, -20.0]; surface_u_mm = 0.05;
		force_delay_ms = 0.0; force_delay_sd_ms = 0.02;
		tracker_delay_ms = 4.2; tracker_delay_sd_ms = 0.1;
		history = (
		{ kind = "force"; date = "2026-11-20T10:00:00Z"; pass = true;
		  values = ( { key = "force_mV_N"; left = 1230.0; u = 1.5; } ); },
		{ kind = "tip"; date = "2026-11-20T10:00:00Z"; pass = true; values = (
		  { key = "tip_x_mm"; left = 1.0; u = 0.03; }, { key = "tip_y_mm"; left = 0.0; u = 0.02; },
		  { key = "tip_z_mm"; left = -20.0; u = 0.04; } );
		  covariance = [ 9e-4, 3e-4, 4e-4, -2e-4, 1e-4, 16e-4 ]; },
		{ kind = "delay"; date = "2026-11-20T10:00:00Z"; pass = true; method = "against the force";
		  values = ( { key = "tracker_delay_ms"; left = 4.2; u = 0.1; } ); } );
	END
	incise capture -o calibrated.rec -c c.conf \
		--rig sim:clock=simulated,cut_s=2,pause_s=1,tip_x_mm=1,tip_z_mm=-20 --duration 8s >/dev/null
}

@test "export with uncertainties: parts add up, and the rest stays as it is" {
	calibrated
	for how in "" "--rate 50" "--average 3x3,by-cut" "--resample --rate 50"; do
		incise export --no-lineage calibrated.rec $how -o none.csv --overwrite
		incise export --no-lineage calibrated.rec $how --uncertainty none -o same.csv --overwrite
		cmp none.csv same.csv
		incise export --no-lineage calibrated.rec $how --uncertainty total -o total.csv --overwrite
		incise export --no-lineage calibrated.rec $how --uncertainty parts -o parts.csv --overwrite
		python3 - "$how" <<-'END'
			import csv, math, sys
			none, total, parts = (list(csv.DictReader(open(f))) for f in ("none.csv", "total.csv", "parts.csv"))
			assert len(none) == len(total) == len(parts) > 15, sys.argv
			totals = {"force_u_": "N", "depth_u_": "mm", "velocity_u_": "mm_s", "t_u_": "s"}
			seen = 0
			for a, b, c in zip(none, total, parts):
			    for name in a:
			        assert a[name] == b[name] == c[name] or "_u_" in name, name
			    for start, unit in totals.items():
			        whole = start + unit
			        own = [k for k in c if k.startswith(start) and k != whole]
			        if whole not in b or "nan" in (b[whole], c[whole]):
			            continue
			        assert b[whole] == c[whole]
			        squares = sum(float(c[k]) ** 2 for k in own)
			        # 12 bits of each and of the total, and seven decimals
			        assert abs(math.sqrt(squares) - float(c[whole])) < 5e-4 * float(c[whole]) + 3e-7, (whole, c)
			        seen += float(c[whole]) > 0
			assert seen > 2 * len(none), seen
		END
	done
}

# bats test_tags=check
@test "export names the calibration that an uncertainty lacks" {
	run -0 --separate-stderr incise export --no-lineage liver.rec --rate 10 --uncertainty total -o a.csv --json
	line="incise export: warning: not stated, and nan: the uncertainty of"
	[[ "${stderr_lines[0]}" == "$line force: the sensitivity "*"incise calibrate force"* ]]
	[[ "${stderr_lines[1]}" == "$line depth: "*"surface_u_mm"* ]]
	[[ "${stderr_lines[2]}" == "$line velocity: "*"incise calibrate delay"* ]]
	[[ "${stderr_lines[3]}" == "$line time: "*"force_delay_sd_ms"* ]]
	[ "${#stderr_lines[@]}" -eq 4 ]
	# a reason that two share is said of both
	cp -r liver.rec/ two.rec
	run -0 --separate-stderr incise export --no-lineage liver.rec two.rec --rate 10 --uncertainty total -o b.csv
	[ "$(grep -c 'calibrate tip' <<<"$stderr")" -eq 2 ]
	[ "${#stderr_lines[@]}" -eq 4 ]
	run -0 --separate-stderr incise export --no-lineage liver.rec --rate 10 --uncertainty total -o a.csv --json --overwrite
	sqlite3 :memory: "SELECT json_extract('$(sed "s/'/''/g" <<<"$output")', '\$.unstated[1]')" | grep -q 'calibrate tip'
	awk -F, 'NR > 1 && ($14 != "nan" || $15 != "nan") { bad = 1 } END { exit bad || NR < 2 }' a.csv
}

@test "export of MCAP and HDF5 names uncertainties in the style of CF" {
	calibrated
	incise export calibrated.rec --uncertainty parts -o a.mcap
	grep -qa 'incise.uncertainty_variables' a.mcap
	grep -qa '"force_u_N":0.00[0-9]*,"force_u_gain_N":-\?0.0' a.mcap
	grep -qa '"depth_u_surface_mm":0.05' a.mcap
	grep -qa 'calibration_covariance.*tip_x_mm tip_y_mm 0.0003' a.mcap
	[ -e "$INCISE_BUILD/lib/incise/export_hdf5.so" ] || skip "the module of HDF5 is not built"
	/usr/bin/python3 -c 'import h5py' 2>/dev/null || skip "python3-h5py is not installed"
	incise export calibrated.rec --uncertainty parts --rate 100 -o a.h5
	/usr/bin/python3 - <<-'END'
		import h5py
		with h5py.File("a.h5") as file:
		    text = lambda at, key: at.attrs[key].decode() if isinstance(at.attrs[key], bytes) else at.attrs[key]
		    names = text(file["force_N"], "uncertainty_variables")
		    assert names == "force_u_N force_u_gain_N force_u_zero_N force_u_resolution_N force_u_noise_N", names
		    assert text(file["force_N"], "ancillary_variables") == names
		    for name in names.split():
		        assert text(file[name], "uncertainty_of") == "force_N" and text(file[name], "units") == "N"
		    assert text(file["depth_u_surface_mm"], "correlation") == "common to recordings with this calibration"
		    assert text(file["depth_u_noise_mm"], "correlation") == "independent"
		    assert "tip_x_mm tip_y_mm 0.0003" in text(file, "calibration_covariance")
		    assert "surface_mm 0.05 mm" in text(file, "calibration_u")
	END
}

@test "the camera's depth between frames is within what is stated, and a wrong scale is warned of" {
	printf '%s\n' 'clock = "simulated"; tracker = "sim:"; force = "sim:"; camera = "sim:";' \
		'sim = { depth_mm = [5.0, 12.0]; times = [1, 1]; camera_hz = 200.0; force_hz = 1000.0; };' >cam.conf
	incise capture -o all.rec -r cam.conf -c none --camera depth >/dev/null
	incise export --no-lineage all.rec --resample --rate 500 -o all.csv >/dev/null
	# every fourth and eighth frame, at 50 and 25 Hz, against all
	for k in 4 8; do
		rm -rf some.rec
		cp -r all.rec some.rec
		sqlite3 some.rec/recording.db "DELETE FROM frames WHERE seq % $k"
		incise export --no-lineage some.rec --resample --rate 500 --damaged --overwrite -o some.csv >/dev/null 2>&1
		/usr/bin/python3 - <<-'END'
			import csv, math
			rows = [list(csv.DictReader(line for line in open(name) if line[0] != "#"))
			        for name in ("all.csv", "some.csv")]
			n = held = 0
			for true, row in zip(*rows, strict=True):
			    off = float(row["camera_depth_mm"]) - float(true["camera_depth_mm"])
			    u = float(row["camera_depth_u_mm"])
			    if not math.isnan(off + u):
			        n, held = n + 1, held + (abs(off) <= 1.96 * u)
			assert n > 5000 and held > 0.95 * n, (n, held)
		END
	done
	echo 'depth_mm_px = 0.07;' >other.conf
	run -0 --separate-stderr incise export --no-lineage all.rec --resample --rate 100 -o x.csv
	[ -z "$stderr" ]
	incise capture -o off.rec -r cam.conf -c other.conf --camera depth --duration 9s >/dev/null
	run -0 --separate-stderr incise export --no-lineage off.rec --resample --rate 100 -o y.csv
	[[ "$stderr" == *"warning: the camera's depths are 0."*" times the tracker's"* ]] || complain "$stderr"
}
