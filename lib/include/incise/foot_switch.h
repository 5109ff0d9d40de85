/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A foot switch: an input device of Linux that sends a key when it is pressed, as USB pedals do.
 *
 *     foot_switch = { device = "/dev/input/by-id/usb-PCsensor_FootSwitch-event-kbd"; key =
 *     "b"; };
 */
#ifndef INCISE_FOOT_SWITCH_H
#define INCISE_FOOT_SWITCH_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** The group `foot_switch` of rig.conf. */
struct incise_foot_switch_setup {
	char device[256]; /**< path of an event device */
	uint16_t key;	  /**< its code in linux/input-event-codes.h */
};

struct incise_foot_switch;

/**
 * Find the code of a key.
 *
 * @param name a letter, a digit, f1 to f12, space, enter, tab, esc, left, right, up, down,
 *             pageup, pagedown, home, end, or a mouse's btn_left, btn_right, btn_middle
 * @return its code; -EINVAL. Real-time safe.
 */
INCISE_API int incise_foot_switch_key(const char *name);

/**
 * Open a foot switch exclusively: while it is open, its key types nowhere else.
 *
 * @return foot switch, to be closed with incise_foot_switch_close(); NULL with errno of
 *         open(2), ENOTTY (no input device), ENXIO (it has no such key), EBUSY (another
 *         program has it exclusively, or the key is pressed), ENOMEM.
 */
INCISE_API struct incise_foot_switch *incise_foot_switch_open(
	const struct incise_foot_switch_setup *setup, struct incise_error *err);

/** File descriptor for poll(2); readable when there are events. */
INCISE_API int incise_foot_switch_fd(const struct incise_foot_switch *foot_switch);

/**
 * Number of presses since the last call. A key that is held down counts once. Never waits.
 *
 * @return 0 or more; -ENODEV (unplugged), -EIO
 */
INCISE_API int incise_foot_switch_read(struct incise_foot_switch *foot_switch);

/** NULL is accepted. */
INCISE_API void incise_foot_switch_close(struct incise_foot_switch *foot_switch);

INCISE_END_DECLS
#endif
