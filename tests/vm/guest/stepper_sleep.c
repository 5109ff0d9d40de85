// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The machine goes to sleep while a motor moves and SYNC pulses, as far as each level of the
 * kernel's pm_test, and wakes up again:
 *
 *   freezer ── devices ── platform ── processors ── core        (suspend to memory)
 *
 * Programs stand from the first level on: the deadman comes. The module's own part comes with
 * the second: the motor brakes and has the fault SUSPEND. Nothing moves by itself after it.
 *
 *   stepper_sleep
 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/wait.h>

#include "../bench.h"
#include "../tap.h"

static struct bench bench;

static const struct level {
	const char *name;
	const char *delay;   /* s: how long pm_test stays there */
	uint64_t deadman_ns; /* 10 s: later than all of the sleep */
	uint32_t fault;
	bool short_of_memory;
} levels[] = {
	{"freezer", "1", 200000000, INCISE_STEPPER_FAULT_DEADMAN, false},
	{"devices", "0", 10000000000, INCISE_STEPPER_FAULT_SUSPEND, false},
	{"platform", "0", 10000000000, INCISE_STEPPER_FAULT_SUSPEND, false},
	{"processors", "0", 10000000000, INCISE_STEPPER_FAULT_SUSPEND, false},
	{"core", "0", 10000000000, INCISE_STEPPER_FAULT_SUSPEND, false},
	{"core", "0", 10000000000, INCISE_STEPPER_FAULT_SUSPEND, true},
};

static int put(const char *path, const char *word)
{
	FILE *file = fopen(path, "w");
	int ret = file ? 0 : -errno;

	if (!file)
		return ret;
	if (fputs(word, file) < 0 || fflush(file))
		ret = -errno;
	fclose(file);
	return ret;
}

static uint64_t pulses(void)
{
	struct incise_stepper_sync sync = {0};

	ioctl(bench.fd, INCISE_STEPPER_GET_SYNC, &sync);
	return sync.pulses;
}

static bool moves(const struct level *level)
{
	struct incise_stepper_sync sync = {.period_ns = 1000000, .width_ns = 100000};
	struct incise_stepper_config config = {0};
	int ret = ioctl(bench.fd, INCISE_STEPPER_GET_CONFIG, &config);

	config.deadman_ns = level->deadman_ns;
	/* In real time a host that pauses is no fault of this test's. */
	config.late_max = 1000;
	config.velocity = config.velocity < 500 ? config.velocity : 500;
	ret = ret ? ret : bench_configure(&bench, &config, 0);
	ret = ret ? ret : ioctl(bench.fd, INCISE_STEPPER_SET_SYNC, &sync);
	ret = ret ? ret : bench_command(&bench, INCISE_STEPPER_ENABLE, 1);
	if (ret)
		return false;
	bench_want(&bench, 0, INCISE_STEPPER_MODE_VELOCITY, config.velocity);
	while (!bench_look(&bench, 0).steps_up && !bench_look(&bench, 0).faults)
		bench_nap(1000000);
	return true;
}

static void sleeps(const struct level *level)
{
	const char *when = level->short_of_memory ? " without memory" : "";
	struct incise_stepper_motor_status after, later;
	pid_t pid = level->short_of_memory ? bench_take_memory() : -1;
	uint64_t beats;
	int ret;

	check(moves(level), "%s%s: the motor moves", level->name, when);
	ret = put("/sys/module/suspend/parameters/pm_test_delay", level->delay);
	ret = ret ? ret : put("/sys/power/pm_test", level->name);
	ret = ret ? ret : put("/sys/power/state", "mem");
	check(!ret, "%s%s: the machine sleeps (%s)", level->name, when, strerror(-ret));
	after = bench_look(&bench, 0);
	beats = pulses();
	bench_nap(20000000);
	later = bench_look(&bench, 0);
	check(after.faults & level->fault && after.state == INCISE_STEPPER_STATE_FAULT,
	      "%s%s: the motor is off with its fault (%#x, state %u)", level->name, when,
	      after.faults, after.state);
	check(later.position == after.position && !bench_faulty(&bench),
	      "%s%s: nothing moves after it", level->name, when);
	check(pulses() > beats, "%s%s: SYNC goes on after it", level->name, when);
	if (pid > 0) {
		kill(pid, SIGKILL);
		waitpid(pid, NULL, 0);
	}
	check(!bench_command(&bench, INCISE_STEPPER_CLEAR, 1),
	      "%s%s: the fault is cleared", level->name, when);
}

int main(void)
{
	if (!check(!bench_bind(&bench, 1) && !bench_open(&bench), "a controller"))
		return 1;
	for (unsigned int i = 0; i < sizeof(levels) / sizeof(*levels); i++)
		sleeps(&levels[i]);
	bench_judge(&bench);
	check(!bench_faulty(&bench), "every edge was right");
	bench_close(&bench);
	check(!bench_unbind(&bench), "it is unbound");
	return tap_failures != 0;
}
