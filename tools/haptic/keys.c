// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Keys on a terminal; see keys.h.
 */
#include <signal.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>
#include <incise/tool.h>
#include "keys.h"

#define ESCAPE 27

const int keys_faults[] = {SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGSYS, 0};

/* Others that end the program, and that incise haptic does not catch. */
static const int ends[] = {SIGABRT, SIGQUIT, SIGTRAP, SIGALRM,
			   SIGXCPU, SIGUSR1, SIGUSR2, 0};

static struct termios before;
static volatile sig_atomic_t changed;

bool keys_here(void)
{
	return tcgetpgrp(STDIN_FILENO) == getpgrp();
}

void keys_close(void)
{
	if (!changed)
		return;
	changed = 0;
	/* In the background the terminal is another program's. */
	if (keys_here())
		tcsetattr(STDIN_FILENO, TCSANOW, &before);
}

/* All that it calls is safe in a signal handler; POSIX.1-2008, 2.4.3. */
static void die(int number)
{
	keys_close();
	/* By the default action, which is in force again. */
	raise(number);
}

static void catch (const int *signals)
{
	struct sigaction action = {.sa_handler = die,
				   .sa_flags = SA_RESETHAND | SA_NODEFER};

	for (; *signals; signals++)
		sigaction(*signals, &action, NULL);
}

bool keys_open(void)
{
	struct sigaction ignore = {.sa_handler = SIG_IGN};
	struct termios now;

	if (!isatty(STDIN_FILENO) || !keys_here() || tcgetattr(STDIN_FILENO, &before))
		return false;
	/* Put into the background between a look and a read, it gets an error. */
	sigaction(SIGTTIN, &ignore, NULL);
	sigaction(SIGTTOU, &ignore, NULL);
	catch (keys_faults);
	catch (ends);
	atexit(keys_close);
	now = before;
	/* Ctrl-C and Ctrl-Z stay what they are. */
	now.c_lflag &= ~(tcflag_t)(ICANON | ECHO);
	now.c_cc[VMIN] = 1;
	now.c_cc[VTIME] = 0;
	changed = 1;
	return !tcsetattr(STDIN_FILENO, TCSANOW, &now);
}

int keys_read(void)
{
	char key[32];
	ssize_t n = read(STDIN_FILENO, key, sizeof(key));

	/* An arrow or the like begins with it, and is sent at once. The last key counts. */
	if (n <= 0 || key[0] == ESCAPE)
		return -1;
	switch (key[n - 1]) {
	case 'a':
		return INCISE_TOOL_AUTO;
	case 'b':
		return INCISE_TOOL_BLADE;
	case 'h':
		return INCISE_TOOL_HANDLE;
	case 't':
		return INCISE_TOOL_TUBE;
	default:
		return -1;
	}
}
