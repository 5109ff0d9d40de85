# SPDX-License-Identifier: GPL-2.0-or-later
# incise calibrate frame: the place of a haptic device is found, kept and checked, and points that cannot
# tell it are refused.

load cli

setup() {
	work_folder
	# turned by 90 degrees about z, with the origin at 5 100 -30, and 0.1 mm off here and there
	cat >p.csv <<-'END'
		x_mm,y_mm,z_mm,device_x_mm,device_y_mm,device_z_mm,sd_mm
		0,0,0,-100.05,5,30,0.05
		60,0,0,-100,-55,30.05,0.06
		0,50,0,-50.05,5,30.1,0.04
		20,20,40,-80,-15,70.05,0.05
	END
}

# bats test_tags=check
@test "the frame of a touched device is found, kept and listed" {
	incise calibrate frame --from p.csv -o rep --json >r.json
	for row in 0:0 1:0 2:90 3:5 4:100 5:-30; do
		holds "($(key r.json "values[${row%:*}].left") - ${row#*:})^2 < (1.5 * $(key r.json "values[${row%:*}].U"))^2"
		holds "$(key r.json "values[${row%:*}].U") < 0.4"
	done
	[ "$(key r.json details.freedom)" = 6 ]
	[ "$(key r.json details.flat)" = 0 ]
	grep -q '^frame_turn_deg = \[.*## degrees, U = ' calibration.conf
	grep -q '^frame_mm = \[.*## mm, U = ' calibration.conf
	grep -q '^    4 ' rep/report.txt
	[ "$(key rep/report.json 'values[2].left')" = "$(key r.json 'values[2].left')" ]
	# read again it has no change
	incise calibrate frame --from p.csv --dry-run --json >again.json
	[ "$(key again.json 'values[3].found')" = "$(key r.json 'values[3].left')" ]
	run -0 --separate-stderr incise calibrate check --only frame
	[[ "$output" == *"frame    good"*"frame_turn_z_deg"* ]]
	# who has no haptic device is not asked for its frame
	echo 'force_mV_N = 1240.0;' >none.conf
	run -1 --separate-stderr incise calibrate check -c none.conf
	[[ "$output" != *frame* ]]
	run -1 --separate-stderr incise calibrate check -c none.conf --only frame
	[[ "$output" == *"frame    due: never calibrated: nominal, as rig.conf says"* ]]
}

# bats test_tags=check
@test "points that cannot tell the frame are refused, and nothing is changed" {
	head -n 3 p.csv >few.csv
	fails incise calibrate frame --from few.csv -- "2 points" "3 to 6"
	awk -F, -v OFS=, 'NR == 3 { $5 += 20 } { print }' p.csv >far.csv
	fails incise calibrate frame --from far.csv -- "miss each other" "order"
	awk -F, -v OFS=, 'NR > 1 { $1 *= -1 } { print }' p.csv >mirror.csv
	fails incise calibrate frame --from mirror.csv -- "mirrored" "sign of an axis"
	sed '5s/.*/30,0.5,0,-100,-25,30,0/; 4d' p.csv >line.csv
	fails incise calibrate frame --from line.csv -- "nearly on a line"
	sed '4s/-50.05,5/-100,5/' p.csv >twice.csv
	fails incise calibrate frame --from twice.csv -- "points 1 and 3" "the device's frame"
	sed '1s/device_z_mm/z/' p.csv >name.csv
	run --separate-stderr incise calibrate frame --from name.csv
	failed_with "name.csv:1: there is no column 'device_z_mm'"
	[ ! -e calibration.conf ]
	# a plane is warned of
	head -n 4 p.csv >flat.csv
	run -0 --separate-stderr incise calibrate frame --from flat.csv
	[[ "$stderr" == *"near a plane"*"residuals of three say little"* ]]
}

# bats test_tags=check
@test "a handle is read at each press of Enter, and a point that is touched twice is refused" {
	rig=sim:haptic,clock=simulated,motion=still
	printf '\n\n\n' >enter
	run --separate-stderr incise calibrate frame --rig $rig --point 0,0,0 --point 50,0,0 --point 0,50,0 \
		-o touched.csv <enter
	[ "$status" -eq 1 ]
	[[ "$stderr" == *"point 3 of 3: touch (0, 50, 0) mm"*"points 1 and 2 are 0 mm apart"* ]]
	[ "$(wc -l <touched.csv)" -eq 4 ]
	grep -q '^50,0,0,0,0,' touched.csv
	for fault in not_ready changes nan; do
		run --separate-stderr incise calibrate frame --rig $rig,${fault}_s=0.01 --point 0,0,0 --point 50,0,0 \
			--point 0,50,0 <enter
		[ "$status" -eq 1 ]
		[[ "$stderr" == *"its ${fault}_s has passed; set it later" ]]
	done
	run --separate-stderr incise calibrate frame --rig sim: --point 0,0,0 --point 50,0,0 --point 0,50,0
	failed_with "no haptic device"
}

# bats test_tags=check
@test "the loop places the device by the calibrated frame" {
	# a quarter turn about x brings z = -3 to y = 3
	printf 'frame_turn_deg = [90.0, 0.0, 0.0];\nframe_mm = [1.0, 0.0, 50.0];\n' >turned.conf
	incise haptic wall --rig sim:haptic,clock=simulated,motion=still,z_mm=-3 --duration 500ms -c turned.conf -o t.csv
	awk -F, 'END { exit $2 != 1 || $3 != 3 || $4 != 50 }' t.csv
}
