# SPDX-License-Identifier: GPL-2.0-or-later
# incise plot: each kind of file, by its content; the forms of a figure; what is refused.

load cli

setup_file() {
	made_pairs >"$BATS_FILE_TMPDIR/pairs.csv"
	incise train "$BATS_FILE_TMPDIR/pairs.csv" -o "$BATS_FILE_TMPDIR/m.fis" >/dev/null 2>&1
	incise compile "$BATS_FILE_TMPDIR/m.fis" -o "$BATS_FILE_TMPDIR/m.fx" >/dev/null
}

setup() {
	command -v gnuplot >/dev/null || skip "gnuplot is not installed"
	work_folder
	cp "$BATS_FILE_TMPDIR"/m.f* "$BATS_FILE_TMPDIR/pairs.csv" .
	mkdir tmp
	export TMPDIR=$PWD/tmp
	unset DISPLAY WAYLAND_DISPLAY
}

# Nothing stays in TMPDIR, whatever happened.
teardown() {
	[ ! -d tmp ] || [ -z "$(ls -A tmp)" ]
}

# Draw a file as SVG: the texts of the figure are in the file texts, a line each. None of them
# overlaps another one or leaves the canvas.
draws() {
	incise plot "$@" -o figure.svg --overwrite >out
	[ "$(cat out)" = "wrote figure.svg" ] || complain "$(cat out)" || return
	python3 "$root/tests/cli/figures.py" figure.svg || return
	python3 - >texts <<-'END'
		import xml.etree.ElementTree as tree
		for text in tree.parse("figure.svg").iter("{http://www.w3.org/2000/svg}text"):
		    print("".join(text.itertext()))
	END
}

# The figure has each of these texts as a whole.
shows() {
	for text; do
		grep -qxF -e "$text" texts || complain "no '$text' among: $(cat texts)" || return
	done
}

# bats test_tags=check
@test "a model: functions and contours" {
	draws m.fis
	shows "depth / mm" "velocity / (mm/s)" "force / N" "degree of membership" shallow
	shows "95 % intervals at 25 mm/s" "95 % intervals at 10 mm"
	! grep -q residual texts
	# a curve for each function: 5 over the depth and 4 over the velocity
	[ "$(grep -cxE '(very )?(shallow|medium|deep|slow|fast)' texts)" = 9 ]
	# both intervals; no calibration of a rig is stated, and degrees have their unit
	shows "a new cut" "the mean of all cuts" output
	sed '1s/_mm/_deg/g' pairs.csv >deg.csv
	incise train deg.csv --inputs depth_deg,velocity_deg_s -o deg.fis >/dev/null 2>&1
	draws deg.fis
	shows "depth / °" "velocity / (°/s)"
}

@test "residuals are those of incise eval" {
	draws m.fis --data pairs.csv
	shows "residual of force / N" "quantile of the normal distribution / SD" "mean and its standard error"
	awk -F, 'NR > 1 { print $2, $3 }' pairs.csv >points
	# three digits of the RMSE, which is 0.0442 N: no "mean -8.4e-06"
	paste -d, <(tail -n +2 pairs.csv) <(incise eval m.fis points) | awk -F, '
		{ e = $4 - $5; sum += e; squares += e * e; n++ }
		END { printf "%d rows: measured - model, RMSE %.4f N, mean %.4f N\n",
			n, sqrt(squares / n), sum / n }' | sed 's/-0.0000/0.0000/' >want
	shows "$(cat want)"
	# means over twelve parts of the depth: those of the residuals there, weighted, give the mean of all
	keep_data m.fis --data pairs.csv
	paste -d, <(tail -n +2 pairs.csv) <(incise eval m.fis points) | awk -F, '$2 >= 20 - 20 / 12 {
		e = $4 - $5; sum += e; n++ } END { printf "%.5f\n", sum / n }' >want
	tail -n 1 kept/*-residuals.dat | awk '{ printf "%.5f\n", $2 }' | diff want -
	# rows where the blade did not advance are no data of the model
	sed '1s/$/,advancing/; 2,11s/$/,0/; 12,$s/$/,1/' pairs.csv >some.csv
	draws m.fx --data some.csv
	grep -q "^278 rows: measured - model" texts
}

# bats test_tags=check
@test "a dataset: over depth and velocity, and by cut" {
	draws pairs.csv
	shows "pairs.csv: 288 rows" "depth / mm" "velocity / (mm/s)" "force / N" \
		"mean and SD" cut mean SD "cut 1" "cut 6"
	! grep -qx "cut 7" texts
	cut -d, -f2,4 pairs.csv >two.csv
	draws two.csv
	shows "two.csv: 288 rows" "depth / mm"
	! grep -qE "velocity|cut" texts
	# averaged rows bring their own deviation
	sed '1s/$/,sd_N/; 2,$s/$/,0.05/' pairs.csv >averaged.csv
	draws averaged.csv
	shows "SD in the bin"
	! grep -qx "mean and SD" texts
}

@test "many rows make no larger a figure" {
	awk 'BEGIN { print "depth_mm,force_N"; for (i = 0; i < 200000; i++)
		printf "%.4f,%.4f\n", i % 1999 / 100, i % 5003 / 1000 }' >many.csv
	draws many.csv
	# there are 300 x 200 places, of 30 bytes at most in the data and 100 in the SVG
	[ "$(stat -c %s figure.svg)" -lt 6000000 ]
	[ "$(grep -c '<use' figure.svg)" -gt 10000 ]
}

@test "little data and a flat model are drawn too" {
	printf 'depth_mm,force_N\n1,2\n' >one.csv
	draws one.csv
	shows "one.csv: 1 row"
	sed -E "s/^(MF[0-9]+='out1mf[0-9]+':'linear',).*/\1[0 0 0]/" m.fis >flat.fis
	! cmp -s m.fis flat.fis
	draws flat.fis --data pairs.csv
	shows "force / N"
	# a text in a file is no command of gnuplot
	sed "s/^Name='depth_mm'/Name='a\`touch broken\`b_mm'/" m.fis >odd.fis
	! cmp -s m.fis odd.fis
	draws odd.fis
	shows "a touch broken b / mm"
	[ ! -e broken ] && [ ! -e tmp/broken ]
}

@test "the kind is that of the content, not of the name" {
	cp m.fis dataset.csv
	draws dataset.csv
	shows "degree of membership"
	cp m.fx model.fis
	draws model.fis
	! grep -q degree texts
	(echo "# a comment"; echo; cat pairs.csv) >m.fx
	draws m.fx
	shows "m.fx: 288 rows"
}

@test "PNG, SVG and PDF follow from the extension, others are refused" {
	run -0 --separate-stderr incise plot m.fis -o a.png
	[ "$output" = "wrote a.png" ] && [ -z "$stderr" ]
	[ "$(od -An -c -N 4 a.png | tr -d ' ')" = '211PNG' ]
	incise plot m.fis -o a.pdf
	[ "$(head -c 5 a.pdf)" = %PDF- ]
	for name in png a; do
		misused incise plot m.fis -o $name -- "-o:"
	done
}

# bats test_tags=check
@test "files that it does not draw" {
	fails incise plot nothing.fis -o a.png -- "nothing.fis:"
	printf 'a,b\n1,2\n' >other.csv
	fails incise plot other.csv -o a.png -- "other.csv:1:"
	fails incise plot m.fis --data other.csv -o a.png -- "other.csv:1:"
	head -n 20 m.fis >half.fis
	fails incise plot half.fis -o a.png -- half.fis
	printf '\177ELF\2\1\0\0no file of incise' >noise
	fails incise plot "$root/scenes/liver.scene" -o a.png -- "liver.scene:" "'incise plan "
	fails incise plot m.fis --data m.fx -o a.png -- "m.fx:"
	for file in noise "$root/README.md" /dev/null .; do
		fails incise plot "$file" -o a.png -- "$file: "
	done
	run -2 --separate-stderr incise plot pairs.csv --data pairs.csv -o a.png
	bad_usage "--data is for a model, and pairs.csv is none"
	[ ! -e a.png ]
}

@test "without gnuplot, and without a display, it says what helps" {
	run --separate-stderr env PATH="$INCISE_BUILD/bin" incise plot m.fis -o a.png
	failed_with "gnuplot is not installed" "apt-get install gnuplot-nox"
	run --separate-stderr incise plot m.fis
	failed_with "there is no display for a window; give -o NAME.png, .svg or .pdf"
	mkdir bin
	printf '#!/bin/sh\necho png svg\n' >bin/gnuplot
	chmod +x bin/gnuplot
	DISPLAY=:7 PATH=$PWD/bin:$PATH run --separate-stderr incise plot m.fis
	failed_with "this gnuplot opens no windows; give -o" "apt-get install gnuplot-qt"
}

@test "an error of gnuplot is one line, and nothing is written" {
	mkdir bin
	cat >bin/gnuplot <<-'END'
		#!/bin/sh
		printf 'set x\n    ^\n"f.gp" line 3: wrong\n' >&2
		exit 1
	END
	chmod +x bin/gnuplot
	PATH=$PWD/bin:$PATH run --separate-stderr incise plot m.fis -o a.png
	failed_with 'gnuplot could not draw it: "f.gp" line 3: wrong'
	[ ! -e a.png ]
}

# A recording of 6 s with a loss of each stream, a marker, and clipped samples; its counts are right.
made_recording() {
	incise capture -o a.rec --rig sim:clock=simulated --camera depth --duration 6s >/dev/null
	sqlite3 a.rec/recording.db "
		DELETE FROM force WHERE seq BETWEEN 20000 AND 24999;
		DELETE FROM force WHERE seq = 40000;
		DELETE FROM tracker WHERE seq BETWEEN 360 AND 419;
		DELETE FROM frames WHERE seq BETWEEN 50 AND 60;
		UPDATE force SET code = 4095 WHERE seq BETWEEN 50000 AND 50002;
		INSERT INTO events SELECT t_ns, 'marker', 'the \"skin\"' FROM force WHERE seq = 10000;
		UPDATE meta SET value = (SELECT count(*) FROM force) WHERE key = 'force_rows';
		UPDATE meta SET value = (SELECT count(*) FROM tracker) WHERE key = 'tracker_rows';
		UPDATE meta SET value = (SELECT count(*) FROM frames) WHERE key = 'frames_rows'"
}

# The figure of gnuplot's data: a stub keeps the folder that incise plot made.
keep_data() {
	mkdir -p bin
	printf '#!/bin/sh\ncp -r . "%s/kept"\nexec "%s" "$@"\n' "$PWD" "$(command -v gnuplot)" \
		>bin/gnuplot
	chmod +x bin/gnuplot
	rm -rf kept
	PATH=$PWD/bin:$PATH incise plot "$@" -o figure.svg --overwrite
}

@test "a recording: all streams on one axis, cuts, losses, frames, markers" {
	made_recording
	draws a.rec
	shows "force / N" "depth / mm" "speed / (mm/s)" "position / mm" "time / s" \
		tracker camera force events cut lost clipped x y z 1 "the  skin "
	grep -q '^a.rec, sim:clock=simulated, 6 s from .*, 3 clipped$' texts
	incise capture -o b.rec --rig sim:clock=simulated --duration 1s >/dev/null
	draws b.rec
	shows "force / N" tracker
	! grep -qxE 'camera|events|lost|clipped|cut' texts
}

@test "lost samples are gaps in the lines, at their times" {
	made_recording
	keep_data a.rec
	# an empty line in the data ends a line of the figure: after 1.9999 s comes 2.5 s
	awk 'NF && !before && n { printf "%.2f %.2f\n", last, $1 } NF { last = $1; n++ } { before = NF }' \
		kept/force.dat >gaps
	[ "$(head -n 1 gaps)" = "2.00 2.50" ]
	[ "$(sed -n 2p gaps)" = "4.00 4.00" ]
	awk 'NF && !before && n { printf "%.1f %.1f\n", last, $1 } NF { last = $1; n++ } { before = NF }' \
		kept/depth.dat >gaps
	[ "$(head -n 1 gaps)" = "3.0 3.5" ]
	# a column of pixels is 3 ms: the loss of one sample is seen as one
	awk '{ printf "%.2f %.2f\n", $1, $2 }' kept/force-lost.dat >lost
	[ "$(head -n 1 lost)" = "2.00 2.50" ]
	[ "$(sed -n 2p lost)" = "4.00 4.00" ]
	[ "$(wc -l <lost)" = 2 ]
	[ "$(awk '{ printf "%.1f %.1f\n", $1, $2 }' kept/camera-lost.dat)" = "1.0 1.2" ]
	# no frame is hidden: at 50 Hz each has columns of its own
	[ "$(wc -l <kept/camera-present.dat)" = "$(sqlite3 a.rec/recording.db 'SELECT count(*) FROM frames')" ]
}

@test "no extreme is hidden, and the data do not grow with the recording" {
	incise capture -o a.rec --rig sim:clock=simulated --duration 30s >/dev/null
	keep_data a.rec
	# two points of each of 2000 columns
	[ "$(grep -c . kept/force.dat)" -le 4001 ]
	[ "$(grep -c . kept/depth.dat)" -gt 3000 ]
	incise info a.rec --json >info.json
	want=$(awk -v n="$(key info.json force_max_N)" 'BEGIN { printf "%.4f", n }')
	# of all samples, those in cuts and others
	largest=$(awk '$2 != "NaN" && $2 > most { most = $2 } END { printf "%.4f", most }' kept/force.dat)
	[ "$largest" = "$want" ] || complain "$largest is not $want"
}

@test "texts from anywhere make a figure, no command and no broken SVG" {
	incise capture -o a.rec --rig sim:clock=simulated --duration 2s >/dev/null
	sqlite3 a.rec/recording.db "INSERT INTO events SELECT t_ns, 'marker', 'a # ' || char(27) || x'c3' ||
		' <b> & \`touch broken\`' FROM force WHERE seq = 10"
	mv a.rec $'a\xff\x01\'`touch broken`"<&é.rec'
	draws $'a\xff\x01\'`touch broken`"<&é.rec'
	grep -qF 'a # ?? <b> &  touch broken' texts
	grep -qF 'a    touch broken  <&é.rec, sim:clock=simulated, 2 s' texts
	[ ! -e broken ] && [ ! -e tmp/broken ]
	# and a long one leaves the rest of the title its place
	long=$(printf 'x%.0s' {1..100}).csv
	cp pairs.csv "$long"
	draws "$long"
	shows "$(printf 'x%.0s' {1..60})…: 288 rows"
}

@test "a part of a recording" {
	incise capture -o a.rec --rig sim:clock=simulated --duration 6s >/dev/null
	keep_data a.rec --range 2s..2500ms
	awk 'NF && $2 != "NaN" && ($1 < 2 || $1 > 2.5) { bad = 1 } END { exit bad }' kept/force.dat
	# 5000 samples in 2000 columns of pixels
	[ "$(grep -c . kept/force.dat)" -gt 3000 ]
	keep_data a.rec --range 5s..
	[ "$(awk 'NF { print int($1); exit }' kept/force.dat)" = 5 ]
	keep_data a.rec --range ..1s
	[ "$(awk 'NF && $2 != "NaN" { last = $1 } END { printf "%.1f", last }' kept/force.dat)" = 1.0 ]
	fails incise plot a.rec --range 7s..8s -o b.png -- "a.rec:" "--range is beside that"
	run -2 --separate-stderr incise plot m.fis --range 1s..2s -o b.png
	bad_usage "--range is for a recording, and m.fis is none"
}

@test "an interrupted recording, and a damaged one" {
	incise capture -o a.rec --rig sim:clock=simulated --duration 2s >/dev/null
	sqlite3 a.rec/recording.db "UPDATE meta SET value = 0 WHERE key = 'complete'"
	mv a.rec a.rec.part
	draws a.rec
	grep -q "interrupted$" texts
	draws a.rec.part
	sqlite3 a.rec.part/recording.db "UPDATE tracker SET z_mm = 9e999 WHERE seq = 7"
	fails incise plot a.rec -o b.png -- "stream tracker, block 0"
	[ ! -e b.png ]
}

@test "a session: the path, depth and force, and the tools that were in the tissue" {
	incise haptic neck --procedure --state none -o a.session >/dev/null
	incise assess a.session --json >a.json
	draws a.session
	shows "x / mm" "y / mm" "depth / mm" "force / N" "time / s" cut membrane blade handle tube \
		"at most" "in the air"
	grep -q "^a.session, neck.scene, 22.0 s, $(key a.json 'sessions[0].met') of $(
		key a.json 'sessions[0].judged') criteria met$" texts
	incise haptic liver --rig sim:clock=simulated --duration 4s --state none \
		-o b.session >/dev/null
	draws b.session
	shows "force / N" blade
	! grep -qxE 'handle|tube|membrane' texts
	sed 's/"incise_session": *1/"incise_session": 2/' a.session >broken.session
	! cmp -s a.session broken.session
	fails incise plot broken.session -o b.png -- broken.session
}

# An entry of a history: kind, date, key, unit, value, u, pass.
entry() {
	printf '{ kind = "%s"; date = "%sT00:00:00Z"; pass = %s;
		values = ( { key = "%s"; found = 1.0; left = %s; u = %s; unit = "%s"; } ); }' \
		"$1" "$2" "$7" "$3" "$5" "$6" "$4"
}

# bats test_tags=check
@test "a calibration: each coefficient of its history, with its uncertainty" {
	cat >c.conf <<-END
		force_mV_N = 1238.5;
		history = ( $(entry force 2026-01-05 force_mV_N mV/N 1236.0 1.5 true),
			$(entry force 2026-04-05 force_mV_N mV/N 1300.0 9.0 false),
			$(entry depth 2026-04-06 depth_mm_px mm/px 0.119 0.0001 true),
			$(entry force 2026-07-05 force_mV_N mV/N 1238.5 1.5 true) );
	END
	draws c.conf
	shows "c.conf: 4 calibrations" "sensitivity of the force / (mV/N)" "scale of the depth / (mm/px)" before \
		"active" "value and U (k = 2)" "not passed" "2026-04-06 00:00"
	[ "$(grep -cx "not passed" texts)" = 1 ]
	keep_data c.conf
	# UNIX time, value, U = 2 u, passed
	diff - kept/series-0.dat <<-END
		$(date -ud 2026-01-05 +%s) 1236 3 1
		$(date -ud 2026-04-05 +%s) 1300 18 0
		$(date -ud 2026-07-05 +%s) 1238.5 3 1
	END
	# the sd of a delay is half of its bar; that of a stream without a delay of its own is a value
	cat >d.conf <<-END
		tracker_delay_ms = 4.0;
		history = ( { kind = "delay"; date = "2026-01-05T00:00:00Z"; pass = true; values = (
			{ key = "tracker_delay_ms"; found = 0.0; left = 4.0; u = 0.05; unit = "ms"; },
			{ key = "tracker_delay_sd_ms"; found = 0.0; left = 0.05; u = 0.0; unit = "ms"; },
			{ key = "force_delay_sd_ms"; found = 0.0; left = 0.01; u = 0.0; unit = "ms"; } ); } );
	END
	draws d.conf
	shows "tracker delay / ms" "force delay sd / ms"
	! grep "tracker delay sd" texts
	echo "force_mV_N = 1238.5;" >c.conf
	fails incise plot c.conf -o c.png -- "c.conf:"
}

@test "without -o it is a window, which ends when it is closed" {
	local pid id seen=
	command -v Xvfb >/dev/null && command -v xdotool >/dev/null || skip "Xvfb or xdotool are not installed"
	gnuplot -e "set print '-'; print GPVAL_TERMINALS" | grep -qwE 'qt|wxt|x11' || skip "gnuplot has no windows"
	Xvfb -displayfd 5 -noreset -screen 0 1280x1024x24 5>display >/dev/null 2>&1 3>&- &
	server=$!
	await test -s display
	DISPLAY=:$(cat display)
	export DISPLAY
	# A window that is closed before gnuplot waits for that is waited for without end: the key comes
	# when gnuplot sleeps behind the last line but one, in poll, select or nanosleep.
	mkdir bin
	cat >bin/gnuplot <<-END
		#!/bin/sh
		[ ! -e figure.gp ] || sed -i 's|^pause mouse close|system "touch $PWD/drawn"\n&|' figure.gp
		exec $(command -v gnuplot) "\$@"
	END
	chmod +x bin/gnuplot
	PATH=$PWD/bin:$PATH incise plot m.fis >out 2>err 3>&- &
	pid=$!
	await test -e drawn
	while ! grep -qE '^(7|23|35|230|270|271) ' "/proc/$(pgrep -P $pid)/syscall"; do
		sleep 0.1
	done
	# Hidden windows of gnuplot have its name too.
	for id in $(xdotool search --name '^Gnuplot'); do
		seen=yes
		xdotool windowfocus "$id" key --window "$id" q 2>/dev/null || :
	done
	[ "$seen" = yes ] || complain "no window: $(cat err)"
	wait $pid || complain "exit $?: $(cat err)"
	[ ! -s out ] && [ ! -s err ]
	kill $server
}

@test "a window that is interrupted ends with gnuplot" {
	mkdir bin
	cat >bin/gnuplot <<-'END'
		#!/bin/sh
		case "$*" in
		*GPVAL_TERMINALS*) echo "png x11 svg" ;;
		*ext=\'x11\'*) grep -q 'pause mouse close' figure.gp && echo $$ >"$STARTED" && exec sleep 600 ;;
		*) exit 1 ;;
		esac
	END
	chmod +x bin/gnuplot
	export STARTED=$PWD/started
	PATH=$PWD/bin:$PATH DISPLAY=:7 incise plot m.fis >out 2>err 3>&- &
	pid=$!
	await test -s started
	kill -INT $pid
	status=0
	wait $pid || status=$?
	[ "$status" = 1 ]
	[ "$(cat err)" = "incise plot: interrupted" ]
	run ! kill -0 "$(cat started)"
}
