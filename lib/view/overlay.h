/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Panels over the image: force and depth over the last 10 s, phase, tool, state, lateness; and
 * the keys. They are images of their own, redrawn at most 15 times per second of the ticks' time.
 *
 *      ┌ force N ───────────┐
 *      │      ╱╲__          │     graphs run with the ticks' time: the last is at the right
 *      ├ depth mm ──────────┤
 *      │      ╱▔▔╲          │
 *      ├────────────────────┤
 *      │ cutting · blade …  │
 *      └────────────────────┘
 */
#ifndef INCISE_VIEW_OVERLAY_H
#define INCISE_VIEW_OVERLAY_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/plan.h>
#include <incise/view.h>

struct incise_overlay;

/* An image, premultiplied as cairo's ARGB32; the overlay's. */
struct incise_overlay_image {
	const uint8_t *pixels; /* rows of width × 4 bytes */
	int width, height;
	uint64_t version; /* changes when it is redrawn */
};

/* NULL with errno ENOMEM. */
struct incise_overlay *incise_overlay_new(struct incise_error *err);
void incise_overlay_free(struct incise_overlay *overlay);

/* Values that are not finite leave a gap. */
void incise_overlay_tick(struct incise_overlay *overlay, const struct incise_tick *tick);

/*
 * The panel after the last tick, with a status (or NULL); redrawn when it is due, or when the
 * status has another state.
 */
const struct incise_overlay_image *incise_overlay_panel(
	struct incise_overlay *overlay, const struct incise_view_status *status);

/* The keys' panel: lines "KEY\tWHAT", copied. 0, -ENOMEM. */
int incise_overlay_set_keys(struct incise_overlay *overlay, const char *const *lines,
			    int n);
const struct incise_overlay_image *incise_overlay_keys(struct incise_overlay *overlay);

#endif
