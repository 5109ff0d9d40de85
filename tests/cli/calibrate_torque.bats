# SPDX-License-Identifier: GPL-2.0-or-later
# incise calibrate torque: the friction of a simulated device is found, and a handle that cannot follow
# ends it.

load cli

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
@test "samples that stop, are late, or come without the enabling button end the force" {
	free=clock=simulated,motion=still,hand_N_mm=0,hand_kg=0,hand_N_s_mm=0,coulomb_N=0.3
	# before the force has grown by 0.3 N, in 100 ms, to half of peak_N
	while read -r keys words; do
		fails incise calibrate torque --rig "sim:haptic,$free,peak_N=1.2,$keys" -- "$words"
	done <<-END
		dies_s=1.3 its dies_s has passed
		late_s=1.3 its late_s has passed
		nan_s=1.3 its nan_s has passed
		changes_s=1.3 its changes_s has passed
	END
	for to in 0 1.3; do
		cat >rig.conf <<-END
			clock = "simulated";
			haptic = "sim:${free#*,},button1_to_s=$to";
			haptic_setup = { enable = 1; };
		END
		fails incise calibrate torque -- "button 1, haptic_setup.enable, is not pressed"
	done
	sed -i 's/button1_to_s=[0-9.]*/button1_to_s=100/' rig.conf
	run -0 incise calibrate torque
}

# bats test_tags=check
@test "a handle that does not follow ends it, and so does a rig without one" {
	run --separate-stderr incise calibrate torque \
		--rig sim:haptic,clock=simulated,motion=still,hand_N_mm=20
	failed_with "does not follow a force of"
	run --separate-stderr incise calibrate torque \
		--rig sim:haptic,clock=simulated,motion=still,hand_N_mm=0,not_ready_s=2
	failed_with "its not_ready_s has passed"
	fails incise calibrate torque --rig sim: -- "no haptic device"
	run --separate-stderr incise calibrate torque --direction 0,0,0 --rig sim:haptic
	[ "$status" -eq 2 ]
}
