// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Keys without Enter; see keyboard.h.
 *
 *     begin ─► keys ── Ctrl-Z ─► as before, stopped ── fg ─► keys ─► end: as before
 *                                                   └─ bg ─► as the shell has it
 */
#include <errno.h>
#include <signal.h>
#include <stdbool.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>
#include "keyboard.h"

static volatile sig_atomic_t begun, resumed;
static struct termios before, keys;

/* Who reads or sets a terminal from the background is stopped by it. */
static bool in_front(void)
{
	return tcgetpgrp(STDIN_FILENO) == getpgrp();
}

void keyboard_end(void)
{
	if (begun && in_front())
		tcsetattr(STDIN_FILENO, TCSANOW, &before);
	begun = false;
}

static void on_continue(int number)
{
	int error = errno;

	(void)number;
	resumed = true;
	if (begun && in_front())
		tcsetattr(STDIN_FILENO, TCSANOW, &keys);
	errno = error;
}

/* Ctrl-Z and Ctrl-\: do what they do, but leave a terminal that one can type at. */
static void on_stop(int number)
{
	struct sigaction action = {.sa_handler = SIG_DFL}, ours;
	int error = errno;

	if (begun && in_front())
		tcsetattr(STDIN_FILENO, TCSANOW, &before);
	sigaction(number, &action, &ours);
	raise(number);
	sigaction(number, &ours, NULL);
	/* Where there is nobody to go on by fg it was not stopped. */
	on_continue(number);
	errno = error;
}

static void watch(int number, void (*handler)(int))
{
	/* Not to be blocked inside, as it raises itself. */
	struct sigaction action = {.sa_handler = handler,
				   .sa_flags = SA_RESTART | SA_NODEFER},
			 had;

	if (!sigaction(number, NULL, &had) && had.sa_handler != SIG_IGN)
		sigaction(number, &action, NULL);
}

void keyboard_begin(void)
{
	if (begun || !isatty(STDIN_FILENO) || !in_front() ||
	    tcgetattr(STDIN_FILENO, &before))
		return;
	keys = before;
	keys.c_lflag &= ~(tcflag_t)(ICANON | ECHO); /* Ctrl-C goes on to be a signal */
	keys.c_cc[VMIN] = 0;
	keys.c_cc[VTIME] = 0;
	watch(SIGTSTP, on_stop);
	watch(SIGQUIT, on_stop);
	watch(SIGCONT, on_continue);
	begun = true;
	atexit(keyboard_end);
	tcsetattr(STDIN_FILENO, TCSANOW, &keys);
}

bool keyboard_resumed(void)
{
	bool was = resumed;

	resumed = false;
	return was;
}

int keyboard_next(void)
{
	unsigned char key;

	return begun && in_front() && read(STDIN_FILENO, &key, 1) == 1 ? key : 0;
}
