# SPDX-License-Identifier: GPL-2.0-or-later
# incise calibrate tip: the tip of the virtual rig is found, used, and refused where the motion
# cannot tell it.

load cli

rig=sim:clock=simulated,motion=1,tip_x_mm=3,tip_y_mm=-20,tip_z_mm=60

# By how many of its expanded uncertainties a value of r.json is off.
within() {
	local left u
	left=$(key r.json "values[$1].left")
	u=$(key r.json "values[$1].U")
	# 1.5 U is 3 sd; and 0.1 mm is what is asked
	holds "($left - $2)^2 < ($u * 1.5)^2 && ($left - $2)^2 < 0.1^2 && $u > 0"
}

# bats test_tags=check
@test "the tip of the virtual rig is found, with its uncertainty, and kept" {
	incise calibrate tip --rig $rig --duration 20s -o p.csv -o rep --json >r.json </dev/null
	within 0 3
	within 1 -20
	within 2 60
	[ "$(key r.json pass)" = 1 ]
	holds "$(key r.json details.cone_deg) > 60"
	# 0.02 mm and 0.025 degrees at 63 mm: hypot(0.02 √3, 0.0275 √2) = 0.052
	holds "$(key r.json details.rms_error_mm) > 0.045 && $(key r.json details.rms_error_mm) < 0.06"
	grep -q '^tip_mm = \[' calibration.conf
	[ "$(key rep/report.json 'values[2].left')" = "$(key r.json 'values[2].left')" ]
	grep -qE '^tip_x_mm .* ± .* mm .* \((nominal|by hand|[0-9-]{10})\) ' rep/report.txt
	if command -v gnuplot; then
		[ -s rep/fit.png ]
		[ -s rep/residuals.png ]
	fi
	# what was kept gives the same again, and a dry run changes nothing
	cp calibration.conf before
	incise calibrate tip --from p.csv --dry-run --json >again.json
	[ "$(key again.json 'values[0].left')" = "$(key r.json 'values[0].left')" ]
	cmp before calibration.conf
}

@test "capture, and the loop, take the calibrated tip" {
	incise calibrate tip --rig $rig --duration 20s </dev/null
	cut=${rig/motion=1/motion=0}
	incise capture -o a.rec --rig "$cut" --duration 4s
	incise capture -o b.rec --rig sim:clock=simulated --duration 4s -c none
	# raw rows are without the tip
	holds "$(sqlite3 a.rec/recording.db 'SELECT abs(max(z_mm)) FROM tracker') > 40"
	# depth of the same cut, to 6 sd of two records' noise and the tip's 0.01 mm
	for name in a b; do
		ask $name.rec "SELECT seq, depth_mm FROM depth ORDER BY seq" >$name.rows
	done
	paste -d '|' a.rows b.rows | awk -F '|' '
		$1 == $3 { n++; if (($2 - $4) ^ 2 > 0.35 ^ 2) bad = 1 } END { exit bad || n < 400 }'
	incise haptic "$root/scenes/liver.scene" --rig "$cut" --duration 3s \
		-o a.csv
	incise haptic "$root/scenes/liver.scene" --rig sim:clock=simulated --duration 3s -c none -o b.csv
	holds "$(paste -d, a.csv b.csv | awk -F, 'NR == 1 {
			for (i = 1; i <= NF / 2; i++) if ($i == "depth_mm") c = i
			n = NF / 2; next }
		{ d = $c - $(c + n); if (d * d > m) m = d * d } END { print m }') < 0.35 ^ 2"
	holds "$(awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == "depth_mm") c = i; next }
		$c > m { m = $c } END { print m }' a.csv) > 0.5"
}

@test "poses of a recording will do" {
	# without the tip the tool seems to be in the tissue, so the zero is to be known
	echo 'force_zero_mV = 180.0;' >zero.conf
	incise capture -o a.rec --rig $rig --duration 15s -c zero.conf
	incise calibrate tip --from a.rec --dry-run --json >r.json
	within 2 60
}

# bats test_tags=check
@test "what cannot tell the tip is refused, and nothing is changed" {
	run --separate-stderr incise calibrate tip --rig "$rig,cone_deg=40" --duration 10s </dev/null
	failed_with "a cone of" "at least 60 are required"
	run --separate-stderr incise calibrate tip --rig sim:clock=simulated --duration 10s </dev/null
	failed_with "one axis only"
	incise calibrate tip --rig $rig --duration 10s -o p.csv --dry-run </dev/null
	head -n 10 p.csv >few.csv
	fails incise calibrate tip --from few.csv -- "too few"
	sed '1s/x_mm,y_mm/y_mm,x_mm/' p.csv >swapped.csv
	fails incise calibrate tip --from swapped.csv -- "order of the columns"
	sed '1s/qw,qx,qy,qz/qx,qy,qz,qw/' p.csv >last.csv
	fails incise calibrate tip --from last.csv -- "quaternion w first"
	awk -F, -v OFS=, 'NR > 500 { $2 += 3 } { print }' p.csv >moved.csv
	fails incise calibrate tip --from moved.csv -- "pivot moved"
	sed '7s/,[^,]*$/,nan/' p.csv >nan.csv
	fails incise calibrate tip --from nan.csv -- "nan.csv:7: qz:" "'nan'"
	sed '1s/qz/foo/' p.csv >name.csv
	fails incise calibrate tip --from name.csv -- "no column 'qz'"
	[ ! -e calibration.conf ]
	# every tenth pose is wrong: found, listed, left out
	awk -F, -v OFS=, 'NR % 10 == 5 { $3 += 2 } { print }' p.csv >outliers.csv
	incise calibrate tip --from outliers.csv --json >r.json
	within 2 60
	n=$(wc -l <p.csv)
	[ "$(key r.json details.inliers)" -le $((n - n / 10)) ]
	[ "$(key r.json 'details.outliers[0]')" = 4 ]
}

# bats test_tags=check
@test "uncertainties that are not measured are taken as options, and asked for on a terminal" {
	incise calibrate tip --rig sim:clock=simulated,motion=1 --duration 20s --given-u surface=0.1 </dev/null
	incise calibrate delay --rig sim:clock=simulated,motion=2 --duration 15s --given-u reference=0.01 </dev/null
	grep -q '^surface_u_mm = 0.1;' calibration.conf
	grep -q '^force_delay_sd_ms = 0.01;' calibration.conf
	# after both, depth and time have theirs; nothing leads back to a calibration that is there
	run -0 --separate-stderr incise capture -o a.rec --rig sim:clock=simulated --duration 25s
	[[ "$output" != *warning* ]] || complain "$output"
	run -0 --separate-stderr incise export --no-lineage a.rec --uncertainty total --rate 100 -o a.csv
	[[ "$stderr" != *depth* && "$stderr" != *delay* ]] || complain "$stderr"
	# typed, left out, ended by Ctrl-C, which writes nothing
	incise calibrate tip --rig sim:clock=simulated,motion=1 --duration 20s -o p.csv -c x.conf </dev/null
	for answer in '0.2\n' '\n' '\x03' 'far\n'; do
		rm -f x.conf
		status=0
		/usr/bin/python3 - "$answer" incise calibrate tip --from p.csv -c x.conf >out <<-'END' || status=$?
			import os, pty, select, signal, sys
			answer = sys.argv[1].encode().decode("unicode_escape").encode()
			pid, fd = pty.fork()
			if not pid:
			    signal.signal(signal.SIGINT, signal.SIG_DFL)  # what runs in the background ignores it
			    os.execvp(sys.argv[2], sys.argv[2:])
			text, asked = b"", False
			while True:
			    # a Ctrl-C that comes before it waits for the answer is pressed again, as a person would
			    if not select.select([fd], [], [], 1)[0]:
			        if asked and answer == b"\x03":
			            os.write(fd, answer)
			        continue
			    try:
			        got = os.read(fd, 4096)
			    except OSError:
			        break
			    if not got:
			        break
			    text += got
			    if not asked and b"[not stated]" in text:
			        asked = True
			        os.write(fd, answer)
			sys.stdout.buffer.write(text)
			sys.exit(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) or not asked)
		END
		case $answer in
		0.2*) [ $status = 0 ] && grep -q '^surface_u_mm = 0.2;' x.conf ;;
		'\n') [ $status = 0 ] && grep -q '^tip_mm' x.conf && ! grep -q surface_u_mm x.conf ;;
		*) [ $status != 0 ] && [ ! -e x.conf ] ;;
		esac || complain "$answer: exit $status: $(cat out)"
	done
}
