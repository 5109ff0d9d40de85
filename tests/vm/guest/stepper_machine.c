// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The stepper module and the rest of the machine: the share of a processor that ticks take,
 * idle states, sleep, and pages that a former owner holds on to.
 *
 *   stepper_machine
 *
 * The share of the processor is asserted in virtual time only.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/uio.h>
#include <unistd.h>

#include "../bench.h"
#include "../tap.h"

#define LONG 60000000000 /* ns: never, on any host */
#define MOTORS INCISE_STEPPER_MOTORS_MAX
#define ALL ((1U << MOTORS) - 1)

static struct bench bench;
static bool virtual_time;

static struct incise_stepper_config config_of(unsigned int motor, uint32_t tick_ns)
{
	return (struct incise_stepper_config){
		.motor = motor,
		.tick_ns = tick_ns,
		.velocity = bench.info.rate_max < 1000 ? bench.info.rate_max : 1000,
		.acceleration = 100000,
		.late_max = 1000,
		.position_min = -100000,
		.position_max = 100000,
		.deadman_ns = 10000000000,
		.high_ns = bench.info.pulse_ns,
		.low_ns = bench.info.pulse_ns,
	};
}

static int ticks_of(uint32_t tick_ns)
{
	int ret = 0;

	for (unsigned int i = 0; i < MOTORS && !ret; i++) {
		struct incise_stepper_config config = config_of(i, tick_ns);

		ret = bench_configure(&bench, &config, 0);
	}
	return ret;
}

/* Turns of a loop in 20 ms. */
static uint64_t turns(void)
{
	int64_t end_ns = bench_now_ns() + 20000000;
	uint64_t n = 0;

	while (bench_now_ns() < end_ns)
		n++;
	return n;
}

static void wait_for_rest(void)
{
	int64_t end_ns = bench_now_ns() + LONG;

	for (unsigned int i = 0; i < MOTORS; i++)
		while (bench_look(&bench, i).state != INCISE_STEPPER_STATE_DISABLED &&
		       bench_now_ns() < end_ns)
			bench_nap(1000000);
}

/* Eight motors that stand, with the shortest tick that is taken. */
static void ticks_leave_the_processor(void)
{
	uint32_t low = 50000, high = 2000000;
	uint64_t alone, beside;

	while (low < high) {
		uint32_t middle = low + (high - low) / 2;

		if (ticks_of(middle))
			low = middle + 1;
		else
			high = middle;
	}
	if (!check(!ticks_of(low), "%u motors take ticks of %u us", MOTORS, low / 1000))
		return;
	note("a tick is at least %u ns", bench.info.tick_min_ns);
	check(low == 50000 || low == bench.info.tick_min_ns,
	      "info says how short a tick may be");
	check(low == 50000 || ticks_of(low - 1) == -ERANGE, "a shorter one is ERANGE");
	ticks_of(low);
	alone = turns();
	check(!bench_command(&bench, INCISE_STEPPER_ENABLE, ALL), "all have power");
	beside = turns();
	bench_command(&bench, INCISE_STEPPER_DISABLE, ALL);
	wait_for_rest();
	note("standing they leave %.0f %% of a processor", 100.0 * beside / alone);
	if (virtual_time)
		check(beside >= alone * 7 / 10,
		      "standing they leave 70 %% of a processor to others");
}

/* A page that is lent to a pipe, a pin for as long as one likes, is not to be had. */
static void pages_are_not_lent(void)
{
	struct iovec page = {(void *)bench.setpoint, 64};
	struct iovec status = {(void *)bench.status, 64};
	int pipes[2];

	if (pipe(pipes))
		return;
	check(vmsplice(pipes[1], &page, 1, 0) == -1 && errno == EFAULT,
	      "the page of set-points cannot be pinned beyond its owner's time");
	check(vmsplice(pipes[1], &status, 1, 0) == -1 && errno == EFAULT,
	      "nor can that of the status");
	close(pipes[0]);
	close(pipes[1]);
}

/* The lateness that idle states may cost now, in us; -1: nobody says. */
static int32_t idle_us(void)
{
	int fd = open("/dev/cpu_dma_latency", O_RDONLY | O_CLOEXEC);
	int32_t us = -1;

	if (fd >= 0 && read(fd, &us, sizeof(us)) != sizeof(us))
		us = -1;
	if (fd >= 0)
		close(fd);
	return us;
}

static void idle_states_wait(void)
{
	int64_t end_ns = bench_now_ns() + LONG;

	if (idle_us() < 0) {
		printf("ok idle states # skip this kernel has none\n");
		return;
	}
	check(idle_us() > 0, "idle states are allowed while no motor has power");
	bench_command(&bench, INCISE_STEPPER_ENABLE, 1);
	check(idle_us() == 0, "none while one has");
	bench_command(&bench, INCISE_STEPPER_DISABLE, 1);
	wait_for_rest();
	while (!idle_us() && bench_now_ns() < end_ns)
		bench_nap(1000000);
	check(idle_us() > 0, "and again when it has none");
}

static struct incise_stepper_sync sync_now(void)
{
	struct incise_stepper_sync sync = {0};

	ioctl(bench.fd, INCISE_STEPPER_GET_SYNC, &sync);
	return sync;
}

/* Two sleeps: one while a pulse is out, one between two. */
static void sync_sleeps(uint32_t width_ns)
{
	struct incise_stepper_sync sync = {.period_ns = 1000000, .width_ns = width_ns};
	struct incise_stepper_sync before, after;
	int64_t beat;
	int ret;

	ret = ioctl(bench.fd, INCISE_STEPPER_SET_SYNC, &sync);
	bench_nap(10300000);
	bench_command(&bench, INCISE_STEPPER_ENABLE, 1);
	ret |= simulator_write("sleep", "suspend=%s", bench.dev_name);
	check(!ret, "the machine sleeps while SYNC pulses");
	before = sync_now();
	bench_judge(&bench);
	bench_nap(20000000);
	after = sync_now();
	check(before.pulses > 0 && after.pulses == before.pulses,
	      "no pulse of SYNC in its sleep (%d)", (int)(after.pulses - before.pulses));
	check(bench_look(&bench, 0).faults == INCISE_STEPPER_FAULT_SUSPEND,
	      "motors have the fault SUSPEND");
	ret = simulator_write("sleep", "resume=%s", bench.dev_name);
	bench_nap(10000000);
	after = sync_now();
	check(!ret && after.pulses > before.pulses, "it goes on after the sleep");
	beat = (int64_t)(after.pulses + after.missed - 1) * 1000000;
	check(after.missed >= 19 && after.last_ns - after.first_ns >= beat &&
		      (!virtual_time || after.last_ns - after.first_ns < beat + 100000),
	      "in its beat, and counts the pulses that were left out");
	sync = (struct incise_stepper_sync){0};
	ioctl(bench.fd, INCISE_STEPPER_SET_SYNC, &sync);
	check(!bench_command(&bench, INCISE_STEPPER_CLEAR, 1), "the fault is cleared");
}

int main(void)
{
	const char *profile = getenv("INCISE_VM_PROFILE");
	int ret;

	virtual_time = profile && !strcmp(profile, "deterministic");
	ret = bench_bind(&bench, MOTORS);
	ret = ret ? ret : bench_open(&bench);
	if (!check(!ret, "%u motors are bound (%s)", MOTORS, strerror(-ret)))
		return 1;
	ticks_leave_the_processor();
	pages_are_not_lent();
	idle_states_wait();
	sync_sleeps(10000);
	sync_sleeps(500000);
	bench_close(&bench);
	check(!bench_unbind(&bench), "they are unbound");
	return tap_failures != 0;
}
