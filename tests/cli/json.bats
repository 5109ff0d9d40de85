# SPDX-License-Identifier: GPL-2.0-or-later
# --json of every command against its JSON Schema, the manual against the schemas. Those of the
# benchmarks are in bench_all.bats, which makes their reports.

load cli

# A report of each command, COMMAND.VARIANT.json: report COMMAND.VARIANT ARGUMENT…
report() {
	local name=$1 status=0
	shift
	incise "$@" --json >"out/$name.json" 2>err </dev/null || status=$?
	# 1: a calibration that is due, for example; the report is there all the same
	if [ "$status" -gt 1 ] || [ ! -s "out/$name.json" ]; then
		complain "incise $*: exit $status: $(cat err)"
	fi
}

models() {
	made_pairs >pairs.csv
	printf '5 20\n' >points
	report train train pairs.csv -o m.fis
	incise capture -o tooth.rec --rig sim:clock=simulated,cut_s=4,pause_s=0.1,times=4,force_hz=1000 --camera off >/dev/null
	report train.texture train tooth.rec -o t.fis --texture
	report info.texture info t.fis.tex
	report info.textured info t.fis
	report train.groups train pairs.csv -o g.fis --group cut --check 0.3
	incise train <(many_pairs 8) --premises m.fis --group cut -o m.fac >/dev/null
	report merge merge m.fac -o merged.fis
	report eval eval m.fis points
	report eval.sd eval m.fis points --uncertainty total
	report compile compile m.fis -o m.fx
	report compile.scene compile liver.scene -o liver.plan
	report info.model info m.fis
	report info.compiled info m.fx
	report info.plan info liver.plan
	report info.devices info devices
	report info.scene info "$root/scenes/neck.scene" --all
	report info.rig info sim:seed=3
	report info.factor info m.fac
	report info.dataset info --dataset pairs.csv --group cut
}

recordings() {
	report capture capture -o a.rec --rig "$short"
	report info.recording info a.rec
	report verify verify a.rec
	report serve serve a.rec --igtl 0 --duration 300ms
	cp -r a.rec b.rec
	sqlite3 b.rec/recording.db "DELETE FROM tracker WHERE rowid = 5"
	report verify.findings verify b.rec
	ssh-keygen -q -t ed25519 -N "" -f key
	report sign sign a.rec --key key
	incise export a.rec --rate 10 -o lineage.csv
	report provenance provenance lineage.csv
	report sign.query sign a.rec --timestamp q.tsq
	report verify.signed verify a.rec --signers <(echo "kim@lab $(cat key.pub)")
	for i in 1 2; do
		incise capture -o j$i.rec --rig sim:clock=simulated,seed=$i --duration 1s \
			--clock-source sim:1000,0,20 >/dev/null
	done
	report join join j1.rec j2.rec -o joined.rec
	report info.joined info joined.rec
	report export export a.rec -o a.csv
	echo 'force_mV_N = 1234.0;' >new.conf
	report recalibrate recalibrate a.rec -c new.conf
	report recover recover a.rec -o recovered.rec
	report replay replay a.rec liver.scene
	report replay.real_time replay a.rec liver.scene --real-time
}

loops() {
	report plan plan liver.scene
	printf 'v 0 0 0\nv 40 0 0\nv 0 40 0\nf 1 2 3\n' >open.obj
	printf 'surface = { kind = "mesh"; file = "open.obj"; };\ntissue = { reaction_N_mm = 0.1; };\n' >open.scene
	report plan.open plan open.scene
	report plan.rig plan neck.scene --rig "$short"
	report haptic haptic neck.scene --rig "$short" --duration 4s -o s.session
	report haptic.real_time haptic liver.scene --rig sim: --no-rt --overruns 0 --duration 1s
	cp s.session out/session.json
	report assess assess s.session
	report assess.reference assess s.session --reference s.session
	# The kernel module is not here: the report is that of haptic, under another name.
	sed 's|"incise/haptic/1"|"incise/feed/1"|' out/haptic.json >out/feed.json
}

running_loop() {
	local i loop
	incise haptic neck.scene --rig sim: --no-rt --overruns 0 --duration 1h --state neck.state >/dev/null 2>&1 3>&- &
	loop=$!
	for ((i = 0; i < 600; i++)); do
		! incise status ./neck.state 2>/dev/null | grep -q running || break
		sleep 0.1
	done
	report status status ./neck.state
	report tool tool ./neck.state handle
	incise status ./neck.state --follow --json >out/status.follow.json 3>&- &
	follow=$!
	await test -s out/status.follow.json
	# which ends the other as well
	kill -TERM $loop
	wait $loop $follow || :
}

devices() {
	printf 'tracker = "sim:";\n' >rig.conf
	report info.here info rig --all
	rm rig.conf
	report init init lab --preset sim --yes --no-calibration
	report doctor doctor --rig "$short"
	for action in status disable clear "move 2mm" "enable --duration 1s"; do
		# shellcheck disable=SC2086 # "move 2mm" is two words
		report "stepper.${action%% *}" stepper $action --rig "$short"
	done
	incise stepper status --follow --duration 1s --rig "$short" --json >out/stepper.follow.json
}

calibrations() {
	report calibrate-force calibrate force --weights 50g,100g,0.15kg,200g,300g --zero \
		--rig sim:clock=simulated,force_zero_mV=160
	report calibrate-depth calibrate depth two-point --length 47.5mm --pixels 400
	report calibrate-tip calibrate tip --duration 20s -o poses.csv \
		--rig sim:clock=simulated,motion=1,tip_x_mm=3,tip_y_mm=-20,tip_z_mm=60
	report calibrate-delay calibrate delay --rig sim:clock=simulated,motion=2 --duration 15s
	report calibrate-stepper calibrate stepper -o points.csv \
		--rig sim:clock=simulated,bench=1,handle_friction_N=0,backlash_mm=0.04,stall_mm_s=9
	report calibrate-stepper.from calibrate stepper --from points.csv --dry-run
	printf '%s\n' x_mm,y_mm,z_mm,device_x_mm,device_y_mm,device_z_mm 0,0,0,0,0,10 60,0,0,60,0,10 \
		0,50,0,0,50.1,10 20,20,40,20,20,50 >touched.csv
	report calibrate-frame calibrate frame --from touched.csv -c framed.conf
	report calibrate-torque calibrate torque --rig sim:haptic,clock=simulated,motion=still,hand_N_mm=0,coulomb_N=0.1
	report calibrate-check calibrate check
	echo 'force_mV_N = 1240.0;' >none.conf
	report calibrate-check.none calibrate check -c none.conf --only force
}

setup_file() {
	cd "$BATS_FILE_TMPDIR"
	export XDG_RUNTIME_DIR=$PWD/run
	mkdir -p run out
	cp "$root"/scenes/* .
	short=sim:clock=simulated,depth_mm=6,times=1,pause_s=1,cut_s=4
	models
	recordings
	loops
	running_loop
	devices
	calibrations
	[ ! -x "$INCISE_BUILD/bin/incise-view" ] ||
		report view view neck.scene --procedure -o fr --rate 2 --duration 1s --size 160x120
	! command -v gnuplot >/dev/null || report demo demo -o demo --duration 1s
}

setup() {
	work_folder
	out=$BATS_FILE_TMPDIR/out
	# that of Debian where the first one in PATH has no validator
	for python in python3 /usr/bin/python3; do
		! "$python" -c "import jsonschema" 2>/dev/null || return 0
	done
	skip "python3-jsonschema is not installed"
}

schemas() {
	run "$python" "$root/tests/cli/json_schema.py" "$@"
}

# Commands that have --json: "calibrate-force"; and benchmarks: "bench-loop".
commands() {
	local program
	for program in "$INCISE_BUILD"/bin/incise-*; do
		! "$program" --help | grep -q -e ' --json ' || echo "${program##*/incise-}"
	done
	incise bench --help | sed -n '/^Options/q; s/^  \([a-z]\+\) .*/bench-\1/p'
	echo bench-compare
}

@test "the schemas are valid, allow no unknown key, and say the unit of each number" {
	schemas --check "$INCISE_BUILD/schema"
	[ "$status $output" = "0 " ] || complain "$output"
}

@test "every command that has --json has a schema, and every schema has such a command" {
	# bench itself prints what its benchmarks do; a session is a file
	diff <(commands | grep -vx bench | sort -u) \
		<(cd "$INCISE_BUILD/schema" && printf '%s\n' *.json | sed 's/\.json$//' | grep -vx -e bench -e session)
}

@test "what every command prints agrees with its schema" {
	schemas "$INCISE_BUILD/schema" "$out"/*.json
	[ "$status $output" = "0 " ] || complain "$output"
	# none is left out, but what needs gnuplot or OpenGL
	(cd "$out" && printf '%s\n' *.json | sed 's/\..*//' | sort -u) >have
	commands | grep -v '^bench' | sort -u >commands
	[ -z "$(comm -13 have commands | grep -vx -e demo -e view)" ] || complain "$(comm -13 have commands)"
	# lines of --follow, each with its schema
	for file in status.follow stepper.follow; do
		[ "$(grep -c '^{"schema":"incise/' "$out/$file.json")" = "$(wc -l <"$out/$file.json")" ]
		[ -s "$out/$file.json" ]
	done
}

@test "a key more and a key less are found, and so is another type" {
	(cd "$out" && ls -- *.json | grep -v -e follow -e demo) >files
	mapfile -t files < <(sed "s|^|$out/|" files)
	schemas --mutate "$INCISE_BUILD/schema" "${files[@]}"
	[ "$status $output" = "0 " ] || complain "$output"
	sed 's/"pairs": [0-9]*,/"pairs": "many",/' "$out/merge.json" >wrong.json
	schemas "$INCISE_BUILD/schema" wrong.json
	[[ "$status $output" == "1 wrong.json: "*"'many' is not of type 'integer'"* ]]
	sed 's|incise/merge/1|incise/merge/2|' "$out/merge.json" >wrong.json
	schemas "$INCISE_BUILD/schema" wrong.json
	[ "$status $output" = "1 wrong.json: schema: 'incise/merge/1' was expected" ]
	sed '/"schema"/d' "$out/merge.json" >wrong.json
	schemas "$INCISE_BUILD/schema" wrong.json
	[ "$status $output" = "1 wrong.json: no schema is named" ]
}

@test "the manual names every key of the schemas" {
	schemas --manual "$INCISE_BUILD/schema" "$INCISE_BUILD"/man/*.[1-8]
	[ "$status $output" = "0 " ] || complain "$output"
}
