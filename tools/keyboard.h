/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Single keys from the terminal that the program was started at. Where standard input is no
 * terminal, or the program is in the background, there are none.
 */
#ifndef INCISE_KEYBOARD_H
#define INCISE_KEYBOARD_H

/* From now on keys come at once and are not shown; the terminal is as before at exit. */
void keyboard_begin(void);

/* The next key, or 0; does not wait. */
int keyboard_next(void);

#endif
