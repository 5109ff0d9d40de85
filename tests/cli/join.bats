# SPDX-License-Identifier: GPL-2.0-or-later
# incise join, as a user meets it; its arithmetic is in tests/unit/record/session.c.

load cli

# b's clock is 3 s behind and 50 ppm fast: TAI is 1000 s + t of a, and 1003 s + (1 + 50e-6) t of b.
setup_file() {
	cd "$BATS_FILE_TMPDIR"
	rig=sim:clock=simulated,cut_s=2,pause_s=1
	incise capture -o a.rec --rig $rig,seed=1 --duration 5s \
		--clock-source sim:1000,0,20 >/dev/null
	incise capture -o b.rec --rig $rig,seed=2 --duration 5s \
		--clock-source sim:1003,50,30 >/dev/null
	incise capture -o none.rec --rig $rig,seed=3 --duration 1s >/dev/null
}

setup() {
	work_folder
	cp -r "$BATS_FILE_TMPDIR"/*.rec .
}

sum() {
	sha256sum "$@" | cut -d' ' -f1
}

# bats test_tags=check
@test "join states offset, rate, uncertainty and overlap, and keeps the recordings to the bit" {
	before=$(sum a.rec/recording.db b.rec/recording.db)
	run -0 --separate-stderr incise join a.rec b.rec -o day.rec --tolerance 1ms
	[ -z "$stderr" ]
	[ "${lines[0]}" = "a: force, tracker, 1.000 to 6.000 s, on $(uname -n)" ]
	# b's 1 s is TAI 1004.00005 s, and that 4.00005 s of a
	[[ "${lines[2]}" == "  offset 3.000050000 s, rate +50.0000 ppm, uncertainty 0.05"*" ms, by clocks" ]]
	[ "${lines[3]}" = "  overlap with those before: 2.000 s" ]
	[ "${lines[-1]}" = "wrote day.rec" ]
	[ "$(sum a.rec/recording.db b.rec/recording.db)" = "$before" ]
	[ "$(sum day.rec/a/recording.db day.rec/b/recording.db)" = "$before" ]
	incise join b.rec a.rec -o again.rec --json >join.json
	[ "$(key join.json 'members[1].name')" = a ]
	# 1 / 1.00005, and times in whole ns
	sqlite3 :memory: "SELECT abs($(key join.json 'members[1].rate_ppm') + 49.9975) < 1e-3" |
		grep -qx 1
}

@test "a joined recording is read like one: verify, info, export, train, plot, Python" {
	incise join a.rec b.rec -o day.rec >/dev/null
	# each member keeps its seal, and the whole has none of its own
	statement=$INCISE_BUILD/tests/attack/statement
	diff <("$statement" a.rec) <("$statement" day.rec/a)
	run -1 "$statement" day.rec
	[[ "$output" == *"day.rec: is a joined recording; each of its members has its own seal"* ]]
	run -0 --separate-stderr incise verify day.rec
	[ "${lines[-1]}" = "day.rec: complete, and as it was written" ]
	[[ "${lines[0]}" == "force    100000 expected, 100000 present, 0 lost"* ]]
	incise info day.rec | grep -q '^  offset 3.000050000 s'
	incise info day.rec --json >info.json
	[ "$(key info.json 'members[1].method')" = clocks ]
	# a folder that is moved as a whole
	mkdir other && mv day.rec other/
	ln -s day.rec "other/10:30.rec"
	incise export --no-lineage other/10:30.rec:a --rate 10 -o named.csv
	incise export --no-lineage other/day.rec:a --resample | cut -d, -f2- >by_session.csv
	incise export --no-lineage a.rec --resample | cut -d, -f2- >alone.csv
	cmp by_session.csv alone.csv
	incise export --no-lineage other/day.rec:force=a,tracker=b --resample --rate 100 -o mixed.csv
	# there is a pose where both machines recorded, 2 s of it
	poses=$(tail -n +2 mixed.csv | grep -cv nan)
	[ "$poses" -ge 195 ] && [ "$poses" -le 201 ]
	incise export other/day.rec:b -o b.mcap
	incise train other/day.rec:a -o a.fis
	incise plot other/day.rec:b -o b.png
	[ -s a.fis ] && [ -s b.png ]
	! command -v python3 >/dev/null || PYTHONPATH=$BATS_TEST_DIRNAME/../../python python3 -c '
import incise
assert incise.open("other/day.rec:b").info.tracker == incise.open("b.rec").info.tracker'
}

@test "provenance and events are those of the machines that are read" {
	incise join a.rec b.rec -o day.rec >/dev/null
	incise export day.rec:b --rate 10 | grep -qx '# rig: .*seed=2'
	incise info day.rec:a --json >a.json
	incise info day.rec:b --json >b.json
	[[ "$(key a.json rig)" == *,seed=1 && "$(key b.json rig)" == *,seed=2 ]]
	incise info day.rec:force=b,tracker=a --json >both.json
	[[ "$(key both.json rig)" == "a: sim:"*",seed=1; b: sim:"*",seed=2" ]]
	incise train day.rec:b -o b.fis >/dev/null
	incise info b.fis | grep -q 'seed=2'
	! incise info b.fis | grep -q 'seed=1' || false
	# MCAP begins with b's own events, 3 s after a's
	incise export day.rec:b -o b.mcap --profile ros2 >/dev/null
	grep -aq 'b: recording started' b.mcap
	! grep -aq 'a: recording started' b.mcap || false
}

# bats test_tags=check
@test "a stream of several machines needs a choice; the error lists them" {
	incise join a.rec b.rec -o day.rec >/dev/null
	for command in "export day.rec" "plot day.rec -o p.png" "train day.rec -o m.fis"; do
		# shellcheck disable=SC2086
		run -1 --separate-stderr incise $command
		[[ "$stderr" == *"day.rec: force was recorded by a and b; choose one: day.rec:a for all that it has, or day.rec:force=a" ]]
	done
	run -1 --separate-stderr incise export day.rec:z
	[[ "$stderr" == *"no member 'z'; there are: a, b" ]]
	run -1 --separate-stderr incise export day.rec:camera=a
	[[ "$stderr" == *"member a has no camera; it has: force, tracker" ]]
}

# bats test_tags=check
@test "join refuses what the clocks do not support, and writes nothing" {
	fails incise join a.rec b.rec -o day.rec --tolerance 10us -- "b.rec:"
	fails incise join a.rec none.rec -o day.rec -- "none.rec:"
	run --separate-stderr incise join a.rec b.rec -o day.rec --align sync
	failed_with "a.rec and b.rec: no event of the SYNC line; --align tap, or without --align"
	run --separate-stderr incise join a.rec a.rec -o day.rec
	failed_with "a.rec and a.rec: the same recording; give it once"
	[ ! -e day.rec ] && [ ! -e day.rec.part ]
	incise join a.rec b.rec -o day.rec >/dev/null
	fails incise join day.rec none.rec -o two.rec -- "day.rec:"
	fails incise join a.rec b.rec -o a.rec --overwrite -- "a.rec:"
	fails incise join a.rec b.rec -o day.rec -- "exists"
	incise join b.rec a.rec -o day.rec --overwrite >/dev/null
	incise info day.rec --json >info.json
	[ "$(key info.json 'members[0].name')" = b ]
}

# bats test_tags=check
@test "join names a recording that is damaged, and one that was interrupted" {
	sqlite3 b.rec/recording.db "UPDATE force SET code = code + 1 WHERE seq = 77"
	fails incise join a.rec b.rec -o day.rec -- "b.rec:"
	incise join a.rec b.rec -o day.rec --damaged 2>/dev/null >/dev/null
	run -1 --separate-stderr incise verify day.rec
	[[ "$output" == *"day.rec: b: "* ]]
	# a recorder that was killed: its last commit is there, and its folder has the name .part
	cp -r "$BATS_FILE_TMPDIR/b.rec" killed.rec.part
	sqlite3 killed.rec.part/recording.db "UPDATE meta SET value = 0 WHERE key = 'complete';
		DELETE FROM ledger; DELETE FROM blocks WHERE count = 0"
	run -0 --separate-stderr incise join a.rec killed.rec -o rest.rec
	[[ "$stderr" == *"warning: killed.rec.part: was interrupted; it is joined up to its last commit" ]]
	[[ "${lines[1]}" == "killed: force, tracker, 4.000 to 9.000 s, on "*", interrupted" ]]
	# one that is being recorded
	incise capture -o now.rec --rig sim:clock=real --duration 1h >/dev/null 2>&1 3>&- &
	pid=$!
	for ((i = 0; i < 600; i++)); do
		[ ! -e now.rec.part/recording.db ] || ! incise info now.rec >/dev/null 2>&1 || break
		sleep 0.1
	done
	run -1 --separate-stderr incise join a.rec now.rec -o rest2.rec --align tap
	kill -INT $pid
	wait $pid || :
	[[ "$stderr" == *"now.rec.part: is being recorded; wait for its end" ]]
	# one of them was removed
	cp -r day.rec lost.rec
	rm -r lost.rec/b
	run -1 --separate-stderr incise info lost.rec
	[[ "$stderr" == *"lost.rec: member b is missing in its folder; join again" ]]
	# what lies in it is checked for what was joined
	sqlite3 day.rec/b/recording.db "UPDATE seal SET head = zeroblob(32)"
	run -1 --separate-stderr incise export day.rec:a
	[[ "$stderr" == *"member b is not the recording that was joined"* ]]
}

@test "recordings of one machine have one clock, with or without wall time" {
	for name in one two; do
		incise capture -o $name.rec --rig "sim:clock=real,seed=1" --duration 200ms --camera off \
			--clock-source none >/dev/null
	done
	run -0 --separate-stderr incise join one.rec two.rec -o day.rec --tolerance 1ns
	[[ "${lines[2]}" == "  offset 0.000000000 s, rate +0.0000 ppm, uncertainty 0 ms, the same clock" ]]
	[[ "${lines[3]}" == "  no overlap with those before: a gap of "* ]]
	incise verify day.rec
	# another boot: its clock is another one
	sqlite3 two.rec/recording.db "UPDATE meta SET value = 'x' || value WHERE key = 'boot'"
	run -1 --separate-stderr incise join one.rec two.rec -o other.rec --damaged
	[[ "$stderr" == *"one.rec: has no wall time; align by a signal"* ]] || { echo "$stderr"; false; }
}

@test "an output with a slash behind it, on another file system, and of files behind links" {
	incise join a.rec b.rec -o day.rec/ >/dev/null
	incise join b.rec a.rec -o day.rec/ --overwrite >/dev/null
	incise info day.rec --json >info.json
	[ "$(key info.json 'members[0].name')" = b ]
	[ "$(ls -A | sort | tr '\n' ' ')" = "a.rec b.rec day.rec info.json none.rec " ]
	mkdir away && mv b.rec/recording.db away/ && ln -s ../away/recording.db b.rec/
	incise join a.rec b.rec -o links.rec >/dev/null
	rm -r away
	incise verify links.rec
	[ "$(stat -c %d /dev/shm)" != "$(stat -c %d .)" ] || skip "/dev/shm is on the same file system"
	shm=$(mktemp -d /dev/shm/incise-join.XXXXXX)
	incise join "$BATS_FILE_TMPDIR/a.rec" "$BATS_FILE_TMPDIR/b.rec" -o "$shm/day.rec" >/dev/null &&
		incise verify "$shm/day.rec" && code=0 || code=1
	rm -r "$shm"
	[ $code = 0 ]
}

@test "a gap costs no accuracy, and TAI is that of the machine" {
	incise capture -o late.rec --rig sim:clock=simulated,seed=9 --duration 1s \
		--clock-source sim:8000,50,30 >/dev/null
	run -0 --separate-stderr incise join a.rec late.rec -o day.rec
	# a's last row is at 6 s, the other's first at 7001.00005 s of a
	[ "${lines[3]}" = "  no overlap with those before: a gap of 6995.000 s" ]
	[[ "${lines[2]}" == *"uncertainty 0.05"*" ms, by clocks" ]]
	# without an overlap no cut has a force, whatever the depth
	run -1 --separate-stderr incise export day.rec:force=late,tracker=a -o none.csv
	[[ "$stderr" == *": no cut: no force was recorded while the blade was deeper than 0.3 mm (deepest "* ]]
	incise export --no-lineage day.rec:late --resample --rate 100 --tai -o joined.csv
	incise export --no-lineage late.rec --resample --rate 100 --tai -o alone.csv
	tai() { awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == "tai_ns") c = i }
		NR == 2 { print $c, $(c + 1) }' "$1"; }
	read -r joined bound <<<"$(tai joined.csv)"
	read -r alone _ <<<"$(tai alone.csv)"
	[ "$alone" = 8001000050000 ]
	[ $((joined - alone)) -le "$bound" ] && [ $((alone - joined)) -le "$bound" ]
	[ "$bound" -lt 200000 ]
}

@test "far from the other recording the bound is that of the clocks, not of a slew" {
	# a is 7000 s before the first one, whose clock is 50 ppm fast
	incise capture -o late.rec --rig sim:clock=simulated,seed=9 --duration 1s \
		--clock-source sim:8000,50,30 >/dev/null
	incise join late.rec a.rec -o day.rec >/dev/null
	incise info day.rec --json >info.json
	# 30 us of one, 20 us of the other, and once more 50 us of the map
	[ "$(key info.json wall.start.uncertainty_ns)" -lt 110000 ]
}

@test "join says which clock was not synchronised" {
	cp -r b.rec loose.rec
	sqlite3 loose.rec/recording.db "UPDATE wall SET uncertainty_ns = NULL"
	for pair in "a loose" "loose a"; do
		# shellcheck disable=SC2086
		set -- $pair
		run --separate-stderr incise join $1.rec $2.rec -o day.rec --damaged
		[ "$status" -eq 1 ]
		[[ "$stderr" == *"incise join: loose.rec: its clock was not synchronised"* ]] ||
			{ echo "$stderr"; false; }
	done
}

# Columns of a CSV by name, without those of uncertainties, which a joined recording has larger.
without_u() {
	awk -F, 'NR == 1 { for (i = 2; i <= NF; i++) if ($i !~ /_u_/) keep[++n] = i }
		{ for (i = 1; i <= n; i++) printf "%s%s", $keep[i], i < n ? "," : "\n" }' "$1"
}

@test "a force-only and a tracker-only recording give what one with both gives" {
	local rig=sim:clock=simulated,cut_s=2,pause_s=1,seed=4
	incise capture -o force.rec --rig $rig --duration 8s --only force \
		--clock-source sim:1000,0,20 >/dev/null
	incise capture -o tracker.rec --rig $rig --duration 8s --only tracker \
		--clock-source sim:1000,0,20 >/dev/null
	incise capture -o both.rec --rig $rig --duration 8s >/dev/null
	incise verify force.rec | grep -q 'force.rec: complete, and as it was written'
	incise verify tracker.rec | grep -q 'tracker.rec: complete, and as it was written'
	! incise verify tracker.rec | grep -q ^force
	# each is exported as far as it has streams; else the error gives the reason
	run -1 --separate-stderr incise export tracker.rec -o none.csv
	[[ "$stderr" == "incise export: tracker.rec: has no force channel, and this needs one; "* ]]
	run -1 --separate-stderr incise export tracker.rec --resample -o none.csv
	[[ "$stderr" == *"tracker.rec: has no force channel, "*"give --rate HZ"* ]]
	run -1 --separate-stderr incise info --dataset force.rec
	[[ "$stderr" == "incise info: force.rec: no cut: without a pose there is no depth; "* ]]
	incise export --no-lineage tracker.rec --resample --rate 100 -o poses.csv
	[ "$(tail -n +2 poses.csv | cut -d, -f17 | sort -u)" = nan ]
	[ "$(tail -n +2 poses.csv | grep -vc ',nan,nan,nan,0,0,nan')" -gt 790 ]
	for profile in ros2 plain; do
		incise export tracker.rec --profile $profile -o tracker.mcap --overwrite
		incise export force.rec --profile $profile -o force.mcap --overwrite
		grep -aqE '/(tip|tracker)' tracker.mcap && grep -aq /force force.mcap
		! grep -aq /force tracker.mcap || false
		! grep -aqE '/(tip|tracker|depth)' force.mcap || false
	done
	# the stream of each is that of the only machine that has it
	incise join force.rec tracker.rec -o day.rec --tolerance 0.1ms >/dev/null
	incise export --no-lineage day.rec --resample --rate 100 -o day.csv
	incise export --no-lineage both.rec --resample --rate 100 -o both.csv
	cmp <(without_u day.csv) <(without_u both.csv)
	[ "$(wc -l <day.csv)" -eq 801 ]
	# and the loop runs on it: the same force to the bit on the clock of the tracker
	incise train both.rec -o m.fis >/dev/null 2>&1
	sed 's|model = .*|model = "m.fis";|' "$BATS_TEST_DIRNAME/../../scenes/liver.scene" >liver.scene
	incise join tracker.rec force.rec -o tracked.rec >/dev/null
	incise replay both.rec liver.scene | tail -n +2 >alone
	incise replay tracked.rec:force=force,tracker=tracker liver.scene | tail -n +2 >joined
	diff alone joined
	run -1 --separate-stderr incise replay force.rec liver.scene
	[[ "$stderr" == "incise replay: force.rec: no pose to replay: it has no row of a tracker; join it "* ]]
	incise export --no-lineage day.rec -a 6x5 -o pairs.csv
	incise export --no-lineage both.rec -a 6x5 -o both_pairs.csv
	cmp pairs.csv both_pairs.csv
}

@test "cuts without a tap in common are not aligned by chance" {
	local rig=sim:clock=simulated,times=2,depth_mm=5 pair seed
	for seed in 1 2 4; do
		incise capture -o n$seed.rec --rig $rig,seed=$seed >/dev/null
	done
	# each of them has marks by the dozen, of which 4 or 5 match at some offset
	for pair in "1 2" "1 4" "2 4"; do
		read -r one other <<<"$pair"
		run --separate-stderr incise join n$one.rec n$other.rec -o day.rec --align tap
		failed_with "n$one.rec and n$other.rec: "
		[[ "$stderr" == *"tap at least three times in an irregular rhythm"* ]]
	done
}
