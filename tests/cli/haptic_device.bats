# SPDX-License-Identifier: GPL-2.0-or-later
# A haptic device in the loop, on the simulated one: where its force begins, and each fault that ends it. In
# simulated time every figure is the same on each machine.

load cli

setup() {
	work_folder
	cp "$root/scenes/wall.scene" .
}

# Press into the wall, deepest at 4 s of the device: 3.5 s of the loop, before which the ages of poses take 0.5 s.
press() {
	incise haptic wall.scene --rig "$1" --duration 6s -v -o l.csv --overwrite 2>notes >report
}

# The largest force from A to B seconds, N.
largest() {
	awk -F, -v a="$1" -v b="$2" 'NR > 1 && $1 >= a && $1 <= b && $7 > m { m = $7 } END { print m + 0 }' l.csv
}

# bats test_tags=check
@test "a haptic device takes the force, from nothing over start_s" {
	cat >rig.conf <<-E
	clock = "simulated";
	haptic = "sim:begin_s=0.2,cycle_s=2,deadman_s=0";
	haptic_setup = { start_s = 2.0; };
	E
	incise haptic wall.scene --rig rig.conf --duration 6s -o l.csv --json 2>notes >r.json
	grep -q 'keeps its last force if its owner is killed' notes
	[ "$(key r.json stages)" = '["pose","predict","contact","reaction","start","limit","push"]' ]
	[ "$(key r.json haptic.lost)" = 0 ]
	holds "$(key r.json haptic.age_most_ms) <= $(key r.json haptic.age_assumed_ms)"
	# the first press, in the ramp, is less than the second
	holds "$(largest 0 1.7) > 0.01" "$(largest 0 1.7) < 0.7 * $(largest 1.7 3.7)"
	holds "$(largest 1.7 3.7) < 1.01 * $(largest 3.7 6)"
}

# bats test_tags=check
@test "each fault of a haptic device takes the force away, and says why" {
	while read -r keys note; do
		press "sim:haptic,clock=simulated,$keys"
		holds "$(largest 3.4 3.499) > 0.5" || complain "$keys: no force before" || return
		holds "$(largest 3.56 6) == 0" || complain "$keys: $(largest 3.56 6) N after it" || return
		grep -q "$note" notes || complain "$keys: $(cat notes)" || return
	done <<-E
	dies_s=4 force off: poses are older
	nan_s=4 the tracker flags poses '~'
	changes_s=4 force off: the device is not ready
	not_ready_s=4 force off: the device is not ready
	late_s=4 force off: poses are older
	E
}

# bats test_tags=check
@test "a force begins in the middle of the workspace only, with the enabling button" {
	# the middle half of 160 mm: up to 40 mm
	press sim:haptic,clock=simulated,x_mm=45
	holds "$(largest 0 6) == 0"
	grep -q 'force off: move the handle to the middle of its workspace' notes
	grep -q '^no force .* ticks in contact, and the force was off: move the handle to the middle' report
	press sim:haptic,clock=simulated,x_mm=35
	holds "$(largest 0 6) > 0.5"
	cat >rig.conf <<-E
	clock = "simulated";
	haptic = "sim:button1_from_s=1,button1_to_s=4";
	haptic_setup = { enable = 1; };
	E
	press rig.conf
	holds "$(largest 3 3.49) > 0.5" "$(largest 3.56 6) == 0"
	grep -q 'force off: press the enabling button' notes
}

# bats test_tags=check
@test "a scene asks no more than a haptic device gives" {
	run -1 --separate-stderr incise haptic wall.scene --rig sim:haptic,clock=simulated,peak_N=1 --duration 1s
	[[ "$stderr" == *"limits.force_N is 4 N, but simulated haptic device gives at most 1 N; set it to that or less" ]]
	sed 's/^tissue *= *{/&gain = 10.0; /' wall.scene >stiff.scene
	run -1 --separate-stderr incise haptic stiff.scene --rig sim:haptic,clock=simulated,mass_kg=0.2 --duration 1s
	[[ "$stderr" == *"not stable"*"on a device of 0.2 kg"*"set tissue.gain to at most"* ]]
	run -1 --separate-stderr incise capture --rig sim:haptic,clock=simulated -o r.rec --duration 1s --only force
	[[ "$stderr" == *"sim:haptic,clock=simulated: a haptic device alone has no force channel"* ]]
}

# bats test_tags=check
@test "capture records the poses of a haptic device in the frame of the calibration" {
	# a quarter turn about x brings z = -3 to y = 3
	printf 'frame_turn_deg = [90.0, 0.0, 0.0];\nframe_mm = [1.0, 0.0, 50.0];\n' >turned.conf
	run -0 --separate-stderr incise capture --rig sim:haptic,clock=simulated,motion=still,z_mm=-3 -c turned.conf \
		-o r.rec --duration 1s
	[[ "$stderr" == *"no force is recorded: the rig has no force channel"* ]]
	[ "$(sqlite3 -readonly r.rec/recording.db \
		'SELECT DISTINCT x_mm, round(y_mm, 6), round(z_mm, 6) FROM tracker')" = "1.0|3.0|50.0" ]
	# beside a force channel nothing is left out
	cat >rig.conf <<-E
	clock = "simulated";
	haptic = "sim:motion=still,z_mm=-3";
	force = "sim:";
	E
	run -0 --separate-stderr incise capture -c turned.conf -o both.rec --duration 1s --json
	[[ "$stderr" != *"no force"* ]]
	[ "$(jq '.force > 0 and .tracker > 0' <<<"$output")" = true ]
	run -1 --separate-stderr incise capture --rig sim:haptic,clock=simulated -o f.rec --trigger 0.2N
	[[ "$stderr" == *"f.rec: a force triggers, but the rig sim:haptic,clock=simulated has no force channel; "* ]]
}

# bats test_tags=check
@test "serve sends the poses of a rig that is a haptic device alone" {
	incise serve --rig sim:haptic -c none --igtl 0 --duration 1s --json >r.json
	holds "$(key r.json poses) > 0" "$(key r.json forces) == 0"
	echo 'tracker = "sim:";' >rig.conf
	fails incise serve --rig rig.conf -c none --duration 1s -- rig.conf "force:" "missing"
}
