# SPDX-License-Identifier: GPL-2.0-or-later
# incise capture: camera, triggers, markers, cuts, and what it tells of each stream.

load cli

quick=sim:clock=simulated

setup() {
	watch_machine
	memory_folder
}

# Two of the tests are in real time; buffers hold 2 s.
teardown() {
	machine_watched 500
	left_memory
}

ask() {
	sqlite3 -readonly "$1/recording.db" "$2"
}

# What Python types at the terminal of a command: pairs of seconds and keys.
on_a_terminal() {
	python3 - "$@" <<'END'
import os, pty, select, sys, time
keys = [(float(a.split(':')[0]), a.split(':')[1]) for a in sys.argv[1].split(',')]
pid, fd = pty.fork()
if not pid:
    os.execvp(sys.argv[2], sys.argv[2:])
start, out = time.monotonic(), b''
while True:
    now = time.monotonic() - start
    while keys and now >= keys[0][0]:
        os.write(fd, keys.pop(0)[1].encode())
    if select.select([fd], [], [], 0.05)[0]:
        try:
            data = os.read(fd, 65536)
        except OSError:
            data = b''
        if not data:
            break
        out += data
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
	grep -Eq '^b.rec: .* 5[01] pictures, 0 lost' out
	[ "$(ask b.rec "SELECT rows = (SELECT count(*) FROM frames) FROM streams WHERE name =
		'camera'")" = 1 ]
	[ "$(ask b.rec "SELECT count(*) FROM frames WHERE bytes > 0 AND length_px IS NULL")" = \
		"$(ask b.rec "SELECT value FROM meta WHERE key = 'frames_rows'")" ]
	incise verify b.rec
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
	printf '# of today\nforce_mV_N = 1250;\nhistory = ( );\n' >calibration.conf
	incise capture -o a.rec --rig sim:clock=simulated --duration 600ms -c calibration.conf
	[ "$(ask a.rec "SELECT value FROM meta WHERE key = 'calibration_conf'")" = \
		"$(cat calibration.conf)" ]
	[ "$(ask a.rec "SELECT value FROM meta WHERE key = 'force_mV_N'")" = 1250.0 ]
	incise verify a.rec
	incise capture -o b.rec --rig sim:clock=simulated --duration 600ms
	[ "$(ask b.rec "SELECT count(*) FROM meta WHERE key = 'calibration_conf'")" = 0 ]
}

@test "a camera that is not there, and a wish that is none" {
	printf 'clock = "simulated"; tracker = "sim:"; force = "sim:";\n' >rig.conf
	run -1 --separate-stderr incise capture -o a.rec --duration 1s --camera frames
	[[ "$stderr" == *"camera: not named, but needed"* ]]
	incise capture -o a.rec --duration 600ms
	for wrong in "--camera on" "--trigger 0N" "--trigger knob" "--trigger -1N"; do
		# shellcheck disable=SC2086
		run -2 --separate-stderr incise capture -o b.rec $wrong
	done
	[ ! -e b.rec.part ]
}

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
	[[ "$stderr" == *"a.rec: was never triggered; nothing was recorded" ]]
	[ -z "$(ls)" ]
}

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
	on_a_terminal 1:m,1.5:7,2:q incise capture -o a.rec --rig sim: --duration 60s >out
	ask a.rec "SELECT text FROM events WHERE kind = 'marker' ORDER BY t_ns" >marks
	printf 'marker 1\n7\n' | cmp - marks
	incise verify a.rec
	# a level, the disk, a line per stream
	grep -aEq 'force +-?[0-9.]+ N \[[#.]{10}\] +depth +-?[0-9.]+ mm +disk [0-9]' out
	grep -aEq 'tracker +12[0-9.]+' out
	grep -aq 'marked: 7' out
	# the view is gone at the end, and the report stands
	tail -c 700 out | grep -aEq 'a.rec: [12]\.[0-9] s, .* 0 lost'
}

@test "the key t triggers" {
	on_a_terminal 1.5:t,2.5:q incise capture -o a.rec --rig sim: --trigger button >out
	grep -aq ARMED out
	[ "$(ask a.rec "SELECT count(*) FROM events WHERE kind = 'trigger'")" = 1 ]
	[ "$(ask a.rec "SELECT count(*) BETWEEN 11000 AND 29000 FROM force")" = 1 ]
	incise verify a.rec
}

@test "delays of calibration move the times" {
	printf 'tracker_delay_ms = 14.2;\ntracker_delay_sd_ms = 0.3;\nforce_delay_ms = 1.0;\n' \
		>calibration.conf
	incise capture -o a.rec --rig $quick --duration 3s
	incise capture -o b.rec --rig $quick --duration 3s -c calibration.conf --json >b.json
	# 4.2 ms is what the virtual tracker says of itself
	[ "$(sqlite3 :memory: "ATTACH 'a.rec/recording.db' AS a; ATTACH 'b.rec/recording.db' AS b;
		SELECT count(*) FROM a.tracker x JOIN b.tracker y USING(seq) WHERE
		x.t_ns - y.t_ns != 10000000")" = 0 ]
	[ "$(sqlite3 :memory: "ATTACH 'a.rec/recording.db' AS a; ATTACH 'b.rec/recording.db' AS b;
		SELECT count(*) FROM a.force x JOIN b.force y USING(seq) WHERE
		x.t_ns - y.t_ns != 1000000")" = 0 ]
	sqlite3 :memory: "SELECT json_extract(readfile('b.json'), '\$.streams[1].delay_ms') = 14.2
		AND json_extract(readfile('b.json'), '\$.streams[1].offset_sd_ms') BETWEEN 0.3 AND
		0.4 AND json_extract(readfile('b.json'), '\$.streams[0].delay_sd_ms') IS NULL" |
		grep -qx 1
}
