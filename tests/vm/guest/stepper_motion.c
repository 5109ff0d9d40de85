// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Random motions of random motors: limits, times and polarity are drawn again for every
 * session, targets and velocities come at any time, many of them in flight and beyond the
 * limits. Every edge is judged; at the end of each session the motor, the module, the
 * simulated carriage and the judge must agree where it stands.
 *
 *   stepper_motion EDGES SEED
 *
 * goes on until that many edges were judged. SEED draws the same sessions again.
 */
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "../bench.h"
#include "../draw.h"
#include "../tap.h"

#define MOTORS 2
#define RETARGETS 40
#define BEYOND_NS 20000	  /* what the timer may be late in virtual time, twice */
#define AFTER 60000000000 /* ns in which all must have come to an end, on any host */

static int64_t carriage_of(unsigned int motor)
{
	char name[32];

	/* Lines are in the order of numbers: "number=1 ... position=". */
	snprintf(name, sizeof(name), "%u", motor);
	return simulator_number_of("carriage", name, "position");
}

static void random_setpoint(struct bench *bench, unsigned int motor)
{
	const struct incise_stepper_config *config = &bench->config[motor];
	int64_t way = config->position_max - config->position_min;

	switch (draw_between(0, 5)) {
	case 0: /* any velocity, a tenth beyond the limit */
		bench_want(bench, motor, INCISE_STEPPER_MODE_VELOCITY,
			   draw_between(-(int64_t)config->velocity * 11 / 10,
					(int64_t)config->velocity * 11 / 10));
		break;
	case 1: /* an end, or far beyond */
		bench_want(bench, motor, INCISE_STEPPER_MODE_POSITION,
			   draw_between(0, 1) ? INT64_MIN : config->position_max + way);
		break;
	case 2: /* a step or two from here */
		bench_want(bench, motor, INCISE_STEPPER_MODE_POSITION,
			   bench_look(bench, motor).position + draw_between(-2, 2));
		break;
	default:
		bench_want(bench, motor, INCISE_STEPPER_MODE_POSITION,
			   draw_between(config->position_min - 10,
					config->position_max + 10));
	}
}

static int64_t later(int64_t a, int64_t b)
{
	return a > b ? a : b;
}

/*
 * By how much a set-point in the page waits longer than it may until the module has it: a
 * tick, and what the last step of the tick before may be late by, as the next one waits for
 * it (an eighth of a step, or of what the self-test found, and a change of direction). The
 * status page says which one is in force. Measured by looking all the time.
 */
static int64_t wait_of(struct bench *bench, unsigned int motor)
{
	const struct incise_stepper_config *config = &bench->config[motor];
	int64_t lag_ns = later(125000000 / config->velocity, bench->info.lateness_ns);
	int64_t begin_ns = bench_now_ns(), now_ns;
	uint32_t seq;

	bench_want(bench, motor, INCISE_STEPPER_MODE_POSITION,
		   draw_between(config->position_min, config->position_max));
	seq = bench->setpoint[motor].seq;
	do
		now_ns = bench_now_ns();
	while (bench_look(bench, motor).setpoint_seq != seq && now_ns - begin_ns < AFTER);
	return now_ns - begin_ns - config->tick_ns - lag_ns - config->setup_ns -
	       config->hold_ns;
}

/* One session; false when the motors do not agree, with a line that says why. */
static bool session(struct bench *bench, uint32_t *retargets, int64_t *longest)
{
	const uint32_t ended = 1U << INCISE_STEPPER_STATE_READY;
	const uint32_t off =
		1U << INCISE_STEPPER_STATE_DISABLED | 1U << INCISE_STEPPER_STATE_FAULT;
	uint32_t all = (1U << MOTORS) - 1;
	int64_t target[MOTORS];
	bool right = true;
	int ret;

	for (unsigned int i = 0; i < MOTORS; i++) {
		struct incise_stepper_config config = draw_config(bench, i);
		int64_t begin = draw_between(config.position_min, config.position_max);

		/* A jerk that this tick cannot hold is refused: then without. */
		ret = bench_configure(bench, &config, begin);
		config.jerk = ret == -34 ? 0 : config.jerk;
		ret = ret == -34 ? bench_configure(bench, &config, begin) : ret;
		if (ret || bench_carriage(&config, begin, "")) {
			note("motor %u: its config is refused: %s", i, strerror(-ret));
			return false;
		}
	}
	ret = bench_command(bench, INCISE_STEPPER_ENABLE, all);
	if (ret) {
		note("enable: %s", strerror(-ret));
		return false;
	}
	for (int i = 0; i < RETARGETS; i++) {
		random_setpoint(bench, draw_between(0, MOTORS - 1));
		++*retargets;
		bench_nap(draw_scattered(20000, 50000000));
		if (i % 8 == 3)
			*longest = later(*longest, wait_of(bench, i / 8 % MOTORS));
		for (unsigned int m = 0; m < MOTORS && i % 8 == 7; m++)
			random_setpoint(bench, m);
	}
	bench_judge(bench);
	for (unsigned int i = 0; i < MOTORS; i++) {
		target[i] = draw_between(bench->config[i].position_min,
					 bench->config[i].position_max);
		bench_want(bench, i, INCISE_STEPPER_MODE_POSITION, target[i]);
	}
	for (unsigned int i = 0; i < MOTORS; i++) {
		right &= bench_until(bench, i, ended, INCISE_STEPPER_MODE_POSITION,
				     target[i], AFTER);
		for (unsigned int m = 0; m < MOTORS; m++)
			bench_want(bench, m, INCISE_STEPPER_MODE_POSITION, target[m]);
	}
	bench_command(bench, INCISE_STEPPER_DISABLE, all);
	for (unsigned int i = 0; i < MOTORS; i++)
		right &= bench_until(bench, i, off, INCISE_STEPPER_MODE_POSITION,
				     target[i], AFTER);
	bench_judge(bench);
	for (unsigned int i = 0; i < MOTORS; i++) {
		struct incise_stepper_motor_status status = bench_look(bench, i);

		if (right && status.position == target[i] &&
		    carriage_of(i) == target[i] && bench->log[i].position == target[i] &&
		    !status.faults)
			continue;
		note("motor %u: target %" PRId64 ", module %" PRId64 ", carriage %" PRId64
		     ", judge %" PRId64 ", state %u, faults %#x",
		     i, target[i], (int64_t)status.position, carriage_of(i),
		     bench->log[i].position, status.state, status.faults);
		right = false;
	}
	return right;
}

int main(int argc, char **argv)
{
	static struct bench bench;
	uint64_t wanted = argc > 1 ? strtoull(argv[1], NULL, 0) : 100000;
	uint64_t up = 0, down = 0, stepped = 0;
	uint32_t sessions = 0, retargets = 0;
	struct timespec cpu;
	bool right = true;
	const char *profile = getenv("INCISE_VM_PROFILE");
	int64_t longest = INT64_MIN;
	double hardest = 0;
	int64_t begin_ns;
	int ret;

	draw_seed(argc > 2 ? strtoull(argv[2], NULL, 0) : 1);
	ret = bench_bind(&bench, MOTORS);
	ret = ret ? ret : bench_open(&bench);
	if (!check(!ret, "two motors are bound (%s)", strerror(-ret)))
		return 1;
	note("self-test: %u steps/s, pulse %u ns, edge %u ns, lateness %u ns, at most %u ns",
	     bench.info.rate_max, bench.info.pulse_ns, bench.info.edge_ns,
	     bench.info.lateness_ns, bench.info.lateness_max_ns);
	begin_ns = bench_now_ns();
	while (right && stepped < wanted && !bench_faulty(&bench)) {
		right = session(&bench, &retargets, &longest);
		sessions++;
		stepped = bench.log[0].edges + bench.log[1].edges;
	}
	for (unsigned int i = 0; i < MOTORS; i++) {
		up += bench.log[i].up;
		down += bench.log[i].down;
		hardest = fmax(hardest, bench.log[i].hardest);
	}
	clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &cpu);
	note("%" PRIu64 " edges, %" PRIu64 " steps up, %" PRIu64
	     " down, %u sessions, %u targets, "
	     "%.1f s of virtual time, %.1f s of it in this program",
	     stepped, up, down, sessions, retargets, (bench_now_ns() - begin_ns) * 1e-9,
	     cpu.tv_sec + cpu.tv_nsec * 1e-9);
	check(right, "in each of %u sessions all agree where the motors stand", sessions);
	check(!bench_faulty(&bench), "not one of %" PRIu64 " edges breaks a promise",
	      stepped);
	note("most acceleration that the steps show for sure: %.2f of the limit",
	     hardest);
	if (profile && !strcmp(profile, "deterministic"))
		check(longest <= BEYOND_NS,
		      "a set-point is in force within a tick, once the step before is out; "
		      "%+.1f us at most",
		      longest * 1e-3);
	check(stepped >= wanted, "%" PRIu64 " edges were wanted", wanted);
	bench_close(&bench);
	check(!bench_unbind(&bench), "the motors are unbound");
	return tap_failures != 0;
}
