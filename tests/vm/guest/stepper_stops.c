// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Everything that stops a motor, while it moves at random limits: limit switches, e-stop and
 * the power stage's fault at an exact step, the deadman, an owner that is killed, a second
 * owner, unloading and unbinding. Every edge is judged, and where the motor stands is what
 * the simulated mechanics say.
 *
 *   stepper_stops ROUNDS SEED
 *
 * Times are asserted in virtual time only; that no step comes which must not come, always.
 */
#include <errno.h>
#include <fcntl.h>
#include "../../../lib/fixed/profile.h"
#include <inttypes.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "../bench.h"
#include "../draw.h"
#include "../tap.h"

#define DRIVER "/sys/bus/platform/drivers/incise-stepper"
#define FAR 100000	 /* steps: never reached in a round */
#define LONG 60000000000 /* ns: never, on any host */

static struct bench bench;
static bool virtual_time;
static int64_t reach; /* steps that do not take long */

static const uint32_t at_rest =
	1U << INCISE_STEPPER_STATE_FAULT | 1U << INCISE_STEPPER_STATE_DISABLED;

static struct incise_stepper_motor_status status(void)
{
	return bench_look(&bench, 0);
}

/* A motor with power at 0, and new limits each time. */
static bool fresh(const char *mechanics, struct incise_stepper_config *config)
{
	int ret;

	bench_command(&bench, INCISE_STEPPER_CLEAR, 1);
	*config = draw_config(&bench, 0);
	config->position_min = -FAR;
	config->position_max = FAR;
	config->jerk = 0;
	ret = bench_configure(&bench, config, 0);
	ret = ret ? ret : bench_carriage(config, 0, mechanics);
	ret = ret ? ret : bench_command(&bench, INCISE_STEPPER_ENABLE, 1);
	if (ret)
		note("a fresh motor: %s, faults %#x", strerror(-ret), status().faults);
	return !ret;
}

/* Goes on at a velocity until the motor has stopped for a fault; false: it never did. */
static bool run_into(int64_t velocity)
{
	return bench_until(&bench, 0, at_rest, INCISE_STEPPER_MODE_VELOCITY, velocity,
			   LONG);
}

/* Power was given a moment ago: at rest it also is before it has begun to move. */
static bool comes_to(int64_t target)
{
	int64_t end_ns = bench_now_ns() + LONG;
	bool there;

	do
		there = bench_until(&bench, 0, 1U << INCISE_STEPPER_STATE_READY,
				    INCISE_STEPPER_MODE_POSITION, target, LONG) &&
			status().position == target;
	while (!there && !status().faults && bench_now_ns() < end_ns);
	return there;
}

static int64_t any_velocity(const struct incise_stepper_config *config)
{
	int64_t velocity = draw_between(config->velocity / 4, config->velocity);

	return draw_between(0, 1) ? velocity : -velocity;
}

/* All three say the same, and the fault is the one that was made. */
static bool agrees(uint32_t fault)
{
	struct incise_stepper_motor_status is = status();
	int64_t carriage = simulator_number_of("carriage", "0", "position");
	bool right;

	bench_judge(&bench);
	right = is.state == INCISE_STEPPER_STATE_FAULT && is.faults == fault &&
		is.position == carriage && is.position == bench.log[0].position;
	if (!right)
		note("state %u, faults %#x instead of %#x; module %" PRId64
		     ", carriage %" PRId64 ", judge %" PRId64,
		     is.state, is.faults, fault, (int64_t)is.position, carriage,
		     bench.log[0].position);
	return right;
}

static void limits_stop(int rounds)
{
	bool right = true, leaves = true, step = true;

	for (int i = 0; i < rounds && right; i++) {
		struct incise_stepper_config config;
		int64_t at = draw_between(1, reach), velocity;
		char mechanics[64];

		snprintf(mechanics, sizeof(mechanics),
			 "min_at=%" PRId64 " max_at=%" PRId64, -at, at);
		right = fresh(mechanics, &config);
		velocity = any_velocity(&config);
		right = right && run_into(velocity);
		right = right && agrees(velocity > 0 ? INCISE_STEPPER_FAULT_LIMIT_MAX
						     : INCISE_STEPPER_FAULT_LIMIT_MIN);
		/* The step that reached it is the last one. */
		step &= status().position == (velocity > 0 ? at : -at);
		/* And it may leave, but not go on. */
		leaves &= bench_command(&bench, INCISE_STEPPER_CLEAR, 1) == 0 &&
			  bench_command(&bench, INCISE_STEPPER_ENABLE, 1) == 0;
		leaves &= comes_to(0);
		bench_command(&bench, INCISE_STEPPER_DISABLE, 1);
		leaves &= bench_until(&bench, 0, at_rest, INCISE_STEPPER_MODE_POSITION, 0,
				      LONG);
	}
	check(right, "a limit stops the motor with its fault, %d times", rounds);
	check(step, "no step follows the one that reached the limit");
	check(leaves, "away from it the motor may go");
}

/* An input comes on inside an edge of the step line. */
static void inputs_stop(const char *name, unsigned int line, bool low, uint32_t fault,
			int rounds)
{
	bool right = true, refused = true;

	for (int i = 0; i < rounds && right; i++) {
		struct incise_stepper_config config;

		right = fresh("", &config);
		simulator_write("scripts", "clear");
		right = right &&
			!simulator_write("scripts", "after=%d line=%u set=%u value=%d",
					 (int)draw_between(1, reach),
					 bench_line(0, BENCH_STEP), line, !low);
		right = right && run_into(any_velocity(&config)) && agrees(fault);
		refused &= bench_command(&bench, INCISE_STEPPER_CLEAR, 1) == -EBUSY &&
			   bench_command(&bench, INCISE_STEPPER_ENABLE, 1) ==
				   -ENOTRECOVERABLE;
		simulator_write("inputs", "%u %d", line, low);
		refused &= bench_command(&bench, INCISE_STEPPER_ENABLE, 1) ==
			   -ENOTRECOVERABLE;
	}
	check(right, "%s stops the motor at once, %d times", name, rounds);
	check(refused, "%s: no power until the cause is gone and the fault is cleared",
	      name);
}

/* The most that a motor may do after the last sign of life of its owner. */
static struct incise_profile_limits limits_of(const struct incise_stepper_config *config)
{
	return (struct incise_profile_limits){
		.tick_ns = config->tick_ns,
		.velocity = config->velocity,
		.acceleration = config->acceleration,
		.position_min = config->position_min,
		.position_max = config->position_max,
		.jerk = config->jerk,
	};
}

/*
 * Brings the motor to full speed and goes silent. Every 1 ms or sooner there was a sign of
 * life; @silent_ns is when the last one was.
 */
static bool speed_up(const struct incise_stepper_config *config, int64_t velocity,
		     int64_t *silent_ns)
{
	int64_t ramp_ns = 1000000000LL * config->velocity / config->acceleration;
	int64_t end_ns = bench_now_ns() + ramp_ns + 20000000;

	do {
		bench_want(&bench, 0, INCISE_STEPPER_MODE_VELOCITY, velocity);
		*silent_ns = bench_now_ns();
		bench_nap(1000000);
	} while (*silent_ns < end_ns);
	return status().state == INCISE_STEPPER_STATE_MOVING;
}

/* Steps that came after @ns, of those that are judged now. */
static uint64_t steps_after(int64_t ns, int64_t *last_ns)
{
	uint64_t steps;

	bench.log[0].mark_ns = ns;
	bench.log[0].marked = 0;
	bench_judge(&bench);
	steps = bench.log[0].marked;
	*last_ns = bench.log[0].lead_ns;
	bench.log[0].mark_ns = INT64_MAX;
	return steps;
}

static void wait_for_rest(int64_t ns)
{
	int64_t end = bench_now_ns() + ns;

	while (!(at_rest & 1U << status().state) && bench_now_ns() < end)
		bench_nap(1000000);
}

static void deadman_stops(int rounds)
{
	bool right = true, in_time = true, in_space = true;
	double worst_time = 0, worst_way = 0;

	for (int i = 0; i < rounds && right; i++) {
		struct incise_stepper_config config;
		struct incise_profile_limits limits;
		int64_t velocity, silent_ns, dead_ns, last_ns, time_ns;
		uint64_t steps, way;

		right = fresh("", &config);
		if (!right)
			break;
		/* Another deadman: the motor is without power for that. */
		bench_command(&bench, INCISE_STEPPER_DISABLE, 1);
		wait_for_rest(LONG);
		config.deadman_ns = draw_between(20000000, 200000000);
		right = !bench_configure(&bench, &config, 0) &&
			!bench_command(&bench, INCISE_STEPPER_ENABLE, 1);
		velocity = any_velocity(&config);
		bench_judge(&bench);
		if (!right || !speed_up(&config, velocity, &silent_ns)) {
			/* On a slow host that may be the deadman already. */
			right &= !virtual_time;
			continue;
		}
		wait_for_rest(LONG);
		limits = limits_of(&config);
		/* Seen at the next tick; a tick later it is found to be too old. */
		dead_ns = silent_ns + config.deadman_ns + 2 * config.tick_ns;
		steps = steps_after(dead_ns, &last_ns);
		right = agrees(INCISE_STEPPER_FAULT_DEADMAN);
		way = incise_profile_stopping_steps(&limits, llabs(velocity)) +
		      (uint64_t)llabs(velocity) * config.tick_ns / 1000000000 + 1;
		/* A tick of lateness against the profile, and what virtual time adds. */
		time_ns = dead_ns + config.tick_ns + 50000 +
			  incise_profile_stopping_ns(&limits, llabs(velocity));
		in_space &= steps <= way;
		in_time &= last_ns <= time_ns;
		worst_way = way && steps * 1.0 / way > worst_way ? steps * 1.0 / way
								 : worst_way;
		if (last_ns > dead_ns &&
		    (last_ns - dead_ns) * 1.0 / (time_ns - dead_ns) > worst_time)
			worst_time = (last_ns - dead_ns) * 1.0 / (time_ns - dead_ns);
		if (virtual_time && (steps > way || last_ns > time_ns))
			note("%" PRIu64 " steps, at most %" PRIu64 "; %" PRId64
			     " us, at most %" PRId64,
			     steps, way, (last_ns - dead_ns) / 1000,
			     (time_ns - dead_ns) / 1000);
	}
	check(right, "the deadman stops the motor, %d times", rounds);
	if (!virtual_time)
		return;
	note("of the way it may brake it took %.0f %% at most, of the time %.0f %%",
	     worst_way * 100, worst_time * 100);
	check(in_space, "within the stated distance");
	check(in_time, "within its time");
}

static int second_open(int flags)
{
	int fd = open(bench.cdev, flags | O_CLOEXEC);
	int ret = fd < 0 ? -errno : 0;

	if (fd >= 0)
		close(fd);
	return ret;
}

static void owners(int rounds)
{
	bool busy = true, right = true, stays = true;
	int ret;

	for (int i = 0; i < rounds && right; i++) {
		struct incise_stepper_config config;
		int64_t silent_ns, velocity;
		uint64_t before;

		right = fresh("", &config);
		velocity = any_velocity(&config);
		if (!right || !speed_up(&config, velocity, &silent_ns))
			break;
		before = status().steps_up + status().steps_down;
		for (int k = 0; k < 20; k++) {
			busy &= second_open(O_RDWR) == -EBUSY && !second_open(O_RDONLY);
			busy &= second_open(O_WRONLY) == -EBUSY;
			ret = module_unload("incise_stepper");
			stays &= ret == -EAGAIN || ret == -EBUSY;
			bench_want(&bench, 0, INCISE_STEPPER_MODE_VELOCITY, velocity);
			bench_nap(2000000);
		}
		right = status().state == INCISE_STEPPER_STATE_MOVING &&
			status().steps_up + status().steps_down > before;
		bench_command(&bench, INCISE_STEPPER_DISABLE, 1);
		wait_for_rest(LONG);
	}
	check(busy,
	      "a second owner is told EBUSY while the motor moves; a watcher may come");
	check(stays, "unloading is refused while it moves");
	check(right, "and the motor goes on");
}

/* The child is the owner, moves, and is killed when it has reported that it does. */
static void owner_is_killed(int rounds)
{
	struct incise_stepper_config config;
	bool right = true;

	for (int i = 0; i < rounds && right; i++) {
		int ready[2], wait_status;
		int64_t before;
		pid_t child;
		char byte;

		bench_close(&bench);
		if (pipe(ready))
			return;
		child = fork();
		if (!child) {
			int64_t silent_ns;

			if (bench_open(&bench) || !fresh("", &config) ||
			    !speed_up(&config, any_velocity(&config), &silent_ns))
				_exit(1);
			if (write(ready[1], "m", 1) != 1)
				_exit(1);
			for (;;) {
				bench_want(&bench, 0, INCISE_STEPPER_MODE_VELOCITY,
					   config.velocity);
				bench_nap(1000000);
			}
		}
		close(ready[1]);
		right = read(ready[0], &byte, 1) == 1;
		close(ready[0]);
		kill(child, SIGKILL);
		waitpid(child, &wait_status, 0);
		/* It died by the signal while it moved, not by itself. */
		right &= WIFSIGNALED(wait_status);
		right &= bench_open(&bench) == 0;
		wait_for_rest(LONG);
		right &= status().state == INCISE_STEPPER_STATE_FAULT &&
			 status().faults == INCISE_STEPPER_FAULT_OWNER;
		before = status().position;
		bench_nap(50000000);
		right &= status().position == before &&
			 simulator_number_of("carriage", "0", "position") == before;
		if (!right)
			note("round %d: state %u, faults %#x", i, status().state,
			     status().faults);
		/* The child's judge is gone: this one restarts. */
		simulator_write("edges", "reset");
		bench.log[0].begun = false;
	}
	check(right, "an owner that is killed leaves a motor at rest, %d times", rounds);
}

static int driver_write(const char *file)
{
	char path[128];
	int fd, ret = 0;

	snprintf(path, sizeof(path), DRIVER "/%s", file);
	fd = open(path, O_WRONLY | O_CLOEXEC);
	if (fd < 0 || write(fd, bench.dev_name, strlen(bench.dev_name)) < 0)
		ret = -errno;
	if (fd >= 0)
		close(fd);
	return ret;
}

static void is_unbound(int rounds)
{
	bool right = true, gone = true;

	for (int i = 0; i < rounds && right; i++) {
		struct incise_stepper_config config;
		struct incise_stepper_controller info;
		int64_t silent_ns, position;

		right = fresh("", &config) &&
			speed_up(&config, any_velocity(&config), &silent_ns);
		if (!right)
			break;
		right = !driver_write("unbind");
		bench_judge(&bench);
		position = simulator_number_of("carriage", "0", "position");
		right &= bench.log[0].position == position && !bench.log[0].step_on;
		/* The pages are still memory; nobody reads them. */
		bench_want(&bench, 0, INCISE_STEPPER_MODE_VELOCITY, config.velocity);
		gone &= ioctl(bench.fd, INCISE_STEPPER_GET_INFO, &info) == -1 &&
			errno == ENODEV;
		gone &= bench_command(&bench, INCISE_STEPPER_ENABLE, 1) == -ENODEV;
		bench_nap(50000000);
		right &= simulator_number_of("carriage", "0", "position") == position;
		bench_close(&bench);
		right &= !driver_write("bind");
		/* The node may have another number now: it is asked for again. */
		right &= !bench_name(&bench) && !bench_open(&bench);
		simulator_write("edges", "reset");
		bench.log[0].begun = false;
	}
	check(right, "unbound while it moves it comes to rest, %d times", rounds);
	check(gone, "its owner is told ENODEV");
}

int main(int argc, char **argv)
{
	int rounds = argc > 1 ? atoi(argv[1]) : 10;
	const char *profile = getenv("INCISE_VM_PROFILE");
	int ret;

	virtual_time = profile && !strcmp(profile, "deterministic");
	draw_seed(argc > 2 ? strtoull(argv[2], NULL, 0) : 1);
	ret = bench_bind(&bench, 1);
	ret = ret ? ret : bench_open(&bench);
	if (!check(!ret, "a motor is bound (%s)", strerror(-ret)))
		return 1;
	reach = bench.info.rate_max < 4000 ? bench.info.rate_max / 10 : 400;
	limits_stop(rounds);
	inputs_stop("e-stop", BENCH_ESTOP, true, INCISE_STEPPER_FAULT_ESTOP, rounds);
	inputs_stop("the power stage's fault", bench_line(0, BENCH_FAULT), false,
		    INCISE_STEPPER_FAULT_ALARM, rounds);
	deadman_stops(rounds);
	owners(rounds / 10 + 1);
	check(!bench_faulty(&bench), "not one of %" PRIu64 " edges breaks a promise",
	      bench.log[0].edges);
	owner_is_killed(rounds / 4 + 1);
	is_unbound(rounds / 4 + 1);
	check(!bench_faulty(&bench), "nor one of those that came before an unbind");
	bench_close(&bench);
	check(!bench_unbind(&bench), "the motor is unbound");
	return tap_failures != 0;
}
