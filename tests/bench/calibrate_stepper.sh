#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# incise calibrate stepper on virtual rigs of random truth, seeds 1 to N (200): how many of the
# stated intervals (k = 2) hold it. Half a minute for 200. The rig's sensor is off what
# calibration.conf says by as much as that says it may be.
#
#   O=build tests/bench/calibrate_stepper.sh [N]
set -eu
program=${O:-build}/bin/incise-calibrate-stepper
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cat >"$work/c.conf" <<-END
	force_mV_N = 1240.0;
	history = ( { kind = "force"; date = "2026-11-21T14:48:16Z";
	  values = ( { key = "force_mV_N"; left = 1240.0; u = 1.24; unit = "mV/N"; } );
	  pass = true; } );
END

# seed, N per microstep, backlash in mm, and the rig. awks differ in rand(): this is Park and
# Miller's.
awk -v n="${1:-200}" '
	function uniform(low, high) {
		state = state * 48271 % 2147483647
		return low + (high - low) * state / 2147483647
	}
	BEGIN {
		for (seed = 1; seed <= n; seed++) {
			state = seed * 7919
			for (i = 0; i < 5; i++)
				uniform(0, 1)
			k = uniform(0.8, 3.5)
			lead = 2 ^ int(uniform(0, 3))
			steps = 1600 * 2 ^ int(uniform(0, 3))
			backlash = uniform(0, 0.06) * 2.7 / k
			friction = uniform(0, 0.02)
			hysteresis = seed % 3 == 1 ? uniform(0, 0.1) : 0
			stiction = seed % 3 == 2 ? uniform(0.02, 0.1) : 0
			normal = sqrt(-2 * log(uniform(0, 1))) * cos(6.28318530718 * uniform(0, 1))
			printf "%d %.12g %.12g ", seed, k * lead / steps, backlash + 2 * friction / k
			printf "sim:clock=simulated,bench=1,seed=%d,spring_N_mm=%.9g,", seed, k
			printf "lead_mm=%d,steps_per_turn=%d,backlash_mm=%.9g,", lead, steps, backlash
			printf "hysteresis_N=%.9g,stiction_N=%.9g,", hysteresis, stiction
			printf "handle_friction_N=%.9g,", friction
			printf "force_mV_N=%.9g,", 1240 * (1 + 0.001 * normal)
			printf "force_noise_mV=%.9g,", uniform(1, 10)
			printf "force_zero_mV=%.9g\n", uniform(50, 300)
		}
	}' >"$work/rigs"

while read -r seed truth backlash rig; do
	"$program" --rig "$rig" -c "$work/c.conf" --dry-run --json --no-rate --repeat 2 \
		>"$work/r.json" || echo "seed $seed failed" >&2
	sed -n 's/^  "\(N_step\|N_step_u\|backlash_mm\|backlash_u_mm\)": \([^,]*\),*$/\1 \2/p' \
		"$work/r.json" | awk -v truth="$truth" -v backlash="$backlash" '
		{ v[$1] = $2 }
		END {
			print (v["N_step"] - truth) / v["N_step_u"],
				(v["backlash_mm"] - backlash) / v["backlash_u_mm"]
		}'
done <"$work/rigs" | awk '
	{ step += $1 * $1 <= 4; squares += $1 * $1; backlash += $2 * $2 <= 4 }
	END {
		printf "%d rigs: N per microstep held by %.1f %%", NR, 100 * step / NR
		printf " (mean square %.2f), backlash by %.1f %%\n", squares / NR, 100 * backlash / NR
	}'
