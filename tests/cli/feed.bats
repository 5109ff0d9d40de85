# SPDX-License-Identifier: GPL-2.0-or-later
# Plans as files, and the loop in the kernel as far as it goes without its module:
# tests/vm/guest/haptic_in_kernel.sh has the rest.

load cli

# bats test_tags=check
@test "a scene becomes a plan, which info explains" {
	run -0 --separate-stderr incise compile neck -o n.plan
	[[ "${lines[0]}" == "plan of neck.scene: 1000 Hz, "*" bytes, CRC-32C "* ]]
	[[ "$output" == *" mN of double, certified"*"surface  capsule, with a membrane"* ]]
	[[ "$stderr" == *"the plan has no actuator; give --rig"* ]]
	[ "$(head -c 8 n.plan)" = INCISEPL ]
	incise info n.plan --json >info.json
	[ "$(key info.json kind)" = plan ]
	[ "$(key info.json size_bytes)" = "$(stat -c %s n.plan)" ]
	[ "$(key info.json surface)" = capsule ]
	# a hand feels some 20 mN
	holds "$(key info.json bound_N) > 0"
	holds "$(key info.json bound_N) < 0.02"
	# the pose's age and the fade of neck.scene, and the slew from the largest force
	holds "$(key info.json fade_ms) > $(key info.json pose_age_ms) + 1e3 * $(key info.json force_N) / $(key info.json slew_N_s)"
	incise compile neck -o again.plan --json 2>/dev/null >report.json
	cmp n.plan again.plan
	diff <(incise info again.plan --json | grep -v '"schema"') <(grep -v '"schema"' report.json)
}

@test "a model is part of a plan, and a mesh becomes heights" {
	incise compile liver -o l.plan --json 2>/dev/null >l.json
	[ "$(key l.json model)" = 1 ]
	holds "$(key l.json size_bytes) > 10000"
	# a hill, 80 mm wide
	# one cell to the next, on a grid of 41 by 41
	awk 'BEGIN { n = 41
		for (j = 0; j < n; j++) for (i = 0; i < n; i++) {
			x = 2 * (i - 20); y = 2 * (j - 20); print "v", x, y, -(x * x + y * y) / 400 }
		for (j = 0; j < n - 1; j++) for (i = 0; i < n - 1; i++) {
			a = j * n + i + 1; print "f", a, a + 1, a + n + 1; print "f", a, a + n + 1, a + n } }' >hill.obj
	echo 'tissue = { reaction_N_mm = 0.3; }; surface = { kind = "mesh"; file = "hill.obj"; };' >hill.scene
	incise compile hill.scene -o hill.plan --json 2>/dev/null >hill.json
	holds "$(key hill.json heights.columns) > 20"
	# where the force is at its limit: 4 N
	holds "$(key hill.json heights.reach_mm) > 4 / 0.3"
	# two floors
	{ cat hill.obj; sed 's/^v \(.*\) \(.*\) \(.*\)/v \1 \2 -30/' hill.obj | sed -n '/^v/p'
		awk '/^f/ { print "f", $2 + 1681, $4 + 1681, $3 + 1681 }' hill.obj; } >floors.obj
	sed 's/hill.obj/floors.obj/' hill.scene >floors.scene
	fails incise compile floors.scene -o floors.plan -- overhang
	[ ! -e floors.plan ]
}

# bats test_tags=check
@test "a plan that is damaged or none is refused" {
	incise compile wall -o w.plan >/dev/null 2>&1
	python3 - <<-'END'
		plan = bytearray(open('w.plan', 'rb').read())
		plan[100] ^= 1
		open('bit.plan', 'wb').write(plan)
		open('short.plan', 'wb').write(plan[:-1])
		plan[8] += 8
		open('other.plan', 'wb').write(plan)
	END
	echo hello >none.plan
	for file in bit short none; do
		fails incise info $file.plan -- "$file.plan:"
	done
	fails incise info other.plan -- "other.plan:"
}

@test "an actuator that measures its handle stays in a program" {
	fails incise compile wall --rig sim: -o w.plan -- "it measures its handle"
}

# bats test_tags=check
@test "without a stepper of the kernel module nothing is fed, and nothing is left" {
	fails incise feed wall --rig sim: --state "$PWD/wall.state" -- "it cannot run plans"
	run --separate-stderr incise haptic wall --in-kernel --rig sim: --state "$PWD/wall.state"
	[ "$status" -eq 1 ]
	[[ "$stderr" == *"incise feed ended before it sent a pose" ]]
	run --separate-stderr incise haptic wall --in-kernel --rig sim: --state none
	failed_with "--in-kernel needs a status file"
}
