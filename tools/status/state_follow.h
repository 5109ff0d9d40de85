/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A loop's state while it goes on: what `incise status --follow` shows.
 */
#ifndef INCISE_STATE_FOLLOW_H
#define INCISE_STATE_FOLLOW_H

#include <stdbool.h>
#include "state_pages.h"

/*
 * On a terminal a view, drawn anew 5 times a second; else a line a second, or an object where
 * @json. Until cli_stop, or the loop ends. Returns whether all is well at the end.
 */
bool state_follow(const struct state_page_file *page, bool json);

#endif
