/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A program that runs next to this one. It is started without fork(2), after which this
 * process would copy each page that it writes to. It gets SIGTERM when the thread that
 * started it ends, even by SIGKILL.
 */
#ifndef INCISE_CHILD_H
#define INCISE_CHILD_H

#include <stdbool.h>
#include <sys/types.h>

/* Whether a program is in PATH. */
bool child_possible(const char *program);

/*
 * Start @argv, found in PATH or by its path, in a process group of its own: the caller ends
 * it at a Ctrl-C. Its output goes to descriptor @out and its errors to @err; -1: to
 * /dev/null. Fails the program when it cannot be started.
 */
pid_t child_start(char *const argv[], int out, int err);

/*
 * Run @argv, found in PATH or by its path, until it ends, in the foreground: it may ask on the
 * terminal, and a Ctrl-C also ends it. It gets SIGTERM when this process is to stop. Its input comes from descriptor @in, its output goes to @out, its errors to
 * @err; -1: /dev/null. Returns its status as of waitpid(2), or -1 with errno if it cannot be started.
 */
int child_run(char *const argv[], int in, int out, int err);

/* Whether it has ended by itself, with *status as of waitpid(2). It is reaped then. */
bool child_ended(pid_t pid, int *status);

/* Wait for its end, then send SIGTERM, then SIGKILL. Returns its status as of waitpid(2). */
int child_end(pid_t pid, double wait_s);

#endif
