// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A camera's controls, locked; see v4l2_controls.h.
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>
#include <linux/videodev2.h>
#include "v4l2_controls.h"
#include "v4l2_file.h"

#define NS_PER_UNIT 100000	      /* of V4L2_CID_EXPOSURE_ABSOLUTE: 100 µs */
#define EXPOSURE_MAX_NS 10000000000LL /* longer ones are ignored */
#define UNREAD_MAX 3

/* An automatic control and the value that it adjusts, locked together. */
static const struct pair {
	const char *key; /* of camera_setup; NULL: the value is kept */
	size_t asked;	 /* a double in struct incise_camera_setup */
	double scale;	 /* to the units of the driver */
	uint32_t automatic, value;
	int32_t off[2]; /* of automatic: the first that the camera accepts */
	const char *automatic_name, *name;
} pairs[] = {
	{"exposure_ms",
	 offsetof(struct incise_camera_setup, exposure_ms),
	 10,
	 V4L2_CID_EXPOSURE_AUTO,
	 V4L2_CID_EXPOSURE_ABSOLUTE,
	 /* the second leaves only the iris to the camera */
	 {V4L2_EXPOSURE_MANUAL, V4L2_EXPOSURE_SHUTTER_PRIORITY},
	 "automatic exposure",
	 "exposure"},
	{NULL,
	 0,
	 0,
	 V4L2_CID_EXPOSURE_AUTO_PRIORITY,
	 V4L2_CID_EXPOSURE,
	 {0, 0},
	 "dynamic frame rate",
	 "exposure step"},
	{"white_balance_K",
	 offsetof(struct incise_camera_setup, white_balance_K),
	 1,
	 V4L2_CID_AUTO_WHITE_BALANCE,
	 V4L2_CID_WHITE_BALANCE_TEMPERATURE,
	 {0, 0},
	 "automatic white balance",
	 "white balance"},
	{NULL, 0, 0, 0, V4L2_CID_RED_BALANCE, {0, 0}, NULL, "red balance"},
	{NULL, 0, 0, 0, V4L2_CID_BLUE_BALANCE, {0, 0}, NULL, "blue balance"},
	{"gain",
	 offsetof(struct incise_camera_setup, gain),
	 1,
	 V4L2_CID_AUTOGAIN,
	 V4L2_CID_GAIN,
	 {0, 0},
	 "automatic gain",
	 "gain"},
	{"focus",
	 offsetof(struct incise_camera_setup, focus),
	 1,
	 V4L2_CID_FOCUS_AUTO,
	 V4L2_CID_FOCUS_ABSOLUTE,
	 {0, 0},
	 "automatic focus",
	 "focus"},
};

_Static_assert(2 * sizeof(pairs) / sizeof(*pairs) <= V4L2_LOCKS_MAX, "locks fit");

struct locking {
	struct v4l2_controls *controls;
	const char *where;
	struct incise_error *err;
};

static int get(int fd, uint32_t id, int32_t *value)
{
	struct v4l2_control control = {.id = id};
	int rc = v4l2_ask(fd, VIDIOC_G_CTRL, &control);

	*value = control.value;
	return rc;
}

static int set_v4l2_controls(int fd, uint32_t id, int32_t value)
{
	struct v4l2_control control = {.id = id, .value = value};

	return v4l2_ask(fd, VIDIOC_S_CTRL, &control);
}

/* Whether the camera has a control that can be read. */
static bool has_v4l2_control(int fd, uint32_t id, struct v4l2_queryctrl *range)
{
	*range = (struct v4l2_queryctrl){.id = id};
	return id && !v4l2_ask(fd, VIDIOC_QUERYCTRL, range) &&
	       !(range->flags & (V4L2_CTRL_FLAG_DISABLED | V4L2_CTRL_FLAG_WRITE_ONLY));
}

static int refuse_v4l2_controls(struct locking *l, int rc, const char *name)
{
	if (rc == -ENODEV)
		return incise_error_set(l->err, ENODEV, "%s: the camera was unplugged",
					l->where);
	if (rc == -EBUSY)
		return incise_error_set(l->err, EBUSY,
					"%s: the camera's %s is controlled by another "
					"program; end it",
					l->where, name);
	return incise_error_set(l->err, EIO, "%s: the camera's %s cannot be set: %s",
				l->where, name, strerror(-rc));
}

/* Set a control; it is read back after all are set. */
static int hold_v4l2_controls(struct locking *l, uint32_t id, const char *name,
			      int32_t value)
{
	struct v4l2_controls *c = l->controls;
	int32_t is = 0;
	int rc = get(c->fd, id, &is);

	if (!rc && is != value)
		rc = set_v4l2_controls(c->fd, id, value);
	if (rc)
		return refuse_v4l2_controls(l, rc, name);
	c->lock[c->n++] = (struct v4l2_lock){id, value, name};
	return 0;
}

static int lock_automatic(struct locking *l, const struct pair *pair)
{
	struct v4l2_controls *c = l->controls;
	struct v4l2_queryctrl range;
	int32_t is;
	int rc;

	if (!has_v4l2_control(c->fd, pair->automatic, &range))
		return 0;
	rc = get(c->fd, pair->automatic, &is);
	if (rc)
		return refuse_v4l2_controls(l, rc, pair->automatic_name);
	for (int i = 0; i < 2; i++) {
		rc = is == pair->off[i]
			     ? 0
			     : set_v4l2_controls(c->fd, pair->automatic, pair->off[i]);
		if (!rc) {
			c->lock[c->n++] = (struct v4l2_lock){
				pair->automatic, pair->off[i], pair->automatic_name};
			return 0;
		}
	}
	return refuse_v4l2_controls(l, rc, pair->automatic_name);
}

/* A value in the units and steps of the driver. */
static int value_of(struct locking *l, const struct pair *pair, double asked,
		    const struct v4l2_queryctrl *range, int32_t *value)
{
	double units = asked * pair->scale, step = range->step > 0 ? range->step : 1;
	double nearest = range->minimum + round((units - range->minimum) / step) * step;

	/* Rounding allows half a step. */
	if (units < range->minimum - step / 2 || units > range->maximum + step / 2)
		return incise_error_set(l->err, ERANGE,
					"%s: camera_setup.%s is %g; the camera takes %g "
					"to %g; correct it",
					l->where, pair->key, asked,
					range->minimum / pair->scale,
					range->maximum / pair->scale);
	if (nearest > range->maximum)
		nearest -= step;
	*value = (int32_t)fmax(nearest, range->minimum);
	return 0;
}

static int lock_pair(struct locking *l, const struct pair *pair,
		     const struct incise_camera_setup *setup)
{
	struct v4l2_controls *c = l->controls;
	struct v4l2_queryctrl range;
	bool there = has_v4l2_control(c->fd, pair->value, &range);
	double asked = 0;
	int32_t value = 0;
	int rc = 0;

	if (pair->key)
		memcpy(&asked, (const char *)setup + pair->asked, sizeof(asked));
	if (!(asked >= 0 && asked <= 1e6))
		return incise_error_set(l->err, EINVAL,
					"%s: camera_setup.%s is %g; correct it", l->where,
					pair->key, asked);
	if (asked > 0 && (!there || range.flags & V4L2_CTRL_FLAG_READ_ONLY))
		return incise_error_set(l->err, EOPNOTSUPP,
					"%s: the camera's %s cannot be set; remove "
					"camera_setup.%s",
					l->where, pair->name, pair->key);
	/* Read the value chosen by the camera before automatic goes off. */
	if (there && !(asked > 0))
		rc = get(c->fd, pair->value, &value);
	if (rc)
		return refuse_v4l2_controls(l, rc, pair->name);
	if (asked > 0)
		rc = value_of(l, pair, asked, &range, &value);
	if (!rc)
		rc = lock_automatic(l, pair);
	if (rc || !there || range.flags & V4L2_CTRL_FLAG_READ_ONLY)
		return rc;
	return hold_v4l2_controls(l, pair->value, pair->name, value);
}

static int check_exposure(const struct incise_camera_setup *setup, double rate_hz,
			  const char *where, struct incise_error *err)
{
	if (!(setup->exposure_ms * rate_hz > 1000))
		return 0;
	return incise_error_set(err, ERANGE,
				"%s: camera_setup.exposure_ms is %g, longer than the "
				"%g ms of a frame at %g Hz; correct one of them",
				where, setup->exposure_ms, 1000 / rate_hz, rate_hz);
}

/* Check that each control has the value that was set. */
static int read_back(struct locking *l)
{
	struct v4l2_controls *c = l->controls;

	for (int i = 0; i < c->n; i++) {
		const struct v4l2_lock *lock = &c->lock[i];
		int32_t is;
		int rc = get(c->fd, lock->id, &is);

		if (rc)
			return refuse_v4l2_controls(l, rc, lock->name);
		if (is != lock->value)
			return incise_error_set(
				l->err, EIO,
				"%s: the camera changes its %s from the set value %d "
				"to %d; set another value in camera_setup",
				l->where, lock->name, lock->value, is);
	}
	return 0;
}

static void note_exposure(struct v4l2_controls *c)
{
	for (int i = 0; i < c->n; i++)
		if (c->lock[i].id == V4L2_CID_EXPOSURE_ABSOLUTE && c->lock[i].value > 0 &&
		    c->lock[i].value <= EXPOSURE_MAX_NS / NS_PER_UNIT)
			c->exposure_ns = (int64_t)c->lock[i].value * NS_PER_UNIT;
}

int v4l2_controls_lock(struct v4l2_controls *controls, int fd,
		       const struct incise_camera_setup *setup, double rate_hz,
		       const char *where, struct incise_error *err)
{
	struct locking l = {controls, where, err};
	int rc;

	*controls = (struct v4l2_controls){.fd = fd};
	for (size_t i = 0; i < sizeof(pairs) / sizeof(*pairs); i++) {
		rc = lock_pair(&l, &pairs[i], setup);
		if (rc)
			return rc;
	}
	rc = check_exposure(setup, rate_hz, where, err);
	if (!rc)
		rc = read_back(&l);
	if (!rc)
		note_exposure(controls);
	return rc;
}

int v4l2_controls_check(struct v4l2_controls *c, const char *where,
			struct incise_error *err)
{
	int rc = 0, is;

	for (int i = 0; i < c->n; i++) {
		const struct v4l2_lock *lock = &c->lock[i];

		rc = get(c->fd, lock->id, &is);
		if (rc == -ENODEV)
			return incise_error_set(
				err, ENODEV,
				"%s: the camera was unplugged; plug it in and start "
				"again",
				where);
		if (rc)
			break;
		if (is != lock->value)
			return incise_error_set(
				err, EIO,
				"%s: the camera's %s has changed from %d to %d; end "
				"the program that changes it, and start again",
				where, lock->name, lock->value, is);
	}
	/* A transfer on a bus may fail once. */
	c->unread = rc ? c->unread + 1 : 0;
	if (c->unread < UNREAD_MAX)
		return 0;
	return incise_error_set(err, EIO,
				"%s: the camera's controls cannot be read any more: "
				"%s; check its cable",
				where, strerror(-rc));
}
