// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The largest velocity that SET_CONFIG accepts is held: motors that cruise at it for a second give all steps
 * that were asked of them. One motor, eight, and the 32 of four controllers, with pulses that the timer
 * waits for and pulses that it ends. Short pulses need lines without inputs: to read these takes longer.
 */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>

#include "../bench.h"
#include "../tap.h"

#define CRUISE_NS INT64_C(1000000000)
#define KEPT 0.999

#define CONTROLLERS 4
#define SHORT_NS 1700
/* Of 1700 ns pulses, when an interrupt ended each: steps/s, and the share of a processor. */
#define BEFORE_STEPS_S 107760
#define BEFORE_SHARE 0.78

static struct bench bench[CONTROLLERS];
static double idle_rounds_s; /* of spin(), when nothing moves */

/* As a program that has the processor when the timers have not; returns its rounds in a second. */
static double spin(int64_t ns)
{
	int64_t begin_ns = bench_now_ns(), now_ns;
	uint64_t rounds = 0;

	do {
		now_ns = bench_now_ns();
		rounds++;
	} while (now_ns - begin_ns < ns);
	return (double)rounds * 1e9 / (double)(now_ns - begin_ns);
}

static int64_t waits(const struct bench *of, unsigned int motor)
{
	char path[160], line[512];
	int64_t found = -1;
	unsigned int number;
	FILE *file;

	snprintf(path, sizeof(path), "/sys/kernel/debug/incise_stepper/%s/counters",
		 strrchr(of->cdev, '/') + 1);
	file = fopen(path, "r");
	while (file && fgets(line, sizeof(line), file))
		if (sscanf(line, "motor=%u", &number) == 1 && number == motor)
			found = strtoll(strstr(line, " waits=") + 7, NULL, 10);
	if (file)
		fclose(file);
	return found;
}

/* Accepted of a controller with this many motors, by SET_CONFIG itself; 0: none. */
static uint32_t largest(const struct bench *of, struct incise_stepper_config *config)
{
	uint32_t low = 0, high = 200001;

	while (high - low > 1) {
		config->velocity = low + (high - low) / 2;
		if (ioctl(of->fd, INCISE_STEPPER_SET_CONFIG, config))
			high = config->velocity;
		else
			low = config->velocity;
	}
	config->velocity = low;
	return low && !ioctl(of->fd, INCISE_STEPPER_SET_CONFIG, config) ? low : 0;
}

/* The largest velocity of each motor, for all of a controller. */
static uint32_t set_up(const struct bench *of, uint32_t pulse_ns, uint32_t flags,
		       uint32_t late_max)
{
	uint32_t velocity = 0;

	for (unsigned int i = 0; i < of->n_motors; i++) {
		struct incise_stepper_config config = {
			.motor = i,
			.flags = flags,
			.tick_ns = of->info.tick_min_ns > 1000000 ? of->info.tick_min_ns
								  : 1000000,
			.acceleration = 1000000,
			.late_max = late_max,
			.position_min = -1000000000,
			.position_max = 1000000000,
			.deadman_ns = 10000000000,
			.high_ns = pulse_ns,
			.low_ns = pulse_ns,
			.setup_ns = 1000,
			.hold_ns = 1000,
			.enable_ns = 1000000,
		};

		velocity = largest(of, &config);
		if (!velocity)
			break;
	}
	check(velocity > 0, "a velocity is accepted");
	return velocity;
}

static int64_t position_of_all(unsigned int n)
{
	int64_t sum = 0;

	for (unsigned int k = 0; k < n; k++)
		for (unsigned int i = 0; i < bench[k].n_motors; i++)
			sum += bench_look(&bench[k], i).position;
	return sum;
}

/* The first n controllers. Those that are refused power say so, and stand. */
static void cruise(unsigned int n, uint32_t pulse_ns, uint32_t flags)
{
	const bool short_pulse = pulse_ns <= INCISE_STEPPER_WAIT_MAX_NS;
	int64_t begin_ns, end_ns, given, from, waited = 0, steps = 0;
	uint32_t velocity = 0, faults = 0;
	uint64_t steps_s = 0;
	unsigned int motors = 0;
	double asked, share;

	for (unsigned int k = 0; k < n; k++) {
		const uint32_t all = (1U << bench[k].n_motors) - 1;
		int ret;

		velocity = set_up(&bench[k], pulse_ns, flags, 1000);
		ret = bench_command(&bench[k], INCISE_STEPPER_ENABLE, all);
		if (k && ret == -ENOSPC)
			continue;
		if (!check(!ret, "controller %u has power (%s)", k, strerror(-ret)))
			return;
		motors += bench[k].n_motors;
		steps_s += (uint64_t)velocity * bench[k].n_motors;
		for (unsigned int i = 0; i < bench[k].n_motors; i++) {
			waited -= waits(&bench[k], i);
			steps -= (int64_t)bench_look(&bench[k], i).steps_up;
			bench_want(&bench[k], i, INCISE_STEPPER_MODE_VELOCITY, velocity);
		}
	}
	bench_nap(CRUISE_NS);
	from = position_of_all(n);
	begin_ns = bench_look(&bench[0], 0).t_ns;
	share = 1 - spin(CRUISE_NS) / idle_rounds_s;
	given = position_of_all(n) - from;
	end_ns = bench_look(&bench[0], 0).t_ns;
	asked = (double)steps_s * (double)(end_ns - begin_ns) * 1e-9;
	for (unsigned int k = 0; k < n; k++) {
		for (unsigned int i = 0; i < bench[k].n_motors; i++)
			faults |= bench_look(&bench[k], i).faults;
		bench_rest(&bench[k], bench[k].n_motors);
		for (unsigned int i = 0; i < bench[k].n_motors; i++) {
			waited += waits(&bench[k], i);
			steps += (int64_t)bench_look(&bench[k], i).steps_up;
		}
	}
	note("%u motors, pulses of %u ns%s: %" PRIu64
	     " steps/s accepted, %.3f %% of the steps given, "
	     "%.0f %% of the processor",
	     motors, pulse_ns,
	     flags & INCISE_STEPPER_CONFIG_NO_WAIT ? " without waiting" : "", steps_s,
	     100 * (double)given / asked, 100 * share);
	if (short_pulse && motors == 1)
		note("before: %d steps/s at %.0f %%; at as much now: %.2f times as many",
		     BEFORE_STEPS_S, 100 * BEFORE_SHARE,
		     (double)steps_s / share * BEFORE_SHARE / BEFORE_STEPS_S);
	check(!faults, "no fault (%#x)", faults);
	check((double)given >= KEPT * asked, "all steps are given");
	if (!short_pulse || flags & INCISE_STEPPER_CONFIG_NO_WAIT)
		check(!waited, "no pulse is waited for (%" PRId64 ")", waited);
	else
		check(waited > 0 && waited <= steps && (motors > 1 || waited == steps),
		      "pulses that are waited for are counted: %" PRId64 " of %" PRId64
		      " steps",
		      waited, steps);
}

/* Where several motors share a processor, edges of the shortest pulse are late by more than it. */
static void late_edges(void)
{
	const uint32_t all = (1U << bench->n_motors) - 1;
	uint32_t velocity = set_up(bench, bench->info.pulse_ns, 0, 1), faults = 0;

	check(!bench_command(bench, INCISE_STEPPER_ENABLE, all), "they have power");
	for (unsigned int i = 0; i < bench->n_motors; i++)
		bench_want(bench, i, INCISE_STEPPER_MODE_VELOCITY, velocity);
	for (int n = 0; n < 1000 && !faults; n++) {
		bench_nap(1000000);
		for (unsigned int i = 0; i < bench->n_motors; i++)
			faults |= bench_look(bench, i).faults;
	}
	check(faults == INCISE_STEPPER_FAULT_LATE, "late edges are a fault (%#x)",
	      faults);
	bench_rest(bench, bench->n_motors);
}

static bool opens(struct bench *of, int ret)
{
	ret = ret ? ret : bench_open(of);
	if (!check(!ret, "%u motors are bound (%s)", of->n_motors, strerror(-ret)))
		return false;
	note("self-test: %u steps/s, pulse %u ns, a step besides its pulse %u ns, or %u ns",
	     of->info.rate_max, of->info.pulse_ns, of->info.step_ns,
	     of->info.wait_step_ns);
	return true;
}

static void closes(unsigned int n)
{
	for (unsigned int k = 0; k < n; k++) {
		bench_close(&bench[k]);
		check(!bench_unbind(&bench[k]), "the motors are unbound");
	}
}

static void all_wires(unsigned int motors)
{
	if (!opens(bench, bench_bind(bench, motors)))
		return;
	if (motors == 1)
		cruise(1, bench->info.pulse_ns, 0);
	else
		late_edges();
	cruise(1, 5150, 0);
	cruise(1, 10300, 0);
	closes(1);
}

static uint32_t short_of(const struct bench *of)
{
	return of->info.pulse_ns > SHORT_NS ? of->info.pulse_ns : SHORT_NS;
}

static void bare_wires(unsigned int motors)
{
	if (!opens(bench, bench_bind_bare(bench, 0, motors)))
		return;
	if (check(short_of(bench) <= INCISE_STEPPER_WAIT_MAX_NS,
		  "pulses that are waited for are accepted")) {
		cruise(1, short_of(bench), 0);
		if (motors == 1)
			cruise(1, short_of(bench), INCISE_STEPPER_CONFIG_NO_WAIT);
	}
	closes(1);
}

static void several_controllers(void)
{
	unsigned int n = 0;

	while (n < CONTROLLERS &&
	       opens(&bench[n], bench_bind_bare(&bench[n], n, INCISE_STEPPER_MOTORS_MAX)))
		n++;
	if (n == CONTROLLERS)
		cruise(n, 5150, 0);
	closes(n);
}

int main(void)
{
	idle_rounds_s = spin(CRUISE_NS);
	bare_wires(1);
	bare_wires(8);
	all_wires(1);
	all_wires(8);
	several_controllers();
	return tap_failures != 0;
}
