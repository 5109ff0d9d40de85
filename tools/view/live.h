/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Ticks of a running loop: another program's, read from its state page, or a loop in a thread of
 * this program, which has a state page, too. A reader never delays the loop.
 */
#ifndef INCISE_VIEW_LIVE_H
#define INCISE_VIEW_LIVE_H

#include <incise/loop.h>
#include <incise/realtime.h>
#include <incise/rig.h>
#include <incise/state.h>
#include <incise/view.h>
#include "../session/log.h"

struct view_live;

/* Open the page of another program's loop; NULL with errno. */
struct view_live *view_live_open(const char *page, struct incise_error *err);

/*
 * Start a loop in a thread of this program, in real time if @realtime is not NULL. Its arguments
 * must live until view_live_close(), which ends it. NULL with errno.
 */
struct view_live *view_live_begin(struct incise_plan *plan, struct incise_rig *rig,
				  double rate_hz, struct incise_realtime *realtime,
				  struct incise_error *err);

/* Set the tool; of a loop of this program. */
void view_live_tool(struct view_live *live, enum incise_tool tool);

/*
 * Feed the ticks since the last time to the view and to a session, if @log is not NULL, and set the
 * loop's status. 0; 1 when it has ended; a negative errno with @err.
 */
int view_live_take(struct view_live *live, struct incise_view *view,
		   struct session_log *log, struct incise_view_status *status,
		   struct incise_error *err);

/* The reason why another program's loop ended by a fault, or without a word; NULL: it did not. */
const char *view_live_fault(const struct view_live *live);

void view_live_close(struct view_live *live);

#endif
