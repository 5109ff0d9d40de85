/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Another program beside a measurement. Started without fork(2), after which this process
 * would copy each page that it writes to. It is asked to end when the thread that started it
 * does, even by SIGKILL.
 */
#ifndef INCISE_CHILD_H
#define INCISE_CHILD_H

#include <stdbool.h>
#include <sys/types.h>

/* Whether a program is in PATH. */
bool child_possible(const char *program);

/*
 * Start @argv, found in PATH or by its path, in a process group of its own: a Ctrl-C is for
 * us, who end it. Its output goes to a descriptor, or with -1 nowhere.
 * Returns its number; fails the program when it cannot be started.
 */
pid_t child_begin(char *const argv[], int out);

/* The same, and what it says on standard error goes to a descriptor as well. */
pid_t child_begin_heard(char *const argv[], int out, int err);

/* Whether it has ended by itself; then it is gone, and *status as waitpid(2) gives it. */
bool child_ended(pid_t pid, int *status);

/* Wait for its end, then ask for it, then force it. Returns status as waitpid(2). */
int child_end(pid_t pid, double wait_s);

#endif
