// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The owner of a haptic device; see incise/haptic_owner.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/haptic_owner.h>
#include "../base/vector.h"
#include "haptic_page.h"
#include "rig_plan.h"

#define SAMPLES INCISE_HAPTIC_PAGE_RING
#define LOOK_NS 50000000 /* between looks whether there is a user */

struct incise_haptic_owner {
	struct haptic_page page;
	struct incise_clock *clock;
	struct incise_haptic *haptic;
	struct incise_haptic_setup setup;
	char where[240];
	struct incise_haptic_page_owner half;
	struct haptic_gate gate;
	uint32_t flags; /* of the last sample */
	int64_t period_ns, next_ns;
	int64_t look_ns, used_ns; /* next look for a user; when there was one last */
	double wait_s;		  /* for a user */
};

/* --- the page ---------------------------------------------------------------------------- */

/* Set the reason to the device's cause, if it has one. */
static void set_cause(struct incise_haptic_owner *owner)
{
	char cause[sizeof(owner->half.reason)] = "";

	incise_haptic_cause(owner->haptic, cause, sizeof(cause));
	snprintf(owner->half.reason, sizeof(owner->half.reason), "%s", cause);
}

static void write_half(struct incise_haptic_owner *owner)
{
	owner->half.heartbeat_ns = incise_clock_now(owner->clock);
	owner->half.lost = incise_haptic_lost(owner->haptic);
	incise_haptic_page_put(&owner->page.map->owner, &owner->half,
			       sizeof(owner->half));
}

static void put_sample(struct incise_haptic_owner *owner,
		       const struct incise_haptic_sample *from)
{
	struct incise_haptic_page_sample sample = {.number = owner->half.samples};

	memcpy(&sample.t_ns, from, sizeof(*from));
	if (!v3_finite(from->velocity_mm_s))
		memset(sample.velocity_mm_s, 0, sizeof(sample.velocity_mm_s));
	incise_haptic_page_put(&owner->page.map->ring[sample.number % SAMPLES], &sample,
			       sizeof(sample));
	owner->half.samples++;
	if (from->flags != owner->flags)
		set_cause(owner);
	owner->flags = from->flags;
}

static void put_device(struct incise_haptic_owner *owner, const char *device,
		       const char *note)
{
	struct incise_haptic_info *to = &owner->page.map->device;
	size_t length;

	incise_haptic_info(owner->haptic, to);
	/* A force that answers a sample is given at the next tick. */
	to->force_latency_ns += owner->period_ns;
	to->settings = incise_haptic_page_settings(&owner->setup);
	snprintf(to->device, sizeof(to->device), "%s", device);
	length = strlen(to->note);
	snprintf(to->note + length, sizeof(to->note) - length, "%s%s",
		 length && *note ? "; " : "", note);
}

/* --- a tick ------------------------------------------------------------------------------ */

static int wait_for_device(struct incise_haptic_owner *owner)
{
	int64_t now_ns;

	if (owner->haptic->ops->wait)
		return owner->haptic->ops->wait(owner->haptic, owner->period_ns);
	/* Late ticks are not caught up. */
	now_ns = incise_clock_now(owner->clock);
	owner->next_ns += owner->period_ns;
	if (owner->next_ns < now_ns)
		owner->next_ns = now_ns;
	return incise_clock_wait_until(owner->clock, owner->next_ns);
}

/* By the lock: a stopped or starting user has no heartbeat. NULL: there is a user, or was one just now. */
static const char *find_end(struct incise_haptic_owner *owner, int64_t now_ns)
{
	if (now_ns >= owner->look_ns) {
		owner->look_ns = now_ns + LOOK_NS;
		if (incise_haptic_page_held(&owner->page, INCISE_HAPTIC_PAGE_USER_BYTE)) {
			owner->wait_s = owner->setup.lost_s;
			owner->used_ns = now_ns;
		}
	}
	return (double)(now_ns - owner->used_ns) > owner->wait_s * INCISE_NS_PER_S
		       ? "it had no user any more"
		       : NULL;
}

/* @before: the share at the last tick. A user that asks for no force loses none. */
static void count_cut(struct incise_haptic_owner *owner, double before, const char *off)
{
	const struct incise_haptic_page_user *last = &owner->gate.last;

	if (!*off || !(before > 0) || owner->gate.share > 0 ||
	    last->wants != INCISE_HAPTIC_PAGE_FORCE ||
	    !(v3_length(last->force_N) > 0 || v3_length(last->torque_N_mm) > 0))
		return;
	owner->half.cuts++;
	snprintf(owner->half.cut, sizeof(owner->half.cut), "%s", off);
}

static int give_force(struct incise_haptic_owner *owner,
		      struct incise_haptic_owner_tick *tick)
{
	struct incise_haptic_page_user half;
	bool whole = haptic_page_read(&owner->page.map->user, &half, sizeof(half));
	double before = owner->gate.share;
	const char *off;

	tick->t_ns = incise_clock_now(owner->clock);
	off = incise_haptic_gate(&owner->gate, whole ? &half : NULL, tick->t_ns,
				 tick->force_N, tick->torque_N_mm);
	tick->off = off ? off : "";
	count_cut(owner, before, tick->off);
	tick->period_ns = owner->gate.last.period_ns;
	tick->age_ns = tick->period_ns ? tick->t_ns - owner->gate.last.heartbeat_ns : -1;
	if (owner->gate.last.wants == INCISE_HAPTIC_PAGE_END)
		tick->end = "its user asked for that";
	return incise_haptic_push(owner->haptic, tick->force_N, tick->torque_N_mm);
}

static int fail(struct incise_haptic_owner *owner, int rc, struct incise_error *err)
{
	set_cause(owner);
	if (!*owner->half.reason)
		snprintf(owner->half.reason, sizeof(owner->half.reason), "%s: %s",
			 owner->where, strerror(-rc));
	owner->half.state = INCISE_HAPTIC_PAGE_FAILED;
	owner->half.error = (uint32_t)-rc;
	write_half(owner);
	return incise_error_set(err, -rc, "%s", owner->half.reason);
}

int incise_haptic_owner_tick(struct incise_haptic_owner *owner,
			     struct incise_haptic_owner_tick *tick,
			     struct incise_error *err)
{
	struct incise_haptic_sample samples[SAMPLES];
	int rc = wait_for_device(owner), n;

	if (rc == -EINTR)
		return rc;
	n = rc ? rc : incise_haptic_read(owner->haptic, samples, SAMPLES);
	for (int i = 0; i < n; i++)
		put_sample(owner, &samples[i]);
	*tick = (struct incise_haptic_owner_tick){0};
	rc = n < 0 ? n : give_force(owner, tick);
	if (rc)
		return fail(owner, rc, err);
	write_half(owner);
	if (!tick->end)
		tick->end = find_end(owner, tick->t_ns);
	return 0;
}

/* --- the owner --------------------------------------------------------------------------- */

static int open_owned_device(struct incise_haptic_owner *owner, const char *device,
			     const char *note, struct incise_error *err)
{
	int rc = incise_haptic_page_new(&owner->page, device, owner->where, err);

	if (rc)
		return rc;
	owner->haptic = incise_haptic_open(device, owner->where, &owner->setup,
					   owner->clock, err);
	if (!owner->haptic)
		return -errno;
	if (!(owner->haptic->info.rate_hz >= 1))
		return incise_error_set(err, EINVAL,
					"%s: the device has no rate; set rate_hz of "
					"haptic_setup",
					owner->where);
	owner->period_ns = llround(INCISE_NS_PER_S / owner->haptic->info.rate_hz);
	owner->gate.gap_ns = 2 * owner->period_ns;
	owner->gate.peak_N = owner->haptic->info.peak_N;
	owner->gate.torque_N_mm = owner->haptic->info.torque_N_mm;
	owner->next_ns = owner->used_ns = incise_clock_now(owner->clock);
	put_device(owner, device, note);
	owner->half.state = INCISE_HAPTIC_PAGE_READY;
	write_half(owner);
	incise_haptic_page_publish(owner->page.map, (uint32_t)getpid());
	return 0;
}

static int check_plan(const struct incise_rig_plan *plan, const char *rig,
		      struct incise_error *err)
{
	if (!plan->haptic_device)
		return incise_error_set(err, ENODEV,
					"%s: this rig has no haptic device; give the "
					"device, such as haply:",
					rig);
	if (!strncmp(plan->haptic_device, HAPTIC_PAGE_LOCAL, strlen(HAPTIC_PAGE_LOCAL)))
		return incise_error_set(
			err, EINVAL,
			"%s: a local: device is served by its own process; "
			"start that one",
			plan->haptic_where);
	return plan->simulated
		       ? incise_error_set(err, EINVAL,
					  "%s: an owner runs in real time; write clock = "
					  "\"real\"",
					  plan->haptic_where)
		       : 0;
}

struct incise_haptic_owner *incise_haptic_owner_open(const char *rig, const char *note,
						     double first_s,
						     struct incise_error *err)
{
	struct incise_haptic_owner *owner = calloc(1, sizeof(*owner));
	struct incise_rig_plan plan;
	int rc;

	if (!owner)
		return NULL;
	owner->page.fd = -1;
	owner->clock = incise_clock_new_real();
	rc = incise_rig_plan_read(&plan, rig, INCISE_RIG_HAPTIC, err);
	if (!rc)
		rc = check_plan(&plan, rig, err);
	if (!rc && !owner->clock)
		rc = incise_error_set(err, ENOMEM, "%s: %s", rig, strerror(ENOMEM));
	if (!rc) {
		owner->setup = plan.haptic;
		owner->wait_s = fmax(first_s, plan.haptic.lost_s);
		snprintf(owner->where, sizeof(owner->where), "%s", plan.haptic_where);
		rc = open_owned_device(owner, plan.haptic_device, note, err);
	}
	incise_rig_plan_free(&plan);
	if (!rc)
		return owner;
	incise_haptic_close(owner->haptic);
	incise_haptic_page_close(&owner->page, true);
	incise_clock_free(owner->clock);
	free(owner);
	errno = -rc;
	return NULL;
}

void incise_haptic_owner_close(struct incise_haptic_owner *owner, const char *reason)
{
	static const double none[3];

	if (!owner)
		return;
	incise_haptic_push(owner->haptic, none, none);
	if (owner->half.state == INCISE_HAPTIC_PAGE_READY) {
		owner->half.state = INCISE_HAPTIC_PAGE_ENDED;
		snprintf(owner->half.reason, sizeof(owner->half.reason), "%s: %s",
			 owner->where, reason);
		write_half(owner);
	}
	incise_haptic_close(owner->haptic);
	incise_haptic_page_close(&owner->page, true);
	incise_clock_free(owner->clock);
	free(owner);
}
