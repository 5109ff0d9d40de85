/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Which loops have told their state here: pages /run/incise/NAME.state and
 * $XDG_RUNTIME_DIR/incise/NAME.state.
 */
#ifndef INCISE_STATE_PAGES_H
#define INCISE_STATE_PAGES_H

#include <incise/state.h>

struct state_page_file {
	char *name; /* "neck" */
	char *path;
	struct incise_state *state;
};

struct state_pages {
	struct state_page_file *page;
	int n;
};

/*
 * The one asked for, a name, a scene or a page, or where it is NULL all; fails where there is none.
 * Of two of a name, the one whose loop lives. Pages that cannot be read are warned of.
 */
void state_pages_open(struct state_pages *pages, const char *asked);

/* A look. Returns 0, or -errno where the page makes no sense. Waits some ms at most. */
int state_pages_try(const struct state_page_file *page, struct incise_state_now *now,
		    struct incise_error *err);

/* The same, or fails. */
void state_pages_look(const struct state_page_file *page, struct incise_state_now *now);

void state_pages_close(struct state_pages *pages);

#endif
