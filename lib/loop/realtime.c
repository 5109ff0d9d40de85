// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Real time for a process and its loop's thread; see incise/realtime.h. Every right is tried
 * on a thread that ends at once, before anything is changed.
 *
 *   stack of the loop   high ┌──────────────┐
 *                            │ callers      │
 *                       now  ├──────────────┤
 *                            │ touched      │ at most 128 KiB
 *                            │              │
 *                            │ left alone   │ 16 KiB, and the guard page
 *                       low  └──────────────┘
 *
 *   SCHED_DEADLINE   |▐█████|······|▐█████|······|      █ may run, · is kept from it
 *                    |<- period = deadline ->|
 */
#include <errno.h>
#include <fcntl.h>
#include <malloc.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
#include "proc_file.h"
#include "realtime.h"

/* For each thread: with memory locked, the whole stack is resident. */
#define STACK_BYTES (256 << 10)
#define TOUCH_BYTES (128 << 10)
#define SPARE_BYTES (16 << 10)

/* Enough for a thread that makes three calls. */
#define TRIAL_STACK_BYTES (64 << 10)

/* Newer C libraries have names for both, and the structure. */
#define POLICY_DEADLINE 6
#define RESET_ON_FORK 1

struct attributes {
	uint32_t size, policy;
	uint64_t flags;
	int32_t nice;
	uint32_t priority;
	uint64_t runtime_ns, deadline_ns, period_ns;
};

/* Periods of SCHED_DEADLINE: /proc/sys/kernel/sched_deadline_period_{min,max}_us. */
#define DEADLINE_MIN_NS 100000

/* Half of the period: ticks need far less, and a loop that hangs leaves the other half. */
#define DEADLINE_SHARE 2

/* Threads, rings and modules of devices map up to this much more. */
#define DEVICE_BYTES (32ULL << 20)
/* More than a haptic loop ever has: some sanitizers map terabytes. */
#define LOCK_BYTES_MAX (64ULL << 30)

static int check_realtime_setup(const struct incise_realtime_setup *setup,
				struct incise_error *err)
{
	bool deadline = setup->policy == INCISE_REALTIME_DEADLINE;

	if (!deadline && setup->policy != INCISE_REALTIME_FIFO)
		return incise_error_set(err, EINVAL, "real time: no such policy");
	if (!deadline &&
	    (setup->priority < 1 || setup->priority > INCISE_REALTIME_PRIORITY_MAX))
		return incise_error_set(
			err, EINVAL,
			"real time: priority %d: expected 1 to %d, below the threads of "
			"devices, which are at 85",
			setup->priority, INCISE_REALTIME_PRIORITY_MAX);
	if (setup->cpu < INCISE_REALTIME_ANY_CPU || setup->cpu >= CPU_SETSIZE)
		return incise_error_set(err, EINVAL,
					"real time: CPU %d: expected 0 to %d", setup->cpu,
					CPU_SETSIZE - 1);
	if (setup->period_ns < 50000 || setup->period_ns > 1000000000)
		return incise_error_set(err, EINVAL,
					"real time: a period of %lld ns: expected 50000 "
					"to 1000000000",
					(long long)setup->period_ns);
	if (deadline && setup->cpu >= 0)
		return incise_error_set(
			err, ENOTSUP,
			"real time: SCHED_DEADLINE runs on all CPUs; remove CPU %d, or "
			"use SCHED_FIFO",
			setup->cpu);
	if (deadline && setup->period_ns < DEADLINE_MIN_NS)
		return incise_error_set(
			err, EINVAL,
			"real time: SCHED_DEADLINE has no periods below 0.1 ms; run "
			"the loop at 10000 Hz or less, or use SCHED_FIFO");
	return 0;
}

static int take_deadline(const struct incise_realtime_setup *setup)
{
	struct attributes attributes = {
		.size = sizeof(attributes),
		.policy = POLICY_DEADLINE,
		.flags = RESET_ON_FORK,
		.runtime_ns = (uint64_t)setup->period_ns / DEADLINE_SHARE,
		.deadline_ns = (uint64_t)setup->period_ns,
		.period_ns = (uint64_t)setup->period_ns,
	};

	return syscall(SYS_sched_setattr, 0, &attributes, 0) ? errno : 0;
}

static int take_policy(const struct incise_realtime_setup *setup)
{
	struct sched_param priority = {.sched_priority = setup->priority};

	if (setup->policy == INCISE_REALTIME_DEADLINE)
		return take_deadline(setup);
	return pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority);
}

static int take_cpu(const struct incise_realtime_setup *setup)
{
	cpu_set_t cpus;

	if (setup->cpu < 0)
		return 0;
	CPU_ZERO(&cpus);
	CPU_SET(setup->cpu, &cpus);
	return sched_setaffinity(0, sizeof(cpus), &cpus) ? errno : 0;
}

struct trial {
	const struct incise_realtime_setup *setup;
	struct realtime_answers *answers;
};

static void *try_thread(void *argument)
{
	struct trial *trial = argument;

	trial->answers->cpu_error = take_cpu(trial->setup);
	trial->answers->policy_error = take_policy(trial->setup);
	return NULL;
}

/* On a thread of its own: the caller keeps its policy and CPUs. */
static int try_policy(struct trial *trial)
{
	pthread_attr_t attributes;
	sigset_t all, before;
	pthread_t thread;
	int rc;

	rc = pthread_attr_init(&attributes);
	if (rc)
		return -rc;
	pthread_attr_setstacksize(&attributes, TRIAL_STACK_BYTES);
	sigfillset(&all);
	pthread_sigmask(SIG_SETMASK, &all, &before);
	rc = pthread_create(&thread, &attributes, try_thread, trial);
	pthread_sigmask(SIG_SETMASK, &before, NULL);
	pthread_attr_destroy(&attributes);
	if (!rc)
		pthread_join(thread, NULL);
	return -rc;
}

/* Memory that is mapped and not locked yet, and reserve for devices. */
static uint64_t bytes_to_lock(void)
{
	char text[4096], *at;
	unsigned long long size_kB = 0, locked_kB = 0;

	proc_file_read("", "/proc/self/status", text, sizeof(text));
	at = strstr(text, "\nVmSize:");
	if (at)
		size_kB = strtoull(at + 8, NULL, 10);
	at = strstr(text, "\nVmLck:");
	if (at)
		locked_kB = strtoull(at + 7, NULL, 10);
	if (size_kB > LOCK_BYTES_MAX / 1024)
		size_kB = LOCK_BYTES_MAX / 1024;
	if (locked_kB > size_kB)
		locked_kB = size_kB;
	return (size_kB - locked_kB) * 1024 + DEVICE_BYTES;
}

/*
 * The kernel counts addresses, not pages: locking an empty range gives the answer, and
 * MLOCK_ONFAULT takes no memory for it. Older kernels want the range to be readable.
 */
static int try_lock(uint64_t bytes)
{
	void *range = mmap(NULL, bytes, PROT_READ,
			   MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
	int rc;

	if (range == MAP_FAILED)
		return errno;
	rc = syscall(SYS_mlock2, range, (size_t)bytes, MLOCK_ONFAULT) ? errno : 0;
	munmap(range, bytes);
	return rc;
}

/* A program may raise its soft limit to the hard limit by itself. */
static rlim_t raise_limit(int resource)
{
	struct rlimit limit;

	if (getrlimit(resource, &limit))
		return 0;
	if (limit.rlim_cur != limit.rlim_max) {
		rlim_t before = limit.rlim_cur;

		limit.rlim_cur = limit.rlim_max;
		if (setrlimit(resource, &limit))
			return before;
	}
	return limit.rlim_cur;
}

int realtime_try(const struct incise_realtime_setup *setup,
		 struct realtime_answers *answers)
{
	struct trial trial = {setup, answers};
	struct timespec resolution;
	int fd;

	*answers = (struct realtime_answers){
		.rtprio = raise_limit(RLIMIT_RTPRIO),
		.memlock = raise_limit(RLIMIT_MEMLOCK),
		.lock_bytes = bytes_to_lock(),
		.clock_resolution_ns = INT64_MAX,
	};
	answers->lock_error = try_lock(answers->lock_bytes);
	if (!clock_getres(CLOCK_MONOTONIC, &resolution) && !resolution.tv_sec)
		answers->clock_resolution_ns = resolution.tv_nsec;
	/* Opening alone requests nothing. */
	fd = open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC);
	answers->idle_error = fd < 0 ? errno : 0;
	if (fd >= 0)
		close(fd);
	return try_policy(&trial);
}

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
	/* The kernel merges pages while the program runs, and their users wait. */
	prctl(PR_SET_THP_DISABLE, 1, 0, 0, 0);
}

int incise_realtime_checks(const struct incise_realtime_setup *setup,
			   struct incise_realtime_check *checks, int n)
{
	struct realtime_answers answers;
	int rc = check_realtime_setup(setup, NULL);

	if (!rc)
		rc = realtime_try(setup, &answers);
	return rc ? rc : realtime_judge(setup, &answers, "", checks, n);
}

/* 0 when everything that is needed is granted. */
static int require(const struct incise_realtime_setup *setup, struct incise_error *err)
{
	struct incise_realtime_check checks[INCISE_REALTIME_CHECKS];
	struct realtime_answers answers;
	int rc = check_realtime_setup(setup, err), n;

	if (rc)
		return rc;
	rc = realtime_try(setup, &answers);
	if (rc)
		return incise_error_set(err, -rc,
					"real time: no thread for the test: "
					"%s",
					strerror(-rc));
	n = realtime_judge(setup, &answers, "", checks, INCISE_REALTIME_CHECKS);
	return realtime_denied(&answers, checks, n, err);
}

/* The request holds as long as the file is open. */
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

	if (require(setup, err))
		return NULL;
	realtime = malloc(sizeof(*realtime));
	if (!realtime)
		return INCISE_ERROR_NULL(err, ENOMEM, "real time: no memory");
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

/* A function of its own, so that its part of the stack is free again. */
static __attribute__((noinline)) void touch(size_t bytes)
{
	volatile char *stack = __builtin_alloca(bytes);

	for (size_t i = 0; i < bytes; i += 1024)
		stack[i] = 0;
}

/* Works with any stack size that the caller gave its thread. */
static void touch_stack(void)
{
	pthread_attr_t attributes;
	size_t bytes, below = 0;
	void *low;
	uintptr_t here = (uintptr_t)__builtin_frame_address(0);

	if (pthread_getattr_np(pthread_self(), &attributes))
		return;
	if (!pthread_attr_getstack(&attributes, &low, &bytes) &&
	    here - (uintptr_t)low < bytes)
		below = here - (uintptr_t)low;
	pthread_attr_destroy(&attributes);
	if (below > TOUCH_BYTES + SPARE_BYTES)
		below = TOUCH_BYTES + SPARE_BYTES;
	if (below > SPARE_BYTES)
		touch(below - SPARE_BYTES);
}

int incise_realtime_enter(const struct incise_realtime *realtime,
			  struct incise_error *err)
{
	int64_t period_ns = realtime->setup.period_ns;
	struct timespec period = {period_ns / 1000000000, period_ns % 1000000000};
	int rc;

	touch_stack();
	rc = take_cpu(&realtime->setup);
	if (rc)
		return incise_error_set(err, rc,
					"real time: CPU %d is not available: "
					"%s",
					realtime->setup.cpu, strerror(rc));
	rc = take_policy(&realtime->setup);
	/* The share of an ended SCHED_DEADLINE thread is free one period later. */
	for (int i = 0; rc == EBUSY && i < 4; i++) {
		nanosleep(&period, NULL);
		rc = take_policy(&realtime->setup);
	}
	if (rc)
		return incise_error_set(
			err, rc,
			"real time: the loop's thread lost a privilege since the test: "
			"%s",
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

/* Returns the text behind the number, or NULL. */
static const char *read_realtime_number(const char *text, uint64_t *value)
{
	char *end;

	while (*text == ' ' || *text == '\t')
		text++;
	if (*text < '0' || *text > '9')
		return NULL;
	errno = 0;
	*value = strtoull(text, &end, 10);
	return errno ? NULL : end;
}

/*
 * TID (NAME) S ppid pgrp session tty tpgid flags minflt cminflt majflt …; the program chooses
 * the name, which may have brackets and blanks.
 */
static int read_faults(const char *text, struct incise_realtime_counts *counts)
{
	const char *at = strrchr(text, ')');
	uint64_t children;

	if (!at)
		return -EIO;
	at++;
	for (int field = 3; field < 10; field++) {
		at += strspn(at, " ");
		at += strcspn(at, " ");
	}
	at = read_realtime_number(at, &counts->minor_faults);
	at = at ? read_realtime_number(at, &children) : NULL;
	at = at ? read_realtime_number(at, &counts->major_faults) : NULL;
	return at ? 0 : -EIO;
}

static int read_realtime_line(const char *text, const char *key, uint64_t *value)
{
	const char *at = strstr(text, key);

	return at && read_realtime_number(at + strlen(key), value) ? 0 : -EIO;
}

int realtime_count_below(const char *folder, int tid,
			 struct incise_realtime_counts *counts)
{
	struct incise_realtime_counts read = {0};
	char path[64], text[8192];
	int rc;

	*counts = read;
	snprintf(path, sizeof(path), "/%d/stat", tid);
	rc = proc_file_read(folder, path, text, sizeof(text));
	if (rc >= 0)
		rc = read_faults(text, &read);
	snprintf(path, sizeof(path), "/%d/status", tid);
	if (!rc)
		rc = proc_file_read(folder, path, text, sizeof(text));
	if (rc >= 0)
		rc = read_realtime_line(text,
					"\nvoluntary_ctxt_switches:", &read.voluntary);
	if (!rc)
		rc = read_realtime_line(
			text, "\nnonvoluntary_ctxt_switches:", &read.involuntary);
	if (rc)
		return rc == -ENOENT || rc == -ESRCH ? -ESRCH : -EIO;
	*counts = read;
	return 0;
}

int incise_realtime_count(int tid, struct incise_realtime_counts *counts)
{
	return realtime_count_below("/proc/self/task", tid, counts);
}
