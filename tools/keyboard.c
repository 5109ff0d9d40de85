// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Keys without Enter; see keyboard.h.
 */
#include <stdbool.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>
#include "keyboard.h"

static bool begun;
static struct termios before;

static void end(void)
{
	tcsetattr(STDIN_FILENO, TCSANOW, &before);
}

/* Who reads or sets a terminal from the background is stopped by it. */
static bool in_front(void)
{
	return tcgetpgrp(STDIN_FILENO) == getpgrp();
}

void keyboard_begin(void)
{
	struct termios keys;

	if (begun || !isatty(STDIN_FILENO) || !in_front() ||
	    tcgetattr(STDIN_FILENO, &before))
		return;
	keys = before;
	keys.c_lflag &= ~(tcflag_t)(ICANON | ECHO); /* Ctrl-C goes on to be a signal */
	keys.c_cc[VMIN] = 0;
	keys.c_cc[VTIME] = 0;
	if (tcsetattr(STDIN_FILENO, TCSANOW, &keys))
		return;
	begun = true;
	atexit(end);
}

int keyboard_next(void)
{
	unsigned char key;

	return begun && in_front() && read(STDIN_FILENO, &key, 1) == 1 ? key : 0;
}
