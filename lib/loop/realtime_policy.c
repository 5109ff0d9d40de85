// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What of real time is asked of the kernel for a thread, and whether it would give it, tried
 * where nothing can come of it; see realtime.h.
 *
 *   SCHED_DEADLINE   |▐█████|······|▐█████|······|      █ may run, · is kept from it
 *                    |<- period = deadline ->|
 */
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
#include "proc_file.h"
#include "realtime.h"

/* Newer C libraries have a name for both, and a structure. */
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

/* Of the period: far above what ticks cost, and short of all of a CPU when one hangs. */
#define DEADLINE_SHARE 2

/* What threads, rings and modules of devices map beside what is there: 32 MiB. */
#define ROOM_BYTES (32ULL << 20)
/* More than a haptic loop ever has: under some sanitizers a process is terabytes long. */
#define LOCK_BYTES_MAX (64ULL << 30)

/* Enough for a thread that makes three calls. */
#define STACK_BYTES (64 << 10)

int realtime_check_setup(const struct incise_realtime_setup *setup,
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
			"real time: SCHED_DEADLINE runs on all CPUs and takes none for "
			"itself: leave out the CPU %d, or use SCHED_FIFO",
			setup->cpu);
	if (deadline && setup->period_ns < DEADLINE_MIN_NS)
		return incise_error_set(
			err, EINVAL,
			"real time: SCHED_DEADLINE has no periods below 0.1 ms: run the "
			"loop at 10000 Hz or less, or use SCHED_FIFO");
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

int realtime_take_policy(const struct incise_realtime_setup *setup)
{
	struct sched_param priority = {.sched_priority = setup->priority};

	if (setup->policy == INCISE_REALTIME_DEADLINE)
		return take_deadline(setup);
	return pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority);
}

int realtime_take_cpu(const struct incise_realtime_setup *setup)
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

	trial->answers->cpu_error = realtime_take_cpu(trial->setup);
	trial->answers->policy_error = realtime_take_policy(trial->setup);
	return NULL;
}

/* On a thread of its own, so that the caller stays what it is. */
static int try_policy(struct trial *trial)
{
	pthread_attr_t attributes;
	sigset_t all, before;
	pthread_t thread;
	int rc;

	rc = pthread_attr_init(&attributes);
	if (rc)
		return -rc;
	pthread_attr_setstacksize(&attributes, STACK_BYTES);
	sigfillset(&all);
	pthread_sigmask(SIG_SETMASK, &all, &before);
	rc = pthread_create(&thread, &attributes, try_thread, trial);
	pthread_sigmask(SIG_SETMASK, &before, NULL);
	pthread_attr_destroy(&attributes);
	if (!rc)
		pthread_join(thread, NULL);
	return -rc;
}

/* What is mapped and not locked yet, and room beside it. */
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
	return (size_kB - locked_kB) * 1024 + ROOM_BYTES;
}

/*
 * The kernel counts addresses, not pages: an empty range has the answer, and with
 * MLOCK_ONFAULT it takes no memory. It can be read, since older kernels want that; what
 * that could bring is the one page of zeros.
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

/* What the hard limit lets a program take by itself, it need not be given. */
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
	/* To open it asks for nothing yet. */
	fd = open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC);
	answers->idle_error = fd < 0 ? errno : 0;
	if (fd >= 0)
		close(fd);
	return try_policy(&trial);
}
