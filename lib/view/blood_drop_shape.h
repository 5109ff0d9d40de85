/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What a drop looks like: an ellipse of two halves, which follows the drop when that would be
 * seen.
 */
#ifndef INCISE_VIEW_BLOOD_DROP_SHAPE_H
#define INCISE_VIEW_BLOOD_DROP_SHAPE_H

#include "blood_drop.h"

/* One that hangs lies along its cut; in radii of a round one. */
#define DROP_HANGS_ALONG 1.7
#define DROP_HANGS_ACROSS 0.7

/* Where a drop is drawn. */
struct drop_box {
	struct ground_metric metric;
	double axis[2];		      /* unit, in the metric's frame */
	int left, top, right, bottom; /* texels that it can cover, the last ones too */
};

/* false: it is not drawn. */
bool drop_box(const struct film *film, const struct drop *drop, struct drop_box *box);

/* Where it is drawn is to be painted anew. */
void drops_mark(struct drops *drops, const struct drop *drop);

/* Draw it as it is, if it looks otherwise by now. */
void drops_show(struct drops *drops, struct drop *drop, const struct ground *ground);

/* It leaves its cut: the same shape, seen along another axis. */
void drop_turn_round(struct drop *drop, const struct ground *ground);

#endif
