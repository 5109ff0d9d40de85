# SPDX-License-Identifier: GPL-2.0-or-later
# incise haptic, as a user meets it. In simulated time it runs as fast as it goes.

load cli

setup_file() {
	cd "$BATS_FILE_TMPDIR"
	made_pairs >pairs.csv
	incise train pairs.csv -o liver.fis 2>/dev/null
}

setup() {
	work_folder
	cp "$BATS_FILE_TMPDIR/liver.fis" .
	smooth_liver
	# contact from 0.1 s on
	quick=sim:clock=simulated,depth_mm=10,times=1,pause_s=0.1,cut_s=4
}

teardown() {
	[ -z "$pid" ] || kill -9 "$pid" 2>/dev/null || :
}

# The scene bad.scene is refused with these texts; nothing is printed.
refuses() {
	run --separate-stderr incise haptic bad.scene --rig $quick --duration 1s -o l.csv
	failed_with "$@" || return
	[ -z "$output" ] || complain "printed: $output" || return
	[ ! -e l.csv ] || complain "wrote a log"
}

@test "haptic runs a scene in simulated time" {
	run -0 --separate-stderr incise haptic liver.scene --rig $quick --duration 3s
	[ -z "$stderr" ]
	[[ "${lines[0]}" == "3000 ticks at 1000 Hz, 0 missed deadlines"* ]]
	[[ "${lines[1]}" =~ ^stages\ +pose\ predict\ contact\ reaction\ fracture\ start\ limit\ actuate$ ]]
}

# bats test_tags=check
@test "haptic reports as JSON" {
	incise haptic liver.scene --rig $quick --duration 3s --json -o l.csv >r.json
	[ "$(key r.json ticks)" = 3000 ]
	[ "$(key r.json skipped)" = 0 ]
	[ "$(key r.json rate_hz)" = 1000.0 ]
	[ "$(key r.json stages)" = '["pose","predict","contact","reaction","fracture","start","limit","actuate"]' ]
	[ -z "$(key r.json stopped_by)" ]
	[ "$(key r.json scheduling)" = "simulated time" ]
	for name in lateness_us tick_ns; do # time stands still during a tick: null
		run -0 key r.json $name
		[ -z "$output" ]
	done
	[ "$(key r.json extrapolated)" = "$(cut -d, -f9 l.csv | grep -c '^.e')" ]
	[ "$(key r.json stale)" = "$(cut -d, -f9 l.csv | grep -c '^..s')" ]
	# the report is that of the log
	[ "$(key r.json contact)" = "$(cut -d, -f9 l.csv | grep -c ^c)" ]
	[ "$(key r.json limited)" = "$(cut -d, -f9 l.csv | grep -cE '^...o|^.....v')" ]
	[ "$(key r.json flags.starting)" = "$(cut -d, -f9 l.csv | grep -c '^........r')" ]
	[ "$(key r.json flags.contact)" = "$(key r.json contact)" ]
	holds "$(key r.json contact) > 1000"
	largest=$(awk -F, 'NR > 1 && $7 > m { m = $7 } END { print m }' l.csv)
	# the log has five decimals
	holds "($(key r.json force_max_N) - $largest)^2 < 1e-10"
	# a spring of 2 N/mm and a nut with 0.6 um steps: it follows within a few percent
	holds "$(key r.json rendered_rms_error_N) < 0.05 * $largest"
}

# no_force SURFACE_MM TEXT: a tool that stays at 1 mm, over or in a wall, gives no force and says why
no_force() {
	grep -v '^#' "$root/scenes/wall.scene" >w.scene
	echo "surface = { kind = \"plane\"; point_mm = [0.0, 0.0, $1]; normal = [0.0, 0.0, 1.0]; };" >>w.scene
	incise haptic w.scene --rig "sim:clock=simulated,pause_s=2" --duration 1s >text
	grep -Fqx "no force   $2" text || complain "$(cat text)"
	incise haptic w.scene --rig "sim:clock=simulated,pause_s=2" --duration 1s --json >r.json
	[ "$(key r.json no_force)" = "$2" ]
}

# bats test_tags=check
@test "haptic says why there was no force" {
	no_force -7.0 "no contact: the tool came no nearer to the tissue than 8.0 mm"
	# of 1000 ticks four have no pose yet, as the simulated tracker is late
	no_force 8.0 "996 ticks in contact, 996 of them while the loop waited for a small force, as out of the tissue"
	incise haptic liver.scene --rig $quick --duration 3s >text
	! grep "^no force" text
	incise haptic liver.scene --rig $quick --duration 3s --json >r.json
	run -0 key r.json no_force
	[ -z "$output" ]
}

@test "the log has every tick, and its forces are the model's" {
	# but for that along the cut
	sed -i 's/fracture_J_m2 = .*;/fracture_J_m2 = 0.0;/' liver.scene
	incise haptic liver.scene --rig $quick --duration 3s --arith double -o l.csv
	[ "$(head -n 1 l.csv)" = \
		t_s,x_mm,y_mm,z_mm,depth_mm,velocity_mm_s,command_N,rendered_N,flags,phase,command_x_N,command_y_N,command_z_N,tool ]
	[ "$(wc -l <l.csv)" -eq 3001 ]
	awk -F, 'NR > 1 && ((NR - 2) / 1000 - $1)^2 > 1e-12 { exit 1 }' l.csv
	# depth below the plane z = 0; a contact ends 0.2 mm above it
	awk -F, 'NR > 1 && $9 ~ /^c/ { want = $4 < 0 ? -$4 : 0
		if (($5 - want)^2 > 1e-8 || $4 > 0.2001) exit 1 }' l.csv
	awk -F, 'NR > 1 && (($9 ~ /^c/) != ($10 == "cutting")) { exit 1 }' l.csv
	beside_the_model l.csv >both
	# depth and velocity are logged to 0.1 um and 1 um/s
	awk '$3 > $4 + 1e-4 || $3 < -0.1 * $4 - 1e-4 { print; exit 1 }' both
	# the way out unloads; the cut is most of the time
	holds "$(awk '($3 - $4)^2 < 1e-8' both | wc -l) > 0.8 * $(wc -l <both)"
	holds "$(awk '$3 < $4 - 1e-3' both | wc -l) > 10"
	# a heavily damped device rests with the paper's law, both ways
	{
		sed 's/^tissue = {/& withdrawal = "paper";/' liver.scene
		echo 'device = { damping_N_s_mm = 0.05; };'
	} >paper.scene
	incise haptic paper.scene --rig $quick --duration 3s --arith double -o p.csv
	beside_the_model p.csv >both
	awk '($3 - $4)^2 > 1e-8 { print; exit 1 }' both
}

# Depth, speed, force of a log's ticks in contact that nothing limits, and the model's force.
beside_the_model() {
	awk -F, '$9 ~ /^c-/ && $9 !~ /[ovr]/ && $5 > 0 { print $5, $6, $7 }' "$1" >contact
	[ "$(wc -l <contact)" -gt 1000 ]
	cut -d' ' -f1,2 contact | incise eval liver.fis 2>/dev/null | paste -d' ' contact - |
		awk '{ print $1, $2, $3, $4 < 0 ? 0 : $4 }'
}

@test "fixed point and double feel alike" {
	incise haptic liver.scene --rig $quick --duration 2s --arith double -o double.csv
	incise haptic liver.scene --rig $quick --duration 2s --arith fixed -o fixed.csv
	# what was promised is 1 mN; they are not the same, so two arithmetics ran
	paste -d, double.csv fixed.csv | awk -F, '
		NR > 1 { e = $7 - $21; if (e < 0) e = -e; if (e > m) m = e }
		END { print m; exit !(m < 1e-3 && m > 0) }'
	# the scene says fixed
	incise haptic liver.scene --rig $quick --duration 2s -o scene.csv
	cmp fixed.csv scene.csv
}

@test "haptic runs at the scene's rate, with another model" {
	printf 'rate_hz = 250;\nmodel = "none.fis";\n' >slow.scene
	incise haptic slow.scene --rig $quick --duration 2s --model liver.fis --json >r.json
	[ "$(key r.json ticks)" = 500 ]
	[ "$(key r.json rate_hz)" = 250.0 ]
}

@test "a scene's model lies beside it; a scene may leave all else out" {
	mkdir there
	mv liver.fis there
	echo 'model = "liver.fis";' >there/small.scene
	incise haptic there/small.scene --rig $quick --duration 100ms
	echo '# nothing' >there/empty.scene
	incise haptic there/empty.scene --rig $quick --duration 100ms --model there/liver.fis
	run --separate-stderr incise haptic there/empty.scene --rig $quick --duration 100ms
	failed_with there/empty.scene model
}

@test "in real time it keeps to the clock, and SIGINT ends it with the report" {
	begin=$(uptime_ms)
	incise haptic liver.scene --rig sim: --no-rt --overruns 0 --state page --json >r.json 2>err 3>&- &
	pid=$!
	# a signal before the program listens would not be the case in question
	for ((i = 0; i < 9600; i++)); do
		ticks=$(incise status ./page --prometheus 2>/dev/null | sed -n 's/^incise_loop_ticks_total{.*} //p')
		[ "${ticks:-0}" -lt 200 ] || break
		sleep 0.05
	done
	kill -INT $pid
	wait $pid # its exit status is 0
	pid=
	# to the 10 ms of either
	elapsed=$(($(uptime_ms) - begin + 20))
	[ ! -s err ]
	[ "$(key r.json stopped_by)" = Interrupt ]
	# due ticks run or are skipped
	due=$(($(key r.json ticks) + $(key r.json skipped)))
	holds "$(key r.json ticks) >= 200 && $due <= $elapsed"
	[ "$(sqlite3 :memory: "SELECT sum(json_extract(value, '\$[1]')) FROM
		json_each(readfile('r.json'), '\$.lateness_us.histogram')")" = "$(key r.json ticks)" ]
	holds "$(key r.json lateness_us.max) > 0 && $(key r.json tick_ns.max) > 0"
	for name in lateness_us.median lateness_us.p99 lateness_us.p999 tick_ns.median \
		tick_ns.p999; do
		key r.json $name # there; null on a machine that is later than its histogram
	done
	[[ "$(key r.json scheduling)" == SCHED_* ]]
}

@test "a log that cannot be is said before the run, and so is one that does not fit" {
	fails incise haptic liver.scene --rig sim: --no-rt --duration 1h -o none/l.csv -- none/l.csv
	# the most ticks that there can be: 1.7 billion of some 200 bytes
	sed 's/^rate_hz.*/rate_hz = 20000.0;/' liver.scene >quick.scene
	[ "$(awk '/^MemTotal/ { print $2 }' /proc/meminfo)" -lt 600000000 ] || skip "the longest log fits"
	run --separate-stderr incise haptic quick.scene --rig sim: --no-rt --duration 24h \
		-o l.csv
	failed_with l.csv --duration
	[ ! -e l.csv ]
}

# bats test_tags=check
@test "haptic: files that are not there, or not what they should be" {
	fails incise haptic none.scene --rig $quick -- none.scene "No such file"
	fails incise haptic . --rig $quick -- "Is a directory"
	printf 'model = "none.fis";\n' >bad.scene
	refuses none.fis "No such file"
	head -n 30 liver.fis >cut.fis
	printf 'model = "cut.fis";\n' >bad.scene
	refuses cut.fis
	# an input that no loop has
	awk 'BEGIN { print "depth_m,force_N"; for (i = 0; i < 40; i++) print i ",", i }' |
		tr -d ' ' | sed 's/,,/,/' >one.csv
	incise train one.csv --inputs depth_m -o one.fis 2>/dev/null
	printf 'model = "one.fis";\n' >bad.scene
	refuses bad.scene "'depth_m', which a loop does not have; did you mean depth_mm: expected some of depth_mm, "
}

# bats test_tags=check
@test "haptic: rigs that cannot be" {
	fails incise haptic liver.scene --rig sim:colour=red -- colour
	fails incise haptic liver.scene --rig none.conf -- none.conf "No such file"
	printf 'clock = "simulated";\ntracker = "sim:";\n' >rig.conf
	fails incise haptic liver.scene --duration 100ms -- rig.conf stepper
	echo 'stepper = "sim:";' >>rig.conf
	incise haptic liver.scene --duration 100ms # ./rig.conf is the default
	rm rig.conf
	[ ! -e /etc/incise/rig.conf ] || skip "this machine has /etc/incise/rig.conf"
	fails incise haptic liver.scene -- "--rig sim:"
}

@test "haptic: a full disk loses the log, not the summary of the run" {
	run --separate-stderr incise haptic liver.scene --rig $quick --duration 1s -o /dev/full
	failed_with /dev/full "No space left"
	[[ "$output" == *"1000 ticks at 1000 Hz"* && "$output" == *"force      largest"* ]] ||
		complain "$output"
	run --separate-stderr incise haptic liver.scene --rig $quick --duration 1s -o /dev/full --json
	failed_with /dev/full "No space left"
	[ "$(jq .ticks <<<"$output")" = 1000 ]
}

@test "the log to standard output is all that is there" {
	incise haptic liver.scene --rig $quick --duration 200ms -o - >out
	incise haptic liver.scene --rig $quick --duration 200ms -o l.csv >report
	cmp out l.csv
	[ -s report ]
}

@test "an @include is refused by line, a folder's too" {
	mkdir folder
	printf 'rate_hz = 1000.0;\n  @include "folder"\n' >inc.scene
	fails incise haptic inc.scene --rig sim: -- "inc.scene:2: " "@include"
}

# A blade that is turned towards its way, so that its plane constraint pulls aside.
turned_blade() {
	cat >side.scene <<-END
		tissue = { reaction_N_mm = 0.1; plane_N_mm = 0.05; };
		tool = { side = [0.6, 0.8, 0.0]; };
	END
	cut=sim:clock=simulated,depth_mm=10,times=1,pause_s=0.5,cut_s=2,tracker_noise_mm=0
}

@test "the report names what is felt and what is not" {
	turned_blade
	run -0 --separate-stderr incise haptic side.scene --rig $cut,axes=2 --duration 2s
	[[ "$output" =~ felt\ +along\ \(0,\ 0,\ 1\),\ along\ \(0,\ 1,\ 0\)\;\ not\ felt:\ 0\.[0-9]*[1-9] ]]
}
