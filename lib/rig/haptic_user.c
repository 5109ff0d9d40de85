// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The user's end of a haptic device that another process owns; see haptic_page.h. The page is written by
 * others: each value is checked where it is read, and a page that makes no sense ends the stream.
 */
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "../base/control_character.h"
#include "../base/vector.h"
#include "haptic_page.h"

#define PERIOD_SHARE 16 /* of a tick in the mean period */
#define PERIOD_LEAST_NS 20000
#define RATE_MOST_HZ 20000
#define FINITE -DBL_MAX, DBL_MAX, "a finite number"
#define FROM_0 0, DBL_MAX, "a finite number from 0"
#define END_NS 10000000 /* between looks whether an owner has ended */
#define END_LOOKS 1000
#define REFUSED                                                                      \
	"a sample was refused: not finite, of a later time, or with unknown flags; " \
	"correct the owner"

struct haptic_user {
	struct incise_haptic base;
	struct haptic_page page;
	struct incise_clock *clock;
	struct incise_haptic_info device;
	struct incise_haptic_page_owner owner; /* the last whole one */
	struct incise_haptic_page_user own;    /* as written last */
	uint64_t taken, lost;
	uint32_t cuts_before; /* of other users */
	bool reads;	      /* has read */
	uint32_t flags;	      /* of the last sample */
	int rc;		      /* negative errno that ended the stream */
	const char *cause;    /* in place of the owner's reason */
	double period_ns;
};

static struct haptic_user *of_user(struct incise_haptic *haptic)
{
	return (struct haptic_user *)haptic;
}

/* --- the owner's half -------------------------------------------------------------------- */

static INCISE_REALTIME int end_stream(struct haptic_user *user, int rc, const char *cause)
{
	user->rc = rc;
	user->cause = cause;
	return rc;
}

/* NULL: it makes sense after the one before. */
static INCISE_REALTIME const char *judge_owner(
	const struct incise_haptic_page_owner *before,
	const struct incise_haptic_page_owner *owner, int64_t now_ns)
{
	if (owner->state < INCISE_HAPTIC_PAGE_READY ||
	    owner->state > INCISE_HAPTIC_PAGE_ENDED)
		return "its owner's page has an unknown state; build the owner again";
	if (owner->heartbeat_ns < before->heartbeat_ns || owner->heartbeat_ns > now_ns)
		return "its owner's heartbeat is of another time; use CLOCK_MONOTONIC of this "
		       "machine";
	if ((int32_t)(owner->seq - before->seq) < 0 || owner->samples < before->samples ||
	    owner->lost < before->lost || owner->cuts < before->cuts)
		return "its owner's counts went back; start the owner again";
	return NULL;
}

static INCISE_REALTIME int look_at_owner(struct haptic_user *user)
{
	struct incise_haptic_page_owner owner;
	bool whole = haptic_page_read(&user->page.map->owner, &owner, sizeof(owner));
	int64_t now_ns = incise_clock_now(user->clock);
	const char *wrong = whole ? judge_owner(&user->owner, &owner, now_ns) : NULL;

	if (user->rc)
		return user->rc;
	if (wrong)
		return end_stream(user, -EPROTO, wrong);
	if (whole)
		user->owner = owner;
	if (user->owner.state == INCISE_HAPTIC_PAGE_ENDED)
		return end_stream(user, -ESHUTDOWN, NULL);
	if (user->owner.state == INCISE_HAPTIC_PAGE_FAILED)
		return end_stream(user,
				  user->owner.error == ENODEV	? -ENODEV
				  : user->owner.error == EPROTO ? -EPROTO
								: -EIO,
				  NULL);
	if (now_ns - user->owner.heartbeat_ns > INCISE_HAPTIC_PAGE_DEAD_NS)
		return end_stream(user, -ESHUTDOWN,
				  "its owner has no heartbeat any more: it was killed or "
				  "stopped; start it again");
	return 0;
}

/* --- samples ----------------------------------------------------------------------------- */

static INCISE_REALTIME bool is_sample_good(const struct incise_haptic_page_sample *sample,
					   int64_t now_ns)
{
	return !(sample->flags >> INCISE_HAPTIC_FLAGS) && sample->t_ns >= 0 &&
	       sample->t_ns <= now_ns && v3_finite(sample->position_mm) &&
	       v3_finite(sample->velocity_mm_s) && v3_finite(sample->quaternion) &&
	       isfinite(sample->quaternion[3]);
}

/* Take the next one; false: it is torn, overwritten or refused. */
static INCISE_REALTIME bool take_slot(struct haptic_user *user,
				      struct incise_haptic_sample *to)
{
	const struct incise_haptic_page_sample *slot =
		&user->page.map->ring[user->taken % INCISE_HAPTIC_PAGE_RING];
	bool velocity = user->device.features & INCISE_HAPTIC_PAGE_VELOCITY;
	struct incise_haptic_page_sample from;

	if (!haptic_page_read(slot, &from, sizeof(from)) || from.number != user->taken)
		return false;
	user->cause =
		is_sample_good(&from, incise_clock_now(user->clock)) ? NULL : REFUSED;
	if (user->cause)
		return false;
	memcpy(to, &from.t_ns, sizeof(*to));
	for (int i = 0; i < 3 && !velocity; i++)
		to->velocity_mm_s[i] = (double)NAN;
	user->flags = from.flags;
	return true;
}

static INCISE_REALTIME int read_user(struct incise_haptic *haptic,
				     struct incise_haptic_sample *samples, int n)
{
	struct haptic_user *user = of_user(haptic);
	uint64_t kept = INCISE_HAPTIC_PAGE_RING;
	int rc = look_at_owner(user), got = 0;

	if (rc)
		return rc;
	/* The owner may write to the slot behind the last one. Before the first read there is no loss. */
	if (user->owner.samples - user->taken >= kept) {
		if (user->reads)
			user->lost += user->owner.samples - user->taken - kept + 1;
		user->taken = user->owner.samples - kept + 1;
	}
	user->reads = true;
	for (; user->taken < user->owner.samples && got < n; user->taken++) {
		if (take_slot(user, &samples[got]))
			got++;
		else
			user->lost++;
	}
	return got;
}

/* --- force ------------------------------------------------------------------------------- */

/* A long gap says nothing of the period of the ticks. */
static INCISE_REALTIME void measure_period(struct haptic_user *user, int64_t now_ns)
{
	double gap_ns = (double)(now_ns - user->own.heartbeat_ns);

	if (user->own.heartbeat_ns)
		user->period_ns += (fmin(gap_ns, 4 * user->period_ns) - user->period_ns) /
				   PERIOD_SHARE;
	user->period_ns = fmin(fmax(user->period_ns, PERIOD_LEAST_NS),
			       INCISE_HAPTIC_PAGE_PERIOD_NS);
}

static INCISE_REALTIME void write_half(struct haptic_user *user, uint32_t wants,
				       const double force_N[3],
				       const double torque_N_mm[3])
{
	int64_t now_ns = incise_clock_now(user->clock);

	measure_period(user, now_ns);
	user->own = (struct incise_haptic_page_user){
		.wants = wants,
		.heartbeat_ns = now_ns,
		.period_ns = (int64_t)user->period_ns,
	};
	v3_copy(user->own.force_N, force_N);
	v3_copy(user->own.torque_N_mm, torque_N_mm);
	incise_haptic_page_put(&user->page.map->user, &user->own, sizeof(user->own));
}

static INCISE_REALTIME int push_user(struct incise_haptic *haptic,
				     const double force_N[3], const double torque_N_mm[3])
{
	struct haptic_user *user = of_user(haptic);

	if (user->rc)
		return user->rc;
	write_half(user, INCISE_HAPTIC_PAGE_FORCE, force_N, torque_N_mm);
	return 0;
}

static void ask_owner(struct haptic_user *user, uint32_t wants)
{
	static const double none[3];

	write_half(user, wants, none, none);
}

/* --- the device -------------------------------------------------------------------------- */

static void describe_page(const struct incise_haptic *haptic,
			  struct incise_haptic_info *info)
{
	*info = ((const struct haptic_user *)haptic)->device;
}

static uint64_t count_lost(const struct incise_haptic *haptic)
{
	const struct haptic_user *user = (const struct haptic_user *)haptic;

	return user->lost + user->owner.lost;
}

static unsigned int count_cuts(const struct incise_haptic *haptic,
			       char why[INCISE_HAPTIC_CUT_MAX])
{
	const struct haptic_user *user = (const struct haptic_user *)haptic;
	unsigned int cuts = user->owner.cuts - user->cuts_before;

	snprintf(why, INCISE_HAPTIC_CUT_MAX, "%.*s", cuts ? INCISE_HAPTIC_CUT_MAX - 1 : 0,
		 user->owner.cut);
	control_characters_hide(why);
	return cuts;
}

static int tell_cause(struct incise_haptic *haptic, char *text, size_t size)
{
	struct haptic_user *user = of_user(haptic);
	char reason[sizeof(user->owner.reason) + 1];

	snprintf(reason, sizeof(reason), "%.*s", (int)sizeof(user->owner.reason),
		 user->owner.reason);
	control_characters_hide(reason);
	if (user->cause)
		return snprintf(text, size, "%s: %s", user->device.name, user->cause);
	return snprintf(text, size, "%s", user->rc || user->flags ? reason : "");
}

static void close_user(struct incise_haptic *haptic)
{
	struct haptic_user *user = of_user(haptic);

	ask_owner(user, INCISE_HAPTIC_PAGE_NOTHING);
	incise_haptic_page_close(&user->page, false);
	free(user);
}

static const struct incise_haptic_ops ops = {
	.read = read_user,
	.push = push_user,
	.info = describe_page,
	.lost = count_lost,
	.close = close_user,
	.cause = tell_cause,
	.cuts = count_cuts,
};

/* --- attaching --------------------------------------------------------------------------- */

static bool take_text(char *text, size_t size)
{
	bool ends = memchr(text, 0, size);

	if (ends)
		control_characters_hide(text);
	return ends;
}

/* Check the device part, a copy, which the owner cannot change. 0; -EPROTO, and *err says which property. */
static int check_device(struct incise_haptic_info *d, const char *where, const char *path,
			struct incise_error *err)
{
	const struct {
		const char *name;
		double value, least, most;
		const char *range;
	} rows[] = {
		{"low_mm[0]", d->low_mm[0], FINITE},
		{"low_mm[1]", d->low_mm[1], FINITE},
		{"low_mm[2]", d->low_mm[2], FINITE},
		{"high_mm[0]", d->high_mm[0], FINITE},
		{"high_mm[1]", d->high_mm[1], FINITE},
		{"high_mm[2]", d->high_mm[2], FINITE},
		{"peak_N", d->peak_N, FROM_0},
		{"continuous_N", d->continuous_N, FROM_0},
		{"torque_N_mm", d->torque_N_mm, FROM_0},
		{"mass_kg", d->mass_kg, FROM_0},
		{"damping_N_s_mm", d->damping_N_s_mm, FROM_0},
		{"coulomb_N", d->coulomb_N, FROM_0},
		{"encoder_mm", d->encoder_mm, FROM_0},
		{"rate_hz", d->rate_hz, 1, RATE_MOST_HZ, "1 to 20000"},
		{"latency_ns", (double)d->latency_ns, 0, INCISE_NS_PER_S, "0 to 1e9"},
		{"force_latency_ns", (double)d->force_latency_ns, 0, INCISE_NS_PER_S,
		 "0 to 1e9"},
		{"deadman_s", d->deadman_s, FROM_0},
		{"buttons", d->buttons, 0, 32, "0 to 32"},
		{"features", d->features, 0, 2 * INCISE_HAPTIC_PAGE_GRAVITY - 1,
		 "a sum of 1, 2 and 4"},
	};
	bool ends = take_text(d->device, sizeof(d->device)) &&
		    take_text(d->name, sizeof(d->name)) &&
		    take_text(d->filters, sizeof(d->filters)) &&
		    take_text(d->note, sizeof(d->note));

	if (!ends)
		return incise_error_set(err, EPROTO,
					"%s: %s: device, name, filters or note of the "
					"device do not end with a 0; correct its owner",
					where, path);
	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++)
		if (!(rows[i].value >= rows[i].least && rows[i].value <= rows[i].most))
			return incise_error_set(
				err, EPROTO,
				"%s: %s: %s of the device: found %.9g, expected %s; "
				"correct its owner",
				where, path, rows[i].name, rows[i].value, rows[i].range);
	return 0;
}

static int read_device(struct haptic_user *user, const char *device, const char *where,
		       struct incise_error *err)
{
	int rc;

	memcpy(&user->device, &user->page.map->device, sizeof(user->device));
	rc = check_device(&user->device, where, user->page.path, err);
	if (rc)
		return rc;
	if (strcmp(user->device.device, device))
		return incise_error_set(err, EPROTO,
					"%s: %s: has the device \"%.80s\", not "
					"\"%.80s\"; end its owner",
					where, user->page.path, user->device.device,
					device);
	user->period_ns = (double)INCISE_NS_PER_S / user->device.rate_hz;
	if (look_at_owner(user)) {
		char cause[400];

		tell_cause(&user->base, cause, sizeof(cause));
		return incise_error_set(err, -user->rc, "%s: %s", where, cause);
	}
	user->taken = user->owner.samples;
	user->cuts_before = user->owner.cuts;
	return 0;
}

/* An owner of other settings ends at the request of its user; one that ends already is waited for. */
static int end_owner(struct haptic_user *user, const char *where,
		     struct incise_error *err)
{
	const struct timespec pause = {.tv_nsec = END_NS};
	unsigned int pid = user->page.map->head.pid;
	int i = 0;

	for (; i < END_LOOKS &&
	       incise_haptic_page_held(&user->page, INCISE_HAPTIC_PAGE_OWNER_BYTE);
	     i++) {
		ask_owner(user, INCISE_HAPTIC_PAGE_END);
		nanosleep(&pause, NULL);
	}
	incise_haptic_page_close(&user->page, false);
	return i < END_LOOKS
		       ? 0
		       : incise_error_set(err, EBUSY,
					  "%s: the device's owner does not end; kill "
					  "process %u",
					  where, pid);
}

static int attach_once(struct haptic_user *user, const char *device, const char *where,
		       struct incise_error *err)
{
	int rc;

	incise_haptic_page_close(&user->page, false);
	memset(&user->owner, 0, sizeof(user->owner));
	user->rc = 0;
	user->cause = NULL;
	user->flags = 0;
	rc = incise_haptic_page_open(&user->page, device, where, err);
	return rc ? rc : read_device(user, device, where, err);
}

/* With an owner that is started, if there is none of these settings. */
static int attach_owned(struct haptic_user *user, const char *spec, const char *device,
			const char *where, const struct incise_haptic_setup *setup,
			struct incise_error *err)
{
	struct incise_error own = {0};
	int rc = attach_once(user, device, where, err), started;

	if (!rc && user->device.settings == incise_haptic_page_settings(setup))
		return 0;
	if (!rc || rc == -ESHUTDOWN)
		rc = end_owner(user, where, err);
	if (rc && rc != -ENOENT)
		return rc;
	started = incise_haptic_start_owner(spec, where, &own);
	/* It may be that of another program, which was faster. */
	rc = attach_once(user, device, where, err);
	return rc && rc != -EAGAIN && started
		       ? incise_error_set(err, -started, "%s", own.text)
		       : rc;
}

struct incise_haptic *incise_haptic_attach(const char *spec, const char *device,
					   const char *where,
					   const struct incise_haptic_setup *setup,
					   struct incise_clock *clock,
					   struct incise_error *err)
{
	struct haptic_user *user = calloc(1, sizeof(*user));
	static const struct incise_haptic_setup none;
	bool local = !strncmp(device, HAPTIC_PAGE_LOCAL, strlen(HAPTIC_PAGE_LOCAL));
	int rc;

	if (!user) {
		incise_error_set(err, ENOMEM, "%s: %s", where, strerror(ENOMEM));
		return NULL;
	}
	user->base.ops = &ops;
	user->clock = clock;
	user->page.fd = -1;
	rc = local ? attach_once(user, device, where, err)
		   : attach_owned(user, spec, device, where, setup, err);
	if (rc) {
		incise_haptic_page_close(&user->page, false);
		free(user);
		errno = -rc;
		return NULL;
	}
	/* An owner of ours has the settings of the rig. */
	incise_haptic_set_info(&user->base, local ? setup : &none);
	return &user->base;
}
