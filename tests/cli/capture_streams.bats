# SPDX-License-Identifier: GPL-2.0-or-later
# incise capture: camera, triggers, markers, cuts, and what it tells of each stream.

load cli

quick=sim:clock=simulated

setup() {
	memory_folder
}

teardown() {
	left_memory
}

# Python types keys at the terminal of a command, of 80 columns and 24 lines or of $size: pairs of keys
# and the number of views that are drawn before, ten a second at most. Exit 1 is fine where samples
# were lost: in real time a machine that stands still loses some.
on_a_terminal() {
	typed_at "$@" >out || grep -aq "were lost" out
}

typed_at() {
	python3 - "$@" <<'END'
import fcntl, os, pty, struct, sys, termios
keys = [(int(a.split(':')[0]), a.split(':')[1]) for a in sys.argv[1].split(',')]
columns, lines = map(int, os.environ.get('size', '80x24').split('x'))
pid, fd = pty.fork()
if not pid:
    fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack('HHHH', lines, columns, 0, 0))
    os.execvp(sys.argv[2], sys.argv[2:])
out = b''
while True:
    try:
        data = os.read(fd, 65536)
    except OSError:
        break
    out += data
    while keys and out.count(b'\x1b[J') >= keys[0][0]:
        os.write(fd, keys.pop(0)[1].encode())
sys.stdout.buffer.write(out)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
END
}

@test "the camera of a sim: rig is recorded when it is asked for" {
	incise capture -o a.rec --rig $quick --duration 1s
	[ "$(ask a.rec "SELECT count(*) FROM streams WHERE name IN ('force', 'tracker')")" = 2 ]
	[ "$(ask a.rec "SELECT count(*) FROM streams")" = 2 ]
	[ ! -e a.rec/camera.mkv ]
	incise capture -o b.rec --rig $quick --duration 1s --camera frames >out
	grep -Eq '^b.rec: .* 5[01] frames, 0 lost' out
	[ "$(ask b.rec "SELECT rows = (SELECT count(*) FROM frames) FROM streams WHERE name =
		'camera'")" = 1 ]
	[ "$(ask b.rec "SELECT count(*) FROM frames WHERE bytes > 0 AND length_px IS NULL")" = \
		"$(ask b.rec "SELECT value FROM meta WHERE key = 'frames_rows'")" ]
	incise verify b.rec
	incise info b.rec | grep -q '^camera   frames in magicyuv, lossless'
	[ "$(incise info --json b.rec | jq -r .camera_codec) $(incise info --json a.rec | jq -r .camera_codec)" = "magicyuv null" ]
}

@test "pictures are looked at, and agree with the tracker" {
	incise capture -o a.rec --rig $quick,cut_s=1,pause_s=0.6 --duration 1500ms --camera depth
	# Between the records before and after, but for 5 sd of the tracker's 0.02 mm and what
	# vision may be off, some 0.005 mm.
	n=$(ask a.rec "SELECT count(*) FROM (SELECT f.depth_mm seen, (SELECT d.depth_mm FROM
		depth d WHERE d.t_ns >= f.t_ns ORDER BY d.t_ns LIMIT 1) b, (SELECT d.depth_mm
		FROM depth d WHERE d.t_ns < f.t_ns ORDER BY d.t_ns DESC LIMIT 1) a FROM
		frames f) WHERE seen > 1 AND seen BETWEEN min(a, b) - 0.11 AND max(a, b) + 0.11")
	[ "$n" -ge 20 ]
	[ "$n" = "$(ask a.rec "SELECT count(*) FROM frames WHERE depth_mm > 1")" ]
	[ "$(ask a.rec "SELECT count(*) FROM frames WHERE quality > 0.5")" -ge 40 ]
}

@test "a rig.conf's camera is recorded without a word, and left out when told" {
	printf 'clock = "simulated"; tracker = "sim:"; force = "sim:"; camera = "sim:";\n' \
		>rig.conf
	incise capture -o a.rec --duration 600ms
	[ "$(ask a.rec "SELECT count(*) > 20 FROM frames WHERE length_px > 0")" = 1 ]
	[ "$(ask a.rec "SELECT value FROM meta WHERE key = 'rig_conf'")" = "$(cat rig.conf)" ]
	incise capture -o b.rec --duration 600ms --camera off
	[ ! -e b.rec/camera.mkv ]
}

@test "a recording keeps the calibration it was made with, with its history" {
	printf '# of today\nforce_mV_N = 1250;\nforce_zero_mV = 180.0;\nhistory = ( );\n' >calibration.conf
	incise capture -o a.rec --rig sim:clock=simulated --duration 600ms -c calibration.conf
	[ "$(ask a.rec "SELECT value FROM meta WHERE key = 'calibration_conf'")" = \
		"$(cat calibration.conf)" ]
	[ "$(ask a.rec "SELECT value FROM meta WHERE key = 'force_mV_N'")" = 1250.0 ]
	[ "$(ask a.rec "SELECT value FROM meta WHERE key = 'force_zero_mV'")" = 180.0 ]
	incise verify a.rec
	incise capture -o b.rec --rig sim:clock=simulated --duration 600ms -c none
	[ "$(ask b.rec "SELECT count(*) FROM meta WHERE key = 'calibration_conf'")" = 0 ]
	fails incise capture -o c.rec --rig $quick --calibration none.conf -- none.conf
}

@test "a camera that is not there" {
	printf 'clock = "simulated"; tracker = "sim:"; force = "sim:";\n' >rig.conf
	run -1 --separate-stderr incise capture -o a.rec --duration 1s --camera frames
	[[ "$stderr" == *"camera: missing, but required"* ]]
	incise capture -o a.rec --duration 600ms
}

# bats test_tags=check
@test "a trigger on force begins a second before it" {
	# The first cut begins at 1 s.
	incise capture -o a.rec --rig $quick --trigger 0.2N --duration 1s --json >report.json
	# 1 s before the trigger and 1 s after, in steps of 10 ms
	holds "$(key report.json seconds) > 1.98 && $(key report.json seconds) < 2.02"
	incise verify a.rec
	t=$(ask a.rec "SELECT t_ns FROM events WHERE kind = 'trigger'")
	# polled every 10 ms, written with the next poll
	[ "$(ask a.rec "SELECT ($t - min(t_ns)) BETWEEN 980000000 AND 1000000000 AND
		max(t_ns) - $t BETWEEN 960000000 AND 1010000000 FROM force")" = 1 ]
	[ "$(ask a.rec "SELECT ($t - min(t_ns)) BETWEEN 970000000 AND 1000000000 FROM tracker")" = 1 ]
	# the force that triggered is there, and none such before: (code - zero) at 12 bits, 5 V
	first=$(ask a.rec "SELECT min(t_ns) FROM force, (SELECT value z FROM meta WHERE
		key = 'force_zero_mV') WHERE abs(code * 5000 / 4096.0 - z) >= 0.2 * 1240")
	[ $((t - first)) -ge 0 ]
	[ $((t - first)) -le 30000000 ]
	[ "$(ask a.rec "SELECT count(*) FROM events WHERE kind = 'lost'")" = 0 ]
}

@test "what is never triggered leaves nothing, and exit 1" {
	run -1 --separate-stderr incise capture -o a.rec --rig $quick,cut_s=1 --trigger 100N
	[[ "$stderr" == *"a.rec: it was never triggered; nothing was recorded" ]]
	[ -z "$(ls)" ]
}

# bats test_tags=check
@test "cuts are marked" {
	incise capture -o a.rec --rig $quick,cut_s=1,pause_s=0.6 --cuts --duration 5s
	ask a.rec "SELECT text FROM events WHERE kind = 'cut' ORDER BY t_ns" >marks
	printf 'cut %d begins\ncut %d ends\n' 1 1 2 2 3 3 | head -n "$(wc -l <marks)" | cmp - marks
	[ "$(wc -l <marks)" -ge 5 ]
	# where the blade is deeper than 0.3 mm at first
	[ "$(ask a.rec "SELECT count(*) FROM events e JOIN depth d ON d.t_ns = e.t_ns WHERE
		e.text LIKE '%begins' AND depth_mm > 0.3")" = 3 ]
	incise capture -o b.rec --rig $quick,cut_s=1,pause_s=0.6 --duration 5s
	[ "$(ask b.rec "SELECT count(*) FROM events WHERE kind = 'cut'")" = 0 ]
}

@test "keys on a terminal: markers, the end, and what is shown" {
	on_a_terminal 10:m,15:7,20:q incise capture -o a.rec --rig sim: --duration 1h
	ask a.rec "SELECT text FROM events WHERE kind = 'marker' ORDER BY t_ns" >marks
	printf 'marker 1\n7\n' | cmp - marks
	is_intact a.rec
	# the disk, a level, a line per stream
	grep -aEq '^.*[0-9.]+ of 3600.0 s +disk [0-9]' out
	grep -aEq 'force +-?[0-9.]+ N \[[#.]{10}\] of 4.03 N' out
	grep -aEq 'depth +-?[0-9.]+ mm' out
	grep -aEq 'tracker +12[0-9.]+' out
	grep -aq 'marked: 7' out
	# the view is gone at the end, and the report stands
	tail -c 700 out | grep -aEq 'a.rec: [0-9]+\.[0-9] s, .* [0-9]+ lost'
}

# What was on the terminal, as the views that were drawn: each has at most $1 characters in a line and
# $2 lines. Prints the last one.
views_fit() {
	python3 - "$1" "$2" <<-'END'
		import re, sys
		columns, lines = int(sys.argv[1]), int(sys.argv[2])
		text = open('out', encoding='utf-8', newline='').read()
		# each view is replaced by going up, and clearing from there
		views = re.split('(?:\x1b\\[[0-9]+A)?\r\x1b\\[J', text)
		views = [view.replace('\r\n', '\n') for view in views if 'stream ' in view or 'force ' in view]
		assert len(views) > 5, len(views)
		for view in views[:-1]:
		    rows = view.split('\n')
		    assert len(rows) <= lines, view
		    # the last column stays free: a line that wraps could not be replaced
		    assert max(map(len, rows)) < columns, view
		    assert '\x1b' not in view
		print(views[-2])
	END
}

@test "the live view has traces of force and depth, and fits its terminal" {
	export LC_ALL=C.UTF-8
	on_a_terminal 45:q incise capture -o a.rec --rig sim:cut_s=2,pause_s=0.6
	views_fit 80 24 >view
	# two traces of four lines, with their axes
	[ "$(grep -cE '^ *(-?[0-9.e]+ (N|mm))?\|.{70}$' view)" = 8 ]
	grep -q '⠉\|⠒\|⠤\|⣀\|⠓' view
	grep -q 'last 14 s$' view
	grep -qE '^stream .* offset ms$' view
	# no value of the table is cut off
	[ "$(grep -cE '^(force|tracker) .* [0-9.-]+±([0-9.]+|\?)$' view)" = 2 ]
	grep -qE '^m, 1-9: marker' view
	size=52x14 on_a_terminal 20:q incise capture -o b.rec --rig sim:
	views_fit 52 14 >view
	[ "$(grep -cE '^ *(-?[0-9.e]+ (N|mm))?\|.{42}$' view)" -ge 4 ]
	# no place for traces, and not even for all lines
	size=30x5 on_a_terminal 15:q incise capture -o c.rec --rig sim:
	views_fit 30 5 >view
	! grep -q '|' view
}

@test "without UTF-8, and on Linux's console, traces are of ASCII" {
	local values
	for values in "C xterm" "C.UTF-8 linux"; do
		rm -rf a.rec
		LC_ALL=${values% *} TERM=${values#* } on_a_terminal 15:q incise capture -o a.rec --rig sim:
		views_fit 80 24 >view
		[ "$(grep -c '|' view)" = 8 ]
		grep -q "|.*[.:']" view
		# but for ± in the table
		sed 's/±//g' view >plain
		LC_ALL=C run ! grep '[^ -~]' plain
	done
}

@test "in a pipe there is a line each second, on stderr" {
	incise capture -o a.rec --rig sim: --duration 3500ms --json >out 2>err || grep -q "were lost" err
	holds "$(key out seconds) >= 3.5"
	# of a busy machine some are missing, and none is twice there
	grep -v "were lost" err >lines
	run ! grep -vE '^[0-9]+ s: force -?[0-9]+\.[0-9]{3} N, depth -?[0-9.]+ mm; [0-9]+ force samples, [0-9]+ tracker records, [0-9]+ lost$' lines
	awk -F'[; ]+' '{ if ($1 <= s || $9 <= n) exit 1; s = $1; n = $9 } END { exit NR < 1 || NR > s }' lines
	# simulated time passes as fast as the machine goes: no seconds to report in
	incise capture -o b.rec --rig $quick --duration 30s 2>err
	[ ! -s err ]
}

@test "the key t triggers" {
	on_a_terminal 15:t,25:q incise capture -o a.rec --rig sim: --trigger button
	grep -aq ARMED out
	[ "$(ask a.rec "SELECT count(*) FROM events WHERE kind = 'trigger'")" = 1 ]
	t=$(ask a.rec "SELECT t_ns FROM events WHERE kind = 'trigger'")
	[ "$(ask a.rec "SELECT $t - min(t_ns) BETWEEN 1 AND 1000000000 AND max(t_ns) > $t FROM force")" = 1 ]
	is_intact a.rec
}

# bats test_tags=check
@test "delays of calibration move the times" {
	printf 'tracker_delay_ms = 14.2;\ntracker_delay_sd_ms = 0.3;\nforce_delay_ms = 1.0;\n' \
		>calibration.conf
	incise capture -o a.rec --rig $quick --duration 3s -c none
	incise capture -o b.rec --rig $quick --duration 3s -c calibration.conf --json >b.json
	# 4.2 ms is what the virtual tracker says of itself
	for stream in tracker:10000000 force:1000000; do
		for name in a b; do
			ask $name.rec "SELECT seq, t_ns FROM ${stream%:*} ORDER BY seq" >$name.rows
		done
		paste -d '|' a.rows b.rows | awk -F '|' -v off=${stream#*:} '
			$1 == $3 { n++; if ($2 - $4 != off) bad = 1 } END { exit bad || n < 350 }'
	done
	sqlite3 :memory: "SELECT json_extract(readfile('b.json'), '\$.streams[1].delay_ms') = 14.2
		AND json_extract(readfile('b.json'), '\$.streams[1].offset_sd_ms') BETWEEN 0.3 AND
		0.4 AND json_extract(readfile('b.json'), '\$.streams[0].delay_sd_ms') IS NULL" |
		grep -qx 1
}
