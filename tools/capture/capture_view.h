/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What incise capture shows on a terminal while it records.
 */
#ifndef INCISE_CAPTURE_VIEW_H
#define INCISE_CAPTURE_VIEW_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/recorder.h>

struct capture_view {
	double planned_s;    /* 0: not known */
	double full_scale_N; /* of the force channel, for its level */
	bool depth;	     /* vision looks at pictures */
	char last[80];	     /* what was marked last */
	int64_t shown_ns;
};

/* Five times a second at most; @seconds: since the recording, or waiting, began. */
void capture_view_show(struct capture_view *view, const struct incise_recorder *recorder,
		       double seconds);

/* Around all of it: from begin to end no writing to the terminal waits for it. */
void capture_view_begin(void);
void capture_view_end(void);

#endif
