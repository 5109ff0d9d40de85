/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Single keys from the terminal that the program was started at. Where standard input is no
 * terminal, or the program is in the background, there are none.
 */
#ifndef INCISE_KEYBOARD_H
#define INCISE_KEYBOARD_H

#include <stdbool.h>

/*
 * From now on keys come at once and are not shown. The terminal is as before at exit, and
 * while the program is suspended (Ctrl-Z) or in the background.
 */
void keyboard_begin(void);

/* The terminal is as before from now on. */
void keyboard_end(void);

/* Whether the terminal was another's meanwhile; true once. */
bool keyboard_resumed(void);

/* The next key, or 0; does not wait. */
int keyboard_next(void);

#endif
