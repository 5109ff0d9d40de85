# SPDX-License-Identifier: GPL-2.0-or-later
# incise info, as a user meets it.

load cli

setup_file() {
	cd "$BATS_FILE_TMPDIR"
	made_pairs >pairs.csv
	incise train pairs.csv -o m.fis 2>/dev/null
	incise train pairs.csv --search type=gbellmf --mf 2,2 -o bell.fis 2>/dev/null
	incise capture -o a.rec --rig sim:clock=simulated,depth_mm=5,times=2,cut_s=1,pause_s=0.6 \
		>/dev/null
}

setup() {
	work_folder
	ln -s "$BATS_FILE_TMPDIR"/*.fis "$BATS_FILE_TMPDIR/a.rec" .
}

# bats test_tags=check
@test "info of a scene and of a rig: the keys that are given, and with --all the defaults" {
	printf 'tissue = {\n  reaction_N_mm = 0.1; };\n' >a.scene
	run -0 --separate-stderr incise info a.scene
	[ "${#lines[@]}" -eq 2 ]
	[[ "${lines[1]}" =~ ^"tissue.reaction_N_mm "+"0.1 N/mm "+"a.scene:2"$ ]]
	run -0 --separate-stderr incise info a.scene --all
	[[ "$output" =~ $'\n'"limits.force_N "+"4 N "+"default" ]]
	[[ "$output" != *membrane* ]]
	echo 'criteria = { cut_length_mm = [1, 2]; };' >>a.scene
	incise info a.scene --all | grep -Eq '^criteria.membrane +- +default$'
	printf 'sim = { seed = 3; };\n' >rig.conf
	for rig in rig rig.conf sim:seed=3; do
		incise info "$rig" --json >r.json
		[ "$(key r.json kind)" = rig ]
		incise info "$rig" | grep -Eq '^sim.seed +3 '
	done
	run -2 --separate-stderr incise info m.fis --all
	[[ "$stderr" == *"--all goes with a rig or a scene"* ]]
}

@test "info of a model" {
	run -0 --separate-stderr incise info m.fis
	[ -z "$stderr" ]
	[[ "${lines[0]}" == "model incise: 20 rules, 2 inputs, output force_N "* ]]
	[[ "$output" == *"input depth_mm, support 0 to 20"* ]]
	[[ "$output" == *"input velocity_mm_s, support 0 to 50"* ]]
	[[ "${lines[-1]}" == "fixed point: "*", error certified to "*" mN" ]]
	[ "$(grep -c gaussmf <<<"$output")" -eq 9 ]
	[[ "$output" == *"rules by prod "* ]]
	[[ "$output" != *weight* ]] # all are 1
}

# bats test_tags=check
@test "info of a model with min and weights" {
	sed "s/^AndMethod='prod'/AndMethod='min'/; s/^5 4, 20 (1)/5 0, 20 (0.25)/" m.fis >min.fis
	run -0 --separate-stderr incise info min.fis
	[[ "$output" == *"rules by min "* ]]
	[ "$(grep -c weight <<<"$output")" -eq 1 ]
	[[ "${lines[-2]}" == "   5  0:"*"  weight 0.25" ]]
	incise info min.fis --json >r.json
	[ "$(key r.json and_method)" = min ]
	[ "$(key r.json 'rules[19].weight')" = 0.25 ]
	[ "$(key r.json 'rules[18].weight')" = 1.0 ]
	[ "$(key r.json 'rules[19].mfs')" = "[5,0]" ]
	[[ "$(key r.json fixed_point_refused)" == *min* ]]
}

# bats test_tags=check
@test "info of a model as JSON" {
	incise info --json m.fis >r.json
	[ "$(key r.json kind)" = model ]
	[ "$(key r.json 'inputs[0].name')" = depth_mm ]
	[ "$(key r.json 'inputs[1].max')" = 50.0 ]
	[ "$(key r.json 'inputs[1].mfs[3].type')" = gaussmf ]
	[ "$(key r.json output.name)" = force_N ]
	[ "$(key r.json and_method)" = prod ]
	[ "$(key r.json fixed_point)" = 1 ] # true
	[ -z "$(key r.json fixed_point_refused)" ]
	# what incise compile makes of it
	incise compile m.fis -o m.fx --json >c.json
	for name in arithmetic cells size_bytes bound_N; do
		[ "$(key r.json fixed_point_$name)" = "$(key c.json $name)" ]
	done
	[ "$(sqlite3 :memory: "SELECT json_array_length(readfile('r.json'), '\$.rules')")" = 20 ]
	# the file's last rule: functions 5 and 4, the constant first (12 digits are printed)
	[ "$(key r.json 'rules[19].mfs')" = "[5,4]" ]
	constant=$(sed -n "s/^MF20='out1mf20':'linear',\[.* \(.*\)\]/\1/p" m.fis)
	holds "($(key r.json 'rules[19].consequent[0]') / $constant - 1)^2 < 1e-20"
	# and the width of its first function
	width=$(sed -n "s/^MF1='very_shallow':'gaussmf',\[\(.*\) .*\]/\1/p" m.fis)
	holds "($(key r.json 'inputs[0].mfs[0].params[0]') / $width - 1)^2 < 1e-20"
}

@test "info says why a model has no fixed point" {
	run -0 incise info bell.fis
	[[ "${lines[-1]}" == "fixed point: "*gbellmf* ]]
	incise info bell.fis --json >r.json
	[ "$(key r.json fixed_point)" = 0 ]
	[[ "$(key r.json fixed_point_refused)" == *gbellmf* ]]
	[ -z "$(key r.json fixed_point_bound_N)" ]
	[ "$(sqlite3 :memory: "SELECT json_array_length(readfile('r.json'),
		'\$.inputs[0].mfs[0].params')")" = 3 ]
}

@test "info of a compiled model" {
	for kind in direct table force; do
		incise compile m.fis -o m.fx --overwrite --method $kind --budget 10mN --json >c.json
		run -0 --separate-stderr incise info m.fx
		[ -z "$stderr" ]
		[ "${lines[0]}" = "compiled model incise: 20 rules, 2 inputs, output force_N" ]
		[[ "${lines[1]}" == "input depth_mm, support 0 to 20, 5 functions"* ]]
		[[ "${lines[2]}" == "input velocity_mm_s, support 0 to 50, 4 functions"* ]]
		[[ "${lines[3]}" == "formats  inputs and output Q16.16, "* ]]
		[[ "${lines[4]}" == "fixed point: $kind, "*" bytes, error certified to "*" mN" ]]
		incise info --json m.fx >r.json
		[ "$(key r.json kind)" = compiled ]
		[ "$(key r.json name)" = incise ]
		[ "$(key r.json 'inputs[1].name')" = velocity_mm_s ]
		[ "$(key r.json 'inputs[1].max')" = 50.0 ]
		[ "$(key r.json 'inputs[0].n_mfs')" = 5 ]
		[ "$(key r.json output.name)" = force_N ]
		[ "$(key r.json n_rules)" = 20 ]
		holds "$(key r.json 'format_bits[0]') >= 17"
		for name in arithmetic size_bytes bound_N; do
			[ "$(key r.json $name)" = "$(key c.json $name)" ]
		done
	done
	[ "$(key r.json cells)" = "$(key c.json cells)" ]
	head -c 1000 m.fx >short.fx
	fails incise info short.fx -- short.fx
}

@test "names that are not UTF-8 leave JSON valid" {
	sed "s/Name='incise'/Name='li\xffver'/" m.fis >odd.fis
	incise info --json odd.fis >r.json
	[ "$(key r.json name)" = "li?ver" ]
	incise compile odd.fis -o odd.fx >/dev/null
	incise info --json odd.fx >r.json
	[ "$(key r.json name)" = "li?ver" ]
}

# bats test_tags=check
@test "info of a recording that was altered shows it, and fails by its name" {
	cp -r a.rec/ b.rec
	# of a complete recording no sample is read, which it says
	sqlite3 b.rec/recording.db "UPDATE tracker SET z_mm = z_mm + 1 WHERE seq = 100"
	run -0 --separate-stderr incise info b.rec
	[[ "$output" == *"samples  not read: 'incise verify b.rec' proves them"* ]]
	run -1 incise verify b.rec
	incise info b.rec --json >r.json
	[ "$(key r.json summary)" = 1 ]
	# by another calibration all are
	printf 'force_mV_N = 1200\n' >c.conf
	cp -r b.rec c.rec
	incise recalibrate c.rec -c c.conf >/dev/null 2>&1
	fails incise info c.rec -- "c.rec: not as it was recorded: tracker: block"
	sqlite3 b.rec/recording.db "UPDATE events SET text = 'x' WHERE kind = 'zero'"
	fails incise info b.rec -- "b.rec:"
	[[ "${lines[0]}" == "recording b.rec: "* ]]
	run -1 --separate-stderr incise info b.rec --json
	echo "$output" >r.json
	[ "$(key r.json intact)" = 0 ]
	run -0 --separate-stderr incise info b.rec --damaged
	[[ "$stderr" == "incise info: warning: b.rec: not as it was recorded: table events is altered"* ]]
	incise info a.rec --json >r.json
	[ "$(key r.json intact)" = 1 ]
}

# bats test_tags=check
@test "info of a recording as JSON is what the database holds" {
	incise info --json a.rec >r.json
	[ "$(key r.json kind)" = recording ]
	[ "$(key r.json complete)" = 1 ]
	[ "$(key r.json cuts)" = 2 ]
	for table in force tracker depth; do
		[ "$(key r.json rows.$table)" = \
			"$(sqlite3 -readonly a.rec/recording.db "SELECT count(*) FROM $table")" ]
	done
	[ "$(key r.json lost.force)" = 0 ]
	[ "$(key r.json adc.bits)" = 12 ]
	[ "$(key r.json adc.full_scale_V)" = 5.0 ]
	[ "$(key r.json adc.offset_V)" = 0.0 ]
	[ "$(key r.json calibration.force_mV_N)" = 1240.0 ]
	[ "$(key r.json rig)" = "sim:clock=simulated,depth_mm=5,times=2,cut_s=1,pause_s=0.6" ]
	# two cuts of 1 s and three pauses of 0.6 s
	holds "($(key r.json seconds) - 3.8)^2 < 0.05^2"
	# nominally 5 mm
	holds "$(key r.json depth_max_mm) > 4 && $(key r.json depth_max_mm) < 6.5"
	holds "$(key r.json force_max_N) > 0.1 && $(key r.json force_max_N) < 2"
}

@test "info of a recording of one stream has its depth and cuts, and no line of another" {
	local rig=sim:clock=simulated,depth_mm=5,times=2,cut_s=1,pause_s=0.6
	incise capture -o tracker.rec --rig $rig --only tracker >/dev/null
	incise capture -o force.rec --rig $rig --only force >/dev/null
	run -0 --separate-stderr incise info tracker.rec
	[[ "$output" == *"cuts     2"* ]]
	[[ "$output" != *force* && "$output" != *bits* && "$output" != *nan* && "$output" != *mV* ]]
	# between the force samples of a.rec, or 8 ms of the tracker apart, it is the same cut
	depth=$(incise info a.rec --json | jq .depth_max_mm)
	incise info tracker.rec --json >tracker.json
	jq -e --argjson depth "$depth" '.cuts == 2 and .depth_max_mm > 5 and
		(.depth_max_mm - $depth | fabs) < 0.1 and
		.adc == null and .force_max_N == null and .calibration.force_mV_N == null' tracker.json
	run -0 --separate-stderr incise info force.rec
	[[ "$output" == *"12 bits over 5 V"* ]]
	[ -z "$(grep -E '^(tracker|depth|cuts)' <<<"$output")" ]
	incise info force.rec --json >force.json
	jq -e '.cuts == null and .depth_max_mm == null and .adc.bits == 12' force.json
}

# bats test_tags=check
@test "info of what is neither" {
	echo text >a.txt
	: >empty.fis
	mkdir folder
	seq 1000 >folder/recording.db
	head -c 5000 "$INCISE_BUILD/bin/incise" >binary
	for file in a.txt empty.fis folder binary none none.rec none.fis; do
		fails incise info $file -- $file
		[ -z "$output" ]
		fails incise info --json $file -- $file
		[ -z "$output" ]
	done
	fails incise info scenes -- scenes "installed scenes: liver, neck, wall"
}
