// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What a process of a real-time loop holds; see incise/realtime.h.
 *
 *   stack of the loop   high ┌──────────────┐
 *                            │ callers      │
 *                       now  ├──────────────┤
 *                            │ touched      │ at most 128 KiB
 *                            │              │
 *                            │ left alone   │ 16 KiB, and the guard page
 *                       low  └──────────────┘
 */
#include <errno.h>
#include <fcntl.h>
#include <malloc.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <unistd.h>
#include "realtime.h"

/* Of threads: all of a stack is resident when memory is locked. */
#define STACK_BYTES (256 << 10)
#define TOUCH_BYTES (128 << 10)
#define SPARE_BYTES (16 << 10)

struct incise_realtime {
	struct incise_realtime_setup setup;
	int idle_fd; /* of /dev/cpu_dma_latency; -1 */
};

void incise_realtime_prepare(void)
{
	pthread_attr_t attributes;

	mallopt(M_ARENA_MAX, 1);
	mallopt(M_TRIM_THRESHOLD, -1);
	mallopt(M_MMAP_MAX, 0);
	if (!pthread_attr_init(&attributes)) {
		pthread_attr_setstacksize(&attributes, STACK_BYTES);
		pthread_setattr_default_np(&attributes);
		pthread_attr_destroy(&attributes);
	}
	/* They are put together while the program runs, which holds up who uses them. */
	prctl(PR_SET_THP_DISABLE, 1, 0, 0, 0);
}

int incise_realtime_checks(const struct incise_realtime_setup *setup,
			   struct incise_realtime_check *checks, int n)
{
	struct realtime_answers answers;
	int rc = realtime_check_setup(setup, NULL);

	if (!rc)
		rc = realtime_try(setup, &answers);
	return rc ? rc : realtime_judge(setup, &answers, "", checks, n);
}

/* What is needed is tried; 0 when all of it is there. */
static int ask(const struct incise_realtime_setup *setup, struct incise_error *err)
{
	struct incise_realtime_check checks[INCISE_REALTIME_CHECKS];
	struct realtime_answers answers;
	int rc = realtime_check_setup(setup, err), n;

	if (rc)
		return rc;
	rc = realtime_try(setup, &answers);
	if (rc)
		return incise_error_set(err, -rc, "real time: no thread to try it on: %s",
					strerror(-rc));
	n = realtime_judge(setup, &answers, "", checks, INCISE_REALTIME_CHECKS);
	return realtime_denied(&answers, checks, n, err);
}

/* The kernel holds it as long as the file is open. */
static int hold_idle(void)
{
	static const int32_t latency_us;
	int fd = open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC);

	if (fd >= 0 &&
	    write(fd, &latency_us, sizeof(latency_us)) != (ssize_t)sizeof(latency_us)) {
		close(fd);
		fd = -1;
	}
	return fd;
}

struct incise_realtime *incise_realtime_new(const struct incise_realtime_setup *setup,
					    struct incise_error *err)
{
	struct incise_realtime *realtime;

	if (ask(setup, err))
		return NULL;
	realtime = malloc(sizeof(*realtime));
	if (!realtime) {
		incise_error_set(err, ENOMEM, "real time: no memory");
		return NULL;
	}
	*realtime = (struct incise_realtime){.setup = *setup};
	if (mlockall(MCL_CURRENT | MCL_FUTURE)) {
		incise_error_set(err, errno,
				 "real time: the memory cannot be locked: %s; run `sudo "
				 "prlimit --pid $$ --rtprio=90 --memlock=unlimited` and "
				 "start again",
				 strerror(errno));
		free(realtime);
		return NULL;
	}
	realtime->idle_fd = hold_idle();
	return realtime;
}

/* A function of its own, so that what it takes of the stack is free again. */
static __attribute__((noinline)) void touch(size_t bytes)
{
	volatile char *stack = __builtin_alloca(bytes);

	for (size_t i = 0; i < bytes; i += 1024)
		stack[i] = 0;
}

/* However small the stack is that the caller gave its thread. */
static void touch_stack(void)
{
	pthread_attr_t attributes;
	size_t bytes, room = 0;
	void *low;
	uintptr_t here = (uintptr_t)__builtin_frame_address(0);

	if (pthread_getattr_np(pthread_self(), &attributes))
		return;
	if (!pthread_attr_getstack(&attributes, &low, &bytes) &&
	    here - (uintptr_t)low < bytes)
		room = here - (uintptr_t)low;
	pthread_attr_destroy(&attributes);
	if (room > TOUCH_BYTES + SPARE_BYTES)
		room = TOUCH_BYTES + SPARE_BYTES;
	if (room > SPARE_BYTES)
		touch(room - SPARE_BYTES);
}

int incise_realtime_enter(const struct incise_realtime *realtime,
			  struct incise_error *err)
{
	int64_t period_ns = realtime->setup.period_ns;
	struct timespec period = {period_ns / 1000000000, period_ns % 1000000000};
	int rc;

	touch_stack();
	rc = realtime_take_cpu(&realtime->setup);
	if (rc)
		return incise_error_set(err, rc, "real time: CPU %d cannot be had: %s",
					realtime->setup.cpu, strerror(rc));
	rc = realtime_take_policy(&realtime->setup);
	/* What a thread of SCHED_DEADLINE had is free a period after it has ended. */
	for (int i = 0; rc == EBUSY && i < 4; i++) {
		nanosleep(&period, NULL);
		rc = realtime_take_policy(&realtime->setup);
	}
	if (rc)
		return incise_error_set(
			err, rc,
			"real time: the loop's thread was refused what was granted when "
			"it was tried: %s",
			strerror(rc));
	return 0;
}

void incise_realtime_free(struct incise_realtime *realtime)
{
	if (!realtime)
		return;
	if (realtime->idle_fd >= 0)
		close(realtime->idle_fd);
	munlockall();
	free(realtime);
}
