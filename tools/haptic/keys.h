/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The keys of incise haptic on a terminal: b, h, t and a for blade, handle, tube and auto, without
 * Enter.
 */
#ifndef INCISE_HAPTIC_KEYS_H
#define INCISE_HAPTIC_KEYS_H

#include <stdbool.h>

/* Signals of a fault in the program, up to 0. */
extern const int keys_faults[];

/*
 * Read keys one by one, if standard input is the terminal of this process in the foreground: it is
 * as before again after keys_close(), at exit(3), and after a signal that kills, but for SIGKILL.
 */
bool keys_open(void);

/* Whether this process is in the foreground: else reading would stop it, and the loop with it. */
bool keys_here(void);

/* The tool of the key that was pressed, enum incise_tool; -1: it is none's. */
int keys_read(void);

/* May be called again, and without keys_open(). */
void keys_close(void);

#endif
