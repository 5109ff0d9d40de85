/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A program that is held up, as by a busy machine.
 */
#ifndef INCISE_VM_HOLD_H
#define INCISE_VM_HOLD_H

#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

/* Stops this program, all of its threads, for so long. */
static inline void hold_ms(int ms)
{
	pid_t me = getpid(), child = fork();

	if (!child) {
		kill(me, SIGSTOP);
		poll(NULL, 0, ms);
		kill(me, SIGCONT);
		_exit(0);
	}
	waitpid(child, NULL, 0);
}

#endif
