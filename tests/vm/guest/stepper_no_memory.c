// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * One allocation after the other fails while a controller is bound, opened and given power: each
 * time there is an error or a controller that works, and nothing is left in the way of the next attempt.
 *
 *   stepper_no_memory
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../bench.h"
#include "../tap.h"

#define LIVE "/sys/kernel/config/incise-stepper/bench0/live"
#define MOST 5000

static struct bench bench;
static int nth; /* /proc/self/fail-nth: which allocation of this thread fails */

static int write_live(const char *word)
{
	int fd = open(LIVE, O_WRONLY | O_CLOEXEC);
	int ret = fd < 0 || write(fd, word, 1) != 1 ? -errno : 0;

	if (fd >= 0)
		close(fd);
	return ret;
}

static int use_controller(void)
{
	int ret = write_live("1");

	ret = ret ? ret : bench_name(&bench);
	ret = ret ? ret : bench_open(&bench);
	ret = ret ? ret : bench_command(&bench, INCISE_STEPPER_ENABLE, 1);
	return ret ? ret : bench_command(&bench, INCISE_STEPPER_DISABLE, 1);
}

/* Use a controller while its allocation @n fails. Returns whether it asked for so many. */
static bool fail_allocation(unsigned int n, int *error)
{
	char text[16] = "";
	int size = snprintf(text, sizeof(text), "%u", n);
	bool armed = pwrite(nth, text, size, 0) == size;

	*error = use_controller();
	memset(text, 0, sizeof(text));
	armed = pread(nth, text, sizeof(text) - 1, 0) > 0 && armed;
	if (pwrite(nth, "0", 1, 0) != 1 || !armed)
		*error = -EPROTO;
	bench_close(&bench);
	write_live("0");
	return !atoi(text);
}

int main(void)
{
	unsigned int n = 0, refused = 0, other = 0;
	int error = 0;

	nth = open("/proc/self/fail-nth", O_RDWR | O_CLOEXEC);
	if (!check(nth >= 0 && !bench_bind(&bench, 1) && !write_live("0"),
		   "a controller"))
		return 1;
	while (++n < MOST && fail_allocation(n, &error)) {
		refused += error != 0;
		other += error == -EPROTO;
	}
	note("%u allocations failed, %u of them with an error", n - 1, refused);
	check(n > 1 && n < MOST && refused && !other, "each allocation failed once");
	check(!error, "after them all of it is done (%s)", strerror(-error));
	check(!bench_unbind(&bench), "it is unbound");
	return tap_failures != 0;
}
