#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A capture with a camera of the kernel: CLOCK_REALTIME is set meanwhile, one hour on and
# back, and nothing comes of it; then the camera goes, and the rest is recorded.
. tests/vm/tap

[ -e "$INCISE_BUILD/lib/incise/frames_mkv.so" ] || skip "a capture" "frames_mkv.so was not built"
command -v sqlite3 >/dev/null || skip "a capture" "there is no sqlite3 to look into it with"
# camera_vivid and camera_loopback test its use of the kernel, for each kernel.
[ "$INCISE_VM_KERNEL" != second ] || skip "a capture" "one kernel is enough for it"
modprobe vivid n_devs=1 node_types=1 num_inputs=1 input_types=0 2>/dev/null ||
	skip "vivid" "this kernel has no vivid"
name=$(cd /sys/class/video4linux && grep -l '^vivid-.*-vid-cap$' video*/name | head -n 1)
name=${name%/name}
PATH=$INCISE_BUILD/bin:$PATH
mkdir -p /run/rig
cd /run/rig || exit 1

# A machine that is emulated is slow: few samples, small pictures.
cat >rig.conf <<-END_OF_RIG
	clock = "real";
	tracker = "sim:";
	force = "sim:";
	sim = { force_hz = 1000.0; pause_s = 60.0; };
	camera = "v4l2:/dev/$name";
	camera_setup = { width = 320; height = 180; rate_hz = 10.0; };
END_OF_RIG

# ask SQL: one value of the last recording
ask()
{
	"$INCISE_BUILD/tests/sql" -readonly a.rec/recording.db "$1"
}

# holds SQL: what is asked is true
holds()
{
	got=$(ask "SELECT $1")
	[ "$got" = 1 ] || {
		echo "$1: $got"
		return 1
	}
}

# rows_of STREAM: how many it has written
rows_of()
{
	incise info a.rec.part --json >rows.json 2>/dev/null && sqlite3 :memory: "SELECT
		json_extract(value, '\$.rows') FROM json_each(readfile('rows.json'), '\$.streams')
		WHERE json_extract(value, '\$.name') = '$1'"
}

# until_rows STREAM N: until it has written more than that
until_rows()
{
	i=0
	until rows=$(rows_of "$1") && [ "${rows:-0}" -gt "$2" ] || [ $i = 60 ]; do
		# starting programs is most of the work in here
		sleep 0.5
		i=$((i + 1))
	done
}

# begin: a capture, longer than any host takes; end: it is asked to end, when what it was for has
# come. Leaves its code in $code.
begin()
{
	incise capture -o a.rec -c none --duration 5min --json >report.json 2>err &
	capture=$!
}

end()
{
	kill $capture
	wait $capture
	code=$?
}

# what_was: the report, and what others say of the recording
what_was()
{
	cat report.json err
	incise verify a.rec
	echo "verify: $?"
	ask "SELECT name, rows, lost, ended FROM streams; SELECT * FROM events"
}

# verified CODE: verify ends so, and counts as lost what capture did
verified()
{
	code=0
	incise verify --json a.rec >verify.json || code=$?
	[ $code = "$1" ] && [ "$(ask "SELECT sum(lost) FROM streams")" = "$(sqlite3 :memory: "SELECT
		sum(json_extract(value, '$.lost')) FROM
		json_each(readfile('verify.json'), '$.streams')")" ]
}

# --- CLOCK_REALTIME is set ------------------------------------------------------------

# set_clock SECONDS: to so much later
set_clock()
{
	date -s "@$(($(date +%s) + $1))" >/dev/null || echo "not ok the clock can be set"
}

# Virtual time goes on while programs are read from the host for the first time.
incise capture -o a.rec -c none --duration 1s >/dev/null 2>&1
rm -rf a.rec a.rec.part
began=$(date +%s)
begin
until_rows force 1000
set_clock 3600
until_rows force 2000
set_clock -7200
until_rows force 3000
set_clock 3600
# the mapping to TAI has a point for each second
until_rows force 8000
end
what_was | sed 's/^/# /'
# In real time an emulated machine may lose some: it says so, and how many. In virtual time it
# may, too, at the end, where the programs that look at the recording are read from the host.
lost=$(ask "SELECT sum(lost) FROM streams")
if [ "$INCISE_VM_PROFILE" = deterministic ]; then
	incise verify a.rec 2>&1 | grep -E '^a\.rec: .* missing[ ,]' | grep -v ' missing at the end' >gaps
	check "nothing is lost while the clock is set" [ ! -s gaps ]
fi
check "it ends with what it lost" [ "$code" = $((lost > 0)) ]
check "verify says the same" verified $((lost > 0))
check "it began when it began" holds "abs(strftime('%s', (SELECT value FROM meta WHERE
	key = 'started')) - $began) <= 20"
# 1 ms apart, as their numbers; those of the tracker by a line that is not bent
check "times of the force go on" holds "max(abs(t_ns - seq * 1e6 - (SELECT min(t_ns - seq *
	1e6) FROM force))) < 2 FROM force"
check "times of the tracker go on" holds "max(abs(t_ns - seq * 1e9 / 120 / (1 + 50e-6) -
	(SELECT avg(t_ns - seq * 1e9 / 120 / (1 + 50e-6)) FROM tracker))) < 2e6
	FROM tracker WHERE seq > 120"
check "times of the pictures go on" holds "min(d) > 0 AND max(d) < 2e9 FROM (SELECT t_ns -
	lag(t_ns) OVER (ORDER BY seq) AS d FROM frames)"
# Two of the three may fall into one second, of which one point is kept.
check "the steps are seen" holds "count(*) BETWEEN 1 AND 3 FROM events WHERE kind = 'clock' AND
	text LIKE 'CLOCK_REALTIME was stepped by %'"
check "the mapping to TAI restarts at them" holds "count(*) = (SELECT count(*) FROM events WHERE
	kind = 'clock' AND text LIKE 'CLOCK_REALTIME was stepped by %') FROM wall WHERE restart = 'step'"
check "without a source its error is unknown" holds "count(*) >= 5 AND sum(uncertainty_ns IS NULL
	AND source = 'plain') = count(*) FROM wall"
# set by whole seconds, three times
check "in the end the clock is where it was" holds "abs((SELECT tai_ns - t_ns FROM wall ORDER BY
	seq DESC LIMIT 1) - (SELECT tai_ns - t_ns FROM wall ORDER BY seq LIMIT 1)) < 5e9"
# vivid hands out a picture up to a period before what it says is its end
check "their stamps are by the clock that is not set" holds "count(*) > 10 AND
	max(abs(arrival_ns - t_ns)) < 1e9 FROM frames"

# --- the camera goes ------------------------------------------------------------------

rm -r a.rec
begin
until_rows camera 10
check "the camera is taken away" sh -c 'echo vivid.0 >/sys/bus/platform/drivers/vivid/unbind'
until_rows force 0
until_rows force $((rows + 2500))
end
what_was | sed 's/^/# /'
check "it ends with 1, and one line that says why" sh -c "[ $code = 1 ] &&
	[ \$(grep -c '^incise' err) = 1 ] && grep -q 'the camera failed before the end of the recording: .*unplugged' err"
check "that is an event, and stands in the table of streams" holds "(SELECT count(*) FROM
	events WHERE kind = 'failed' AND text LIKE 'camera: %unplugged%') = 1 AND (SELECT ended
	FROM streams WHERE name = 'camera') LIKE '%unplugged%'"
check "the others went on" holds "max(t_ns) - (SELECT max(t_ns) FROM frames) > 1.5e9 AND
	(SELECT count(*) FROM streams WHERE ended IS NOT NULL) = 1 FROM force"
check "verify says what is missing, and why" sh -c 'incise verify a.rec >said 2>&1
	[ $? = 1 ] && grep -q unplugged said'
check "vivid goes" modprobe -r vivid

# --- a camera that pauses, and comes back ----------------------------------------------

# feed: pictures for the camera, ten a second
feed()
{
	"$INCISE_BUILD/tests/vm/camera_feed" /dev/video8 10 &
	feeder=$!
}

paused()
{
	modprobe videodev
	insmod "$INCISE_VM_LOOPBACK" devices=1 video_nr=8 max_buffers=8 || return
	cat >rig.conf <<-END_OF_RIG
		clock = "real";
		tracker = "sim:";
		force = "sim:";
		sim = { force_hz = 1000.0; pause_s = 60.0; };
		camera = "v4l2:/dev/video8";
	END_OF_RIG
	feed
	sleep 0.5
	rm -rf a.rec
	begin
	until_rows camera 10
	kill -STOP $feeder
	sleep 3
	kill -CONT $feeder
	sleep 1
	kill -KILL $feeder
	sleep 4
	end
	wait $feeder
	what_was | sed 's/^/# /'
}

if [ -e "${INCISE_VM_LOOPBACK:-}" ]; then
	paused
	# v4l2loopback numbers what it was given: only time tells of the pause
	check "a camera that pauses is an event, and so is its coming back" holds "(SELECT
		count(*) FROM events WHERE kind = 'silent' AND text LIKE '%again') = 1 AND
		(SELECT count(*) FROM events WHERE kind = 'silent' AND text LIKE '%no frame%') = 2"
	check "the pause is in the times" holds "count(*) = 1 FROM (SELECT t_ns - lag(t_ns) OVER
		(ORDER BY seq) AS d FROM frames) WHERE d > 2e9"
	check "one that does not come back ended: exit code $code" sh -c "[ $code = 1 ] &&
		[ \$(grep -c '^incise' err) = 1 ] && grep -q 'sent no frame for the last' err"
	check "verify says the same" verified 1
	check "v4l2loopback goes" rmmod v4l2loopback
else
	echo "ok a camera that pauses # skip tests/vm/loopback has not built v4l2loopback"
fi
cd / || exit 1
rm -r /run/rig
