/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A window with an OpenGL 3.3 core context, by SDL 2, and its events. Their places are in pixels of
 * the frame; the view adds rays. See incise/view.h.
 *
 * SDL 2 reports the pressure of fingers and of pens that are touch devices, not of pens that are
 * mice.
 */
#ifndef INCISE_VIEW_WINDOW_H
#define INCISE_VIEW_WINDOW_H

#include <incise/error.h>
#include <incise/view.h>

struct incise_window;

/* NULL with errno ENODEV (no screen), ENOTSUP (no OpenGL 3.3 there), ENOMEM. */
struct incise_window *incise_window_new(const char *title, int width, int height,
					struct incise_error *err);

/* Make its context current. 0, -EIO. */
int incise_window_current(struct incise_window *window, struct incise_error *err);

/* Size of the drawable, pixels; 0 × 0 while it is minimized. */
void incise_window_size(const struct incise_window *window, int *width, int *height);

/* Show the frame; waits for the screen if supported. */
void incise_window_show(struct incise_window *window);

/* The next event, its ray empty. 1; 0: no event. */
int incise_window_event(struct incise_window *window, struct incise_view_event *event);

void incise_window_free(struct incise_window *window);

#endif
