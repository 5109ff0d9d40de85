// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Loaded into incise capture by LD_PRELOAD: a disk that now and then does not answer. Who asks
 * it to write through meanwhile, of any thread, waits until the end of that time.
 *
 *     first sync           first_ms      + stall_ms           + every_ms
 *     of the recording ────────┬─────────────┬────────────────────┬──────
 *                              └ no answer ──┘                    └ no answer …
 *
 * STALL_FIRST_MS, STALL_EVERY_MS (0: just once), STALL_MS.
 */
#include <dlfcn.h>
#include <stdatomic.h>
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
	static _Atomic int64_t started_ms;
	int64_t none = 0, first_ms = number("STALL_FIRST_MS");
	int64_t every_ms = number("STALL_EVERY_MS"), stall_ms = number("STALL_MS"), at_ms;
	struct timespec rest;

	atomic_compare_exchange_strong(&started_ms, &none, now_ms());
	at_ms = now_ms() - started_ms - first_ms;
	if (every_ms > 0 && at_ms > 0)
		at_ms %= every_ms;
	if (at_ms < 0 || at_ms >= stall_ms)
		return;
	rest.tv_sec = (stall_ms - at_ms) / 1000;
	rest.tv_nsec = (stall_ms - at_ms) % 1000 * 1000000L;
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
