# SPDX-License-Identifier: GPL-2.0-or-later
# incise calibrate torque: the friction of a simulated device is found, and a handle that cannot follow
# ends it.

load cli

setup() {
	work_folder
}

# bats test_tags=check
@test "the friction of a device is found, and its cogging" {
	free=sim:haptic,clock=simulated,motion=still,hand_N_mm=0,hand_kg=0,hand_N_s_mm=0,damping_N_s_mm=1e-5
	run -0 incise calibrate torque --rig $free,coulomb_N=0.3 --json
	[ "$(jq '(.coulomb_N - 0.3 | fabs) < 0.003' <<<"$output")" = true ]
	[ "$(jq '.u_coulomb_N < 0.003 and .cogging_N < 0.003' <<<"$output")" = true ]
	run -0 incise calibrate torque --rig $free,coulomb_N=0.3 --direction 0,-2,0 --span 30
	[[ "$output" == *"friction "*"haptic_setup = { coulomb_N = 0."* ]]
}

# bats test_tags=check
@test "a handle that does not follow ends it, and so does a rig without one" {
	run --separate-stderr incise calibrate torque \
		--rig sim:haptic,clock=simulated,motion=still,hand_N_mm=20
	failed_with "does not follow a force of"
	run --separate-stderr incise calibrate torque \
		--rig sim:haptic,clock=simulated,motion=still,hand_N_mm=0,not_ready_s=2
	failed_with "its not_ready_s has passed"
	run --separate-stderr incise calibrate torque --rig sim:
	failed_with "no haptic device"
	run --separate-stderr incise calibrate torque --direction 0,0,0 --rig sim:haptic
	[ "$status" -eq 2 ]
}
