# SPDX-License-Identifier: GPL-2.0-or-later
# incise replay, as a user meets it.

load cli

quick=sim:clock=simulated,depth_mm=10,times=1,pause_s=0.1,cut_s=4

setup_file() {
	cd "$BATS_FILE_TMPDIR"
	made_pairs >pairs.csv
	incise train pairs.csv -o liver.fis 2>/dev/null
	incise capture -o liver.rec --rig $quick --duration 3s >/dev/null
}

setup() {
	work_folder
	cp "$BATS_FILE_TMPDIR/liver.fis" .
	cp -r "$BATS_FILE_TMPDIR/liver.rec" .
	smooth_liver
}

teardown() {
	[ -z "$pid" ] || kill -9 "$pid" 2>/dev/null || :
}

# bats test_tags=check
@test "replay reports" {
	run -0 --separate-stderr incise replay liver.rec liver.scene
	[ -z "$stderr" ]
	[[ "${lines[0]}" =~ ^liver.rec:\ 3.0\ s,\ 2999\ ticks\ at\ 1000\ Hz,\ 3[56][0-9]\ poses,\ 1\ cut$ ]]
	[[ "${lines[1]}" == "predicted  error 0."*" N rms ("*" % of the range), at most "* ]]
	[[ "${lines[-1]}" =~ ^crc32c\ +[0-9a-f]{8}$ ]]
	[[ "$output" != *lateness* ]]
}

@test "forces are the same from run to run and at both speeds" {
	incise replay liver.rec liver.scene -o a.csv | grep ^crc32c >a
	incise replay liver.rec liver.scene -o b.csv | grep ^crc32c >b
	incise replay liver.rec liver.scene -o c.csv --real-time >report
	grep ^crc32c report >c
	cmp a.csv b.csv
	cmp a.csv c.csv
	cmp a b
	cmp a c
	grep -q '^lateness ' report
	grep -q '^late ' report
	# and others where they must be
	incise replay liver.rec liver.scene --arith double | grep ^crc32c >d
	run ! cmp -s a d
	incise replay liver.rec liver.scene --poses acquisition | tail -n 1 >e
	run ! cmp -s a e
}

@test "real time takes the recording's time" {
	start=$(uptime_ms)
	incise replay liver.rec liver.scene --real-time >/dev/null
	[ $(($(uptime_ms) - start)) -ge 2980 ]
}

@test "the report has the largest force along the normal, and a texture that is left out" {
	incise replay liver.rec "$root/scenes/liver.scene" --model liver.fis -o t.csv >out
	most=$(awk -F, 'NR > 1 { f = $5 < 0 ? -$5 : $5; if (f > m) m = f } END { printf "%.3f", m }' t.csv)
	grep -q "^force      largest [0-9.]* N\( (limit)\)\?, along the normal $most N, " out
	grep -qx "texture    its texture is of the scene's own model" out
	run -0 incise replay liver.rec liver.scene
	[[ "$output" != *texture* ]]
	incise haptic "$root/scenes/liver.scene" --model liver.fis --rig sim:clock=simulated --duration 0.1s >out
	grep -qx "texture    its texture is of the scene's own model" out
}

# bats test_tags=check
@test "the table has every tick, and the report is the table's" {
	incise replay liver.rec liver.scene -o t.csv --json >r.json
	[ "$(head -n 1 t.csv)" = \
		t_s,cut,depth_mm,velocity_mm_s,predicted_N,measured_N,clipped,flags ]
	[ "$(key r.json ticks)" = "$(($(wc -l <t.csv) - 1))" ]
	awk -F, 'NR > 2 && ($1 - last - 0.001) ^ 2 > 1e-12 { exit 1 } { last = $1 }' t.csv
	read -r n rms most range < <(awk -F, 'NR > 1 && $2 && !$7 && $6 != "nan" {
			e = $5 - $6; s += e * e; if (e < 0) e = -e; if (e > m) m = e
			if (!n || $6 < a) a = $6; if (!n || $6 > b) b = $6; n++ }
		END { print n, sqrt(s / n), m, b - a }' t.csv)
	[ "$(key r.json compared)" = "$n" ]
	# six decimals in the table
	holds "($(key r.json rms_error_N) - $rms)^2 < 1e-12"
	holds "($(key r.json max_error_N) - $most)^2 < 1e-11"
	holds "($(key r.json rms_error_relative) - $rms / $range)^2 < 1e-11"
	[ "$(key r.json flags.contact)" = "$(cut -d, -f8 t.csv | grep -c ^c)" ]
	[ "$(key r.json flags.starting)" = "$(cut -d, -f8 t.csv | grep -c '^........r')" ]
	[ "$(key r.json cuts)" = 1 ]
	[ "$(key r.json tracker_hz)" = 120.0 ]
	[ "$(key r.json tracker_latency_ms)" = 4.2 ]
	[ "$(key r.json crc32c)" = "$(incise replay liver.rec liver.scene | awk 'END { print $2 }')" ]
	[ -z "$(key r.json late)" ]
	[ -z "$(key r.json lateness_us)" ]
	incise replay liver.rec liver.scene --real-time --json >r.json
	holds "$(key r.json late) >= 0"
	holds "$(key r.json lateness_us.max) > 0"
}

@test "a picture of it" {
	command -v gnuplot >/dev/null || skip "gnuplot is not installed"
	incise replay liver.rec liver.scene -o pictures/liver.png >/dev/null
	[ "$(head -c 8 pictures/liver.png | od -An -tx1 | tr -d ' ')" = 89504e470d0a1a0a ]
	grep -q '<svg' pictures/liver.svg
	# all ticks of a short one
	[ "$(wc -l <pictures/plot/liver.dat)" -eq 2999 ]
}

@test "an interrupted recording is replayed" {
	mv liver.rec crash.rec.part
	run -0 incise replay crash.rec liver.scene
	[[ "$output" == *"2999 ticks"* ]]
}

@test "a signal ends it, and leaves an older file as it was" {
	echo old >t.csv
	# a minute that is made in a moment: it does not end before the signal
	incise capture -o minute.rec --rig sim:clock=simulated,force_hz=100 --duration 60s >/dev/null
	incise replay minute.rec liver.scene --real-time -o t.csv --overwrite >out 2>err &
	pid=$!
	until_it_catches $pid incise-replay 2
	kill -INT $pid
	status=0
	wait $pid || status=$?
	pid=
	[ "$status" -eq 1 ]
	grep -q '^incise replay: minute.rec: interrupted .* nothing was written$' err
	[ "$(cat t.csv)" = old ]
	[ ! -s out ]
	[ -z "$(find . -name '.*.csv*')" ]
}

# bats test_tags=check
@test "what cannot be replayed" {
	fails incise replay none.rec liver.scene -o t.csv -- none.rec "no such recording"
	fails incise replay liver.rec none.scene -o t.csv -- none.scene
	fails incise replay liver.rec liver.scene -o no/folder/t.csv -- no/folder
	sqlite3 liver.rec/recording.db "UPDATE tracker SET x_mm = 9e999 WHERE seq = 100"
	run --separate-stderr incise replay liver.rec liver.scene -o t.csv
	failed_with liver.rec "damaged" "stream tracker, block 8"
	[ ! -e t.csv ]
	sqlite3 liver.rec/recording.db "DELETE FROM tracker;
		UPDATE meta SET value = 0 WHERE key = 'tracker_rows'"
	fails incise replay liver.rec liver.scene -- "no pose"
}
