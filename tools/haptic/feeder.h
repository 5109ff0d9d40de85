/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The feeder of a scene that the kernel renders: incise feed, a process of its own, which outlives its
 * watcher.
 *
 *   incise feed ── NAME.feed.state, NAME.feed.control ──▶ incise haptic --in-kernel
 */
#ifndef INCISE_HAPTIC_FEEDER_H
#define INCISE_HAPTIC_FEEDER_H

#include <stdbool.h>
#include <sys/types.h>
#include <incise/error.h>
#include <incise/tool.h>

struct feeder {
	pid_t pid;
	bool own;   /* this process started it, and ends it */
	char *page; /* of its state; free(3) */
};

/* The path of a feeder's page, for the page of the loop which watches: free(3). */
char *feeder_page(const char *loop_page);

/*
 * Take the living feeder, or start one with these arguments: argv[0] is set to the program, which is
 * beside this one. Returns when it feeds. 0; -ECHILD (it ended: it has said why), -EINTR (a signal).
 */
int feeder_begin(struct feeder *feeder, char **argv, struct incise_error *err);

/* Order another tool. Returns 0, or a negative errno with its answer in @err. */
int feeder_tool(const struct feeder *feeder, const char *tool, struct incise_error *err);

/*
 * End it if this process started it: the force fades. Waits for it. Returns 0; -ECHILD: it ended with
 * an error, and has said which.
 */
int feeder_end(struct feeder *feeder);

#endif
