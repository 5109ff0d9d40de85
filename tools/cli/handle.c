// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The handle of a haptic device; see handle.h.
 */
#include <errno.h>
#include <math.h>
#include <poll.h>
#include <string.h>
#include <unistd.h>
#include "../../lib/base/vector.h"
#include "cli.h"
#include "handle.h"

#define READ 64
#define POLL_NS 1000000LL
#define SILENT_NS 1000000000LL
/* With a force: so long, and so many periods, beyond the latency of the device. */
#define LATE_NS 10000000LL
#define LATE_PERIODS 5

void handle_begin(struct handle *handle, struct incise_rig *rig)
{
	*handle = (struct handle){.haptic = incise_rig_haptic(rig),
				  .clock = incise_rig_clock(rig)};
	incise_haptic_info(handle->haptic, &handle->info);
	handle->seen_ns = incise_clock_now(handle->clock);
}

/* A force needs samples that arrive, and are not old. */
static bool are_samples_late(const struct handle *handle, int64_t now_ns)
{
	const struct incise_haptic_info *info = &handle->info;
	double late_ns = LATE_NS + (double)info->latency_ns;

	if (!(v3_length(handle->force_N) > 0))
		return now_ns - handle->seen_ns > SILENT_NS;
	if (info->rate_hz > 0)
		late_ns += LATE_PERIODS * (double)INCISE_NS_PER_S / info->rate_hz;
	return (double)(now_ns - handle->seen_ns) > late_ns ||
	       (double)(now_ns - handle->last.t_ns) > late_ns;
}

void handle_release(struct handle *handle)
{
	memset(handle->force_N, 0, sizeof(handle->force_N));
	incise_haptic_push(handle->haptic, handle->force_N, NULL);
}

int handle_poll(struct handle *handle, bool keep, struct incise_error *err)
{
	struct incise_haptic_sample poses[READ];
	int64_t now_ns = incise_clock_now(handle->clock);
	int n = incise_haptic_read(handle->haptic, poses, READ), rc = n;
	char why[200] = "";

	for (int i = 0; i < n; i++) {
		handle->pressed |= poses[i].buttons & ~handle->last.buttons;
		handle->flags |= poses[i].flags;
		handle->last = poses[i];
		handle->seen_ns = now_ns;
		if (!keep)
			continue;
		handle->samples = cli_grow(handle->samples, (size_t)handle->n,
					   sizeof(*handle->samples));
		handle->samples[handle->n++] =
			(struct handle_sample){poses[i], now_ns - poses[i].t_ns};
	}
	if (n >= 0)
		rc = are_samples_late(handle, now_ns)
			     ? -ETIMEDOUT
			     : incise_haptic_push(handle->haptic, handle->force_N, NULL);
	if (rc < 0 || cli_stop)
		handle_release(handle);
	if (cli_stop)
		return incise_error_set(err, EINTR, "stopped");
	incise_clock_wait_until(handle->clock, now_ns + POLL_NS);
	if (rc >= 0)
		return 0;
	incise_haptic_cause(handle->haptic, why, sizeof(why));
	return incise_error_set(
		err, -rc, "%s: %s", handle->info.name,
		*why ? why
		: rc == -ETIMEDOUT
			? "its samples stopped, or are late; incise doctor measures them"
			: strerror(-rc));
}

int handle_check(const struct handle *handle, struct incise_error *err)
{
	char cause[300] = "";

	if (!(handle->flags & ~INCISE_HAPTIC_BATTERY) &&
	    v3_finite(handle->last.position_mm))
		return 0;
	incise_haptic_cause(handle->haptic, cause, sizeof(cause));
	return incise_error_set(
		err, EIO, "%s%s", *cause ? cause : handle->info.name,
		*cause ? ""
		       : ": it reports a fault, or is not ready; look at the device");
}

int handle_await_press(struct handle *handle, struct incise_error *err)
{
	struct pollfd input = {STDIN_FILENO, POLLIN, 0};
	char line[100];
	int rc = 0;

	setvbuf(stdin, NULL, _IONBF, 0);
	for (handle->pressed = false; !rc && !handle->pressed;) {
		rc = handle_poll(handle, false, err);
		if (handle->pressed || poll(&input, 1, 0) <= 0)
			continue;
		handle->pressed = fgets(line, sizeof(line), stdin);
		input.fd = -1; /* not read again at its end */
		if (!handle->pressed && !handle->info.buttons)
			rc = incise_error_set(err, ENODATA,
					      "the input ended, and %s has no button",
					      handle->info.name);
	}
	return rc;
}

int handle_record(struct handle *handle, double time_s, struct incise_error *err)
{
	/* Samples from before are left out. */
	int rc = handle_poll(handle, false, err);
	int64_t end_ns =
		incise_clock_now(handle->clock) + llround(time_s * INCISE_NS_PER_S);

	handle->n = 0;
	handle->flags = handle->last.flags;
	while (!rc && (incise_clock_now(handle->clock) < end_ns || handle->n < 2))
		rc = handle_poll(handle, true, err);
	return rc;
}

double handle_mean(const struct handle *handle, double mean_mm[3])
{
	double sum2 = 0, away[3];

	memset(mean_mm, 0, 3 * sizeof(*mean_mm));
	for (int i = 0; i < handle->n; i++)
		v3_add(mean_mm, mean_mm, 1.0 / handle->n,
		       handle->samples[i].pose.position_mm);
	for (int i = 0; i < handle->n; i++) {
		v3_sub(away, handle->samples[i].pose.position_mm, mean_mm);
		sum2 += v3_dot(away, away);
	}
	return sqrt(sum2 / 3 / (handle->n - 1));
}
