// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A foot switch; see incise/foot_switch.h. By the kernel's own interface, <linux/input.h>: with
 * libevdev the key, the grab and each read would take a call each, which are an ioctl and a read
 * here, and it would be another library in a process locked in memory. It keeps the state of many
 * keys and slots over a buffer that ran over, and a count of presses has no such state:
 *
 *   EV_KEY key 1    pressed          counts
 *   EV_KEY key 2    repeated         does not
 *   EV_KEY key 0    released         does not
 *   EV_SYN DROPPED  ran over         all up to the next EV_SYN REPORT is left out
 */
#include <errno.h>
#include <fcntl.h>
#include <linux/input.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>
#include <incise/foot_switch.h>

#define EVENTS 64
#define LONG_BITS (8 * sizeof(long))
#define KEY_LONGS (KEY_MAX / LONG_BITS + 1)

/* At one read at most: a device that floods ends no call. */
#define READS 16

struct incise_foot_switch {
	int fd;
	uint16_t key;
	bool dropping; /* up to the next report */
};

/* --- names ------------------------------------------------------------------------------- */

/* Rows of a keyboard: keys with codes one after the other. */
static const struct {
	const char *keys;
	int first;
} rows[] = {
	{"1234567890", KEY_1},
	{"qwertyuiop", KEY_Q},
	{"asdfghjkl", KEY_A},
	{"zxcvbnm", KEY_Z},
};

static const struct {
	const char *name;
	int code;
} names[] = {
	{"f1", KEY_F1},
	{"f2", KEY_F2},
	{"f3", KEY_F3},
	{"f4", KEY_F4},
	{"f5", KEY_F5},
	{"f6", KEY_F6},
	{"f7", KEY_F7},
	{"f8", KEY_F8},
	{"f9", KEY_F9},
	{"f10", KEY_F10},
	{"f11", KEY_F11},
	{"f12", KEY_F12},
	{"space", KEY_SPACE},
	{"enter", KEY_ENTER},
	{"tab", KEY_TAB},
	{"esc", KEY_ESC},
	{"left", KEY_LEFT},
	{"right", KEY_RIGHT},
	{"up", KEY_UP},
	{"down", KEY_DOWN},
	{"pageup", KEY_PAGEUP},
	{"pagedown", KEY_PAGEDOWN},
	{"home", KEY_HOME},
	{"end", KEY_END},
	{"btn_left", BTN_LEFT},
	{"btn_right", BTN_RIGHT},
	{"btn_middle", BTN_MIDDLE},
};

int incise_foot_switch_key(const char *name)
{
	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		const char *at = *name && !name[1] ? strchr(rows[i].keys, *name) : NULL;

		if (at)
			return rows[i].first + (int)(at - rows[i].keys);
	}
	for (size_t i = 0; i < sizeof(names) / sizeof(*names); i++)
		if (!strcmp(name, names[i].name))
			return names[i].code;
	return -EINVAL;
}

/* --- opening ------------------------------------------------------------------------------ */

static bool has_foot_switch_bit(const unsigned long *bits, unsigned int n)
{
	return bits[n / LONG_BITS] >> n % LONG_BITS & 1;
}

static int refuse_foot_switch(const struct incise_foot_switch_setup *setup, int code,
			      const char *what, struct incise_error *err)
{
	return incise_error_set(err, code, "foot_switch.device: %s: %s", setup->device,
				what);
}

/* Whether it has the key, unpressed: after a grab no program would see a pressed key released. */
static int check_foot_switch(const struct incise_foot_switch *foot,
			     const struct incise_foot_switch_setup *setup,
			     struct incise_error *err)
{
	unsigned long known[KEY_LONGS] = {0}, pressed[KEY_LONGS] = {0};
	int rc;

	if (ioctl(foot->fd, EVIOCGBIT(EV_KEY, sizeof(known)), known) < 0) {
		rc = errno == EINVAL ? ENOTTY : errno;
		return refuse_foot_switch(
			setup, rc,
			rc == ENOTTY ? "not an input device; see /dev/input/by-id"
				     : strerror(rc),
			err);
	}
	if (!has_foot_switch_bit(known, foot->key))
		return refuse_foot_switch(
			setup, ENXIO,
			"has no such key; see foot_switch.key in rig.conf(5)", err);
	if (ioctl(foot->fd, EVIOCGKEY(sizeof(pressed)), pressed) < 0)
		return refuse_foot_switch(setup, errno, strerror(errno), err);
	if (has_foot_switch_bit(pressed, foot->key))
		return refuse_foot_switch(setup, EBUSY,
					  "the switch is pressed; release it", err);
	if (ioctl(foot->fd, EVIOCGRAB, 1) < 0) {
		rc = errno;
		return refuse_foot_switch(
			setup, rc,
			rc == EBUSY ? "another program has it open exclusively; "
				      "end it"
				    : strerror(rc),
			err);
	}
	return 0;
}

static int open_device(struct incise_foot_switch *foot,
		       const struct incise_foot_switch_setup *setup,
		       struct incise_error *err)
{
	foot->fd = open(setup->device, O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY);
	if (foot->fd >= 0)
		return check_foot_switch(foot, setup, err);
	if (errno == ENOENT)
		return refuse_foot_switch(setup, ENOENT, "no such device; plug it in",
					  err);
	if (errno == EACCES)
		return refuse_foot_switch(
			setup, EACCES,
			"this user may not read it; rig.conf(5) has the udev rule for "
			"it",
			err);
	return refuse_foot_switch(setup, errno, strerror(errno), err);
}

struct incise_foot_switch *incise_foot_switch_open(
	const struct incise_foot_switch_setup *setup, struct incise_error *err)
{
	struct incise_foot_switch *foot = calloc(1, sizeof(*foot));
	int rc;

	if (!foot)
		return INCISE_ERROR_NULL(err, ENOMEM, "no memory for a foot switch");
	foot->fd = -1;
	foot->key = setup->key <= KEY_MAX ? setup->key : KEY_RESERVED;
	rc = open_device(foot, setup, err);
	if (!rc)
		return foot;
	incise_foot_switch_close(foot);
	errno = -rc;
	return NULL;
}

int incise_foot_switch_fd(const struct incise_foot_switch *foot_switch)
{
	return foot_switch->fd;
}

void incise_foot_switch_close(struct incise_foot_switch *foot_switch)
{
	if (!foot_switch)
		return;
	/* The kernel lets go of it with the last descriptor. */
	if (foot_switch->fd >= 0)
		close(foot_switch->fd);
	free(foot_switch);
}

/* --- reading ------------------------------------------------------------------------------ */

static int count_foot_switch(struct incise_foot_switch *foot,
			     const struct input_event *event)
{
	if (event->type == EV_SYN && event->code == SYN_DROPPED)
		foot->dropping = true;
	else if (event->type == EV_SYN && event->code == SYN_REPORT)
		foot->dropping = false;
	return event->type == EV_KEY && event->code == foot->key && event->value == 1 &&
	       !foot->dropping;
}

int incise_foot_switch_read(struct incise_foot_switch *foot_switch)
{
	struct input_event events[EVENTS];
	int presses = 0;

	for (int k = 0; k < READS; k++) {
		ssize_t n = read(foot_switch->fd, events, sizeof(events));

		if (n < 0 && (errno == EAGAIN || errno == EINTR))
			return presses;
		/* Presses before it went away count. */
		if (n <= 0 && presses)
			return presses;
		if (n <= 0)
			return !n || errno == ENODEV ? -ENODEV : -EIO;
		/* The kernel sends whole events; less is not of an input device. */
		if ((size_t)n % sizeof(*events))
			return -EIO;
		for (size_t i = 0; i < (size_t)n / sizeof(*events); i++)
			presses += count_foot_switch(foot_switch, &events[i]);
	}
	return presses;
}
