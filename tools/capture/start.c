// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Starts of a recording by a time or by the SYNC line; see start.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include <incise/clock.h>
#include <uapi/incise_stepper.h>
#include "../cli/cli.h"
#include "start.h"

/* --- a time ------------------------------------------------------------------------------ */

/* The fraction behind the seconds, in ns; *text goes behind it. False: no digits. */
static bool parse_fraction(const char **text, int64_t *ns)
{
	int64_t unit = INCISE_NS_PER_S;

	*ns = 0;
	if (**text != '.')
		return true;
	while (*++*text >= '0' && **text <= '9') {
		unit /= 10;
		*ns += (**text - '0') * unit;
	}
	return unit < INCISE_NS_PER_S;
}

void start_time_parse(struct start_time *start, const char *text)
{
	struct tm date = {0}, day;
	const char *end = strptime(text, "%Y-%m-%dT%H:%M:%S", &date);
	int64_t fraction_ns = 0;
	time_t s;

	/* timegm() makes another day of one that there is not, as 2026-02-30. */
	day = date;
	s = end ? timegm(&date) : -1;
	if (end && !parse_fraction(&end, &fraction_ns))
		end = NULL;
	start->tai = end && !strcmp(end, "TAI");
	if (!end || s < 0 || s > INT32_MAX * 2LL || date.tm_mday != day.tm_mday ||
	    (!start->tai && strcmp(end, "Z") != 0))
		cli_usage("--start-at: expected a time such as 2026-11-27T12:00:00Z, or "
			  "one with TAI in place of Z, found '%s'",
			  text);
	start->given = true;
	start->ns = s * INCISE_NS_PER_S + fraction_ns;
}

int64_t start_time_left(const struct start_time *start,
			const struct incise_recorder *recorder, int64_t now_ns)
{
	struct incise_wall_point point;
	int64_t start_ns;

	if (incise_recorder_wall(recorder, &point))
		return INT64_MAX;
	start_ns = start->ns + (start->tai ? 0 : point.utc_offset_s * INCISE_NS_PER_S);
	/* The rate within a second changes less than a poll takes. */
	return start_ns - (point.tai_ns + (now_ns - point.t_ns));
}

/* --- the SYNC line ------------------------------------------------------------------------- */

int start_sync_open(const char *path)
{
	struct incise_stepper_controller controller = {0};
	int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
	struct stat st;

	if (fd < 0)
		cli_fail("--trigger sync: %s: %s; %s", path, strerror(errno),
			 errno == EACCES ? "join the group incise, or run as root"
					 : "incise info stepper lists the controllers");
	if (!fstat(fd, &st) && S_ISFIFO(st.st_mode))
		return fd;
	if (ioctl(fd, INCISE_STEPPER_GET_INFO, &controller))
		cli_fail("--trigger sync: %s: not a controller of the stepper module; "
			 "incise info stepper lists them",
			 path);
	if (!(controller.capabilities & INCISE_STEPPER_CAP_SYNC))
		cli_fail("--trigger sync: %s: has no SYNC line; see its configuration in "
			 "incise help stepper",
			 path);
	return fd;
}

bool start_sync_next(int fd, struct start_pulse *pulse, bool *lost)
{
	struct incise_stepper_event event;
	ssize_t n;

	*lost = false;
	while ((n = read(fd, &event, sizeof(event))) == sizeof(event)) {
		if (event.type != INCISE_STEPPER_EVENT_SYNC)
			continue;
		*pulse = (struct start_pulse){event.t_ns, event.position};
		return true;
	}
	*lost = n < 0 && errno != EAGAIN && errno != EINTR;
	return false;
}
