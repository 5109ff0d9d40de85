// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A fault is heard while a program of the highest priority keeps the processor of the motor's
 * timer. The order decides, not the time, which is printed:
 *
 *   CPU 1   ENABLE  ── hog, FIFO 99 ═════════ stops when the fault was heard, or after 20 s
 *   CPU 0   poll(), FIFO 60 ──── deadman ── event
 */
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdio.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "../bench.h"
#include "../tap.h"

#define DEADMAN_NS 200000000
#define HOG_NS 20000000000

static struct bench bench;
static atomic_bool heard, gave_up, begun;

static bool become(int cpu, int priority)
{
	struct sched_param param = {.sched_priority = priority};
	cpu_set_t set;

	CPU_ZERO(&set);
	CPU_SET(cpu, &set);
	return !sched_setaffinity(0, sizeof(set), &set) &&
	       !sched_setscheduler(0, SCHED_FIFO, &param);
}

/* ENABLE from here: the timer is of this processor. */
static void *hog_processor(void *enabled)
{
	int64_t until = bench_now_ns() + HOG_NS;

	*(bool *)enabled =
		become(1, 99) && !bench_command(&bench, INCISE_STEPPER_ENABLE, 1);
	atomic_store(&begun, true);
	while (!atomic_load(&heard) && *(bool *)enabled)
		if (bench_now_ns() > until) {
			atomic_store(&gave_up, true);
			break;
		}
	return NULL;
}

/* Time of the event FAULT, or 0. */
static int64_t hear_fault(void)
{
	struct pollfd wait = {.fd = bench.fd, .events = POLLIN};
	struct incise_stepper_event event;

	while (poll(&wait, 1, 2 * (int)(HOG_NS / 1000000)) == 1)
		if (read(bench.fd, &event, sizeof(event)) == sizeof(event) &&
		    event.type == INCISE_STEPPER_EVENT_FAULT)
			return event.t_ns;
	return 0;
}

int main(void)
{
	struct incise_stepper_config config = {0};
	bool enabled = false;
	pthread_t hog;
	int64_t t_ns;

	if (!check(!bench_bind(&bench, 1) && !bench_open(&bench), "a controller"))
		return 0;
	check(!ioctl(bench.fd, INCISE_STEPPER_GET_CONFIG, &config), "its config");
	config.deadman_ns = DEADMAN_NS;
	check(!bench_configure(&bench, &config, 0), "its deadman is set");
	check(become(0, 60) && !pthread_create(&hog, NULL, hog_processor, &enabled),
	      "a hog on the other processor");
	t_ns = hear_fault();
	printf("# heard %.3f ms after the fault\n",
	       (double)(bench_now_ns() - t_ns) / 1e6);
	atomic_store(&heard, true);
	pthread_join(hog, NULL);
	check(enabled, "it has power from there");
	check(t_ns && !atomic_load(&gave_up), "the fault is heard before the hog ends");
	bench_close(&bench);
	check(!bench_unbind(&bench), "the controller goes");
	return 0;
}
