/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The state pages of this machine's loops, in the folders of cli/state_folder.h.
 */
#ifndef INCISE_STATUS_PAGES_H
#define INCISE_STATUS_PAGES_H

#include <incise/state.h>

struct state_page_file {
	char *name; /* "neck" */
	char *path;
	char *user; /* its owner: whose loop it is */
	struct incise_state *state;
};

struct state_pages {
	struct state_page_file *page;
	int n;
};

/*
 * Open the page of a name, a scene or a file, or with NULL all; fails without a page. If
 * two pages have one name, it takes the live loop's. Warns of unreadable pages.
 */
void state_pages_open(struct state_pages *pages, const char *asked);

/* Read the page. 0 or -errno for a damaged page. Waits up to 1 s for the writer. */
int state_pages_try(const struct state_page_file *page, struct incise_state_now *now,
		    struct incise_error *err);

/* The same; failure ends the program. */
void state_pages_look(const struct state_page_file *page, struct incise_state_now *now);

void state_pages_close(struct state_pages *pages);

#endif
