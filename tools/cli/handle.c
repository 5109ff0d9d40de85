// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The handle of a haptic device; see handle.h.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/base/vector.h"
#include "cli.h"
#include "handle.h"

#define READ 64
#define POLL_NS 1000000LL
#define SILENT_NS 1000000000LL

void handle_open(struct handle *handle, const char *rig)
{
	*handle = (struct handle){.rig = cli_open_rig(rig, INCISE_RIG_HAPTIC)};
	handle->haptic = incise_rig_haptic(handle->rig);
	handle->clock = incise_rig_clock(handle->rig);
	incise_haptic_info(handle->haptic, &handle->info);
	handle->seen_ns = incise_clock_now(handle->clock);
}

void handle_close(struct handle *handle)
{
	free(handle->samples);
	incise_rig_close(handle->rig);
}

static void check_alive(const struct handle *handle, int rc, int64_t now_ns)
{
	char why[200] = "";

	if (cli_stop)
		cli_fail("stopped");
	if (rc >= 0 && now_ns - handle->seen_ns <= SILENT_NS)
		return;
	incise_haptic_cause(handle->haptic, why, sizeof(why));
	cli_fail("the haptic device %s: %s", handle->info.name,
		 *why	  ? why
		 : rc < 0 ? strerror(-rc)
			  : "no sample for 1 s; see whether it is connected and ready");
}

static void poll_handle(struct handle *handle, bool keep)
{
	struct incise_haptic_sample poses[READ];
	int64_t now_ns = incise_clock_now(handle->clock);
	int n = incise_haptic_read(handle->haptic, poses, READ), rc = n;

	for (int i = 0; i < n; i++) {
		handle->pressed |= poses[i].buttons & ~handle->last.buttons;
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
		rc = incise_haptic_push(handle->haptic, handle->force_N, NULL);
	check_alive(handle, rc, now_ns);
	incise_clock_wait_until(handle->clock, now_ns + POLL_NS);
}

void handle_poll(struct handle *handle)
{
	poll_handle(handle, false);
}

void handle_record(struct handle *handle, double time_s)
{
	int64_t end_ns;

	/* Not those from before. */
	poll_handle(handle, false);
	handle->n = 0;
	end_ns = incise_clock_now(handle->clock) + llround(time_s * INCISE_NS_PER_S);
	while (incise_clock_now(handle->clock) < end_ns || handle->n < 2)
		poll_handle(handle, true);
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
