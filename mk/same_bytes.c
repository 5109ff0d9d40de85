/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Loaded into a program by mk/example-data: what makes each recording another one (identity, wall time, machine)
 * is the same each time here, so that equal seeds give equal files.
 */
#include <string.h>
#include <sys/random.h>
#include <sys/syscall.h>
#include <sys/utsname.h>
#include <time.h>
#include <unistd.h>

/* A day of UTC. */
#define DAY_S 1795219200

ssize_t getrandom(void *buffer, size_t length, unsigned int flags)
{
	(void)flags;
	memset(buffer, 0x5a, length);
	return (ssize_t)length;
}

int uname(struct utsname *name)
{
	memset(name, 0, sizeof(*name));
	strcpy(name->sysname, "Linux");
	strcpy(name->nodename, "example");
	strcpy(name->release, "any");
	strcpy(name->machine, "any");
	return 0;
}

int clock_gettime(clockid_t clock, struct timespec *now)
{
	if (clock != CLOCK_REALTIME)
		return (int)syscall(SYS_clock_gettime, clock, now);
	*now = (struct timespec){.tv_sec = DAY_S};
	return 0;
}
