// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Loaded into incise capture by LD_PRELOAD: a disk that now and then does not answer. Who asks
 * it to write through meanwhile, of any thread, waits until the end of that time, which is counted
 * from the first who asks.
 *
 *     first sync           first_ms      + stall_ms           + every_ms
 *     of the recording ────────┬─────────────┬────────────────────┬──────
 *                              └ no answer ──┘                    └ no answer …
 *
 * STALL_FIRST_MS, STALL_EVERY_MS (0: just once), STALL_MS.
 */
#include <dlfcn.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#define EXPORT __attribute__((visibility("default")))
#define REAL(name, ...) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))(__VA_ARGS__)

static int64_t now_ms(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return now.tv_sec * 1000LL + now.tv_nsec / 1000000;
}

static int64_t number(const char *name)
{
	const char *text = getenv(name);

	return text ? atoll(text) : 0;
}

static void answer(void)
{
	static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
	static int64_t due_ms = -1, until_ms;
	int64_t rest_ms, every_ms = number("STALL_EVERY_MS");
	struct timespec rest;

	pthread_mutex_lock(&mutex);
	if (due_ms < 0)
		due_ms = now_ms() + number("STALL_FIRST_MS");
	if (now_ms() >= due_ms) {
		until_ms = now_ms() + number("STALL_MS");
		due_ms = every_ms > 0 ? now_ms() + every_ms : INT64_MAX;
	}
	rest_ms = until_ms - now_ms();
	pthread_mutex_unlock(&mutex);
	if (rest_ms <= 0)
		return;
	rest.tv_sec = rest_ms / 1000;
	rest.tv_nsec = rest_ms % 1000 * 1000000L;
	nanosleep(&rest, NULL);
}

EXPORT int fsync(int fd)
{
	answer();
	return REAL(fsync, fd);
}

EXPORT int fdatasync(int fd)
{
	answer();
	return REAL(fdatasync, fd);
}
