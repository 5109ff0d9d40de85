// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The largest velocity that SET_CONFIG accepts is held: motors that cruise at it for a second give all steps
 * that were asked of them. One motor and eight, with pulses that the timer waits for and pulses that it
 * ends.
 */
#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "../bench.h"
#include "../tap.h"

#define CRUISE_NS INT64_C(1000000000)
#define KEPT 0.999

/* Accepted of a controller with this many motors, by SET_CONFIG itself; 0: none. */
static uint32_t largest(struct bench *bench, struct incise_stepper_config *config)
{
	uint32_t low = 0, high = 200001;

	while (high - low > 1) {
		config->velocity = low + (high - low) / 2;
		if (bench_configure(bench, config, 0) == -ERANGE)
			high = config->velocity;
		else
			low = config->velocity;
	}
	config->velocity = low;
	return low;
}

static void cruise(struct bench *bench, uint32_t pulse_ns, uint32_t flags)
{
	uint32_t all = (1U << bench->n_motors) - 1;
	int64_t from[INCISE_STEPPER_MOTORS_MAX], begin_ns, end_ns;
	uint32_t velocity = 0, faults = 0;
	uint64_t given = 0;
	double asked;

	for (unsigned int i = 0; i < bench->n_motors; i++) {
		struct incise_stepper_config config = {
			.motor = i,
			.flags = flags,
			.tick_ns = bench->info.tick_min_ns > 1000000
					   ? bench->info.tick_min_ns
					   : 1000000,
			.acceleration = 1000000,
			.late_max = 1000,
			.position_min = -1000000000,
			.position_max = 1000000000,
			.deadman_ns = 10000000000,
			.high_ns = pulse_ns,
			.low_ns = pulse_ns,
			.setup_ns = 1000,
			.hold_ns = 1000,
			.enable_ns = 1000000,
		};

		velocity = largest(bench, &config);
		if (!check(velocity > 0 && !bench_configure(bench, &config, 0),
			   "a velocity is accepted"))
			return;
	}
	if (!check(!bench_command(bench, INCISE_STEPPER_ENABLE, all), "they have power"))
		return;
	for (unsigned int i = 0; i < bench->n_motors; i++)
		bench_want(bench, i, INCISE_STEPPER_MODE_VELOCITY, velocity);
	bench_nap(CRUISE_NS);
	for (unsigned int i = 0; i < bench->n_motors; i++)
		from[i] = bench_look(bench, i).position;
	begin_ns = bench_look(bench, 0).t_ns;
	bench_nap(CRUISE_NS);
	for (unsigned int i = 0; i < bench->n_motors; i++) {
		given += (uint64_t)(bench_look(bench, i).position - from[i]);
		faults |= bench_look(bench, i).faults;
	}
	end_ns = bench_look(bench, 0).t_ns;
	asked = (double)velocity * bench->n_motors * (double)(end_ns - begin_ns) * 1e-9;
	note("%u motors, pulses of %u ns%s: %u steps/s accepted, %.3f %% of the steps given",
	     bench->n_motors, pulse_ns,
	     flags & INCISE_STEPPER_CONFIG_NO_WAIT ? " without waiting" : "", velocity,
	     100 * (double)given / asked);
	check(!faults, "no fault (%#x)", faults);
	check((double)given >= KEPT * asked, "all steps are given");
	bench_rest(bench, bench->n_motors);
}

int main(void)
{
	static const unsigned int motors[] = {1, 8};

	for (size_t i = 0; i < sizeof(motors) / sizeof(*motors); i++) {
		static struct bench bench;
		uint32_t pulse_ns;
		int ret;

		memset(&bench, 0, sizeof(bench));
		ret = bench_bind(&bench, motors[i]);
		ret = ret ? ret : bench_open(&bench);
		if (!check(!ret, "%u motors are bound (%s)", motors[i], strerror(-ret)))
			return 1;
		note("self-test: %u steps/s, pulse %u ns, a step besides its pulse %u ns, or %u ns",
		     bench.info.rate_max, bench.info.pulse_ns, bench.info.step_ns,
		     bench.info.wait_step_ns);
		pulse_ns = bench.info.pulse_ns > 1700 ? bench.info.pulse_ns : 1700;
		/* Where several motors share a processor, edges of the shortest pulse are late by more than it: the fault LATE. */
		if (motors[i] == 1) {
			cruise(&bench, pulse_ns, 0);
			cruise(&bench, pulse_ns, INCISE_STEPPER_CONFIG_NO_WAIT);
		}
		cruise(&bench, 5150, 0);
		cruise(&bench, 10300, 0);
		bench_close(&bench);
		check(!bench_unbind(&bench), "the motors are unbound");
	}
	return tap_failures != 0;
}
