/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The options -o FILE.session and --code of a command that runs or shows a loop: it gives every tick, and
 * the file is written at the end.
 */
#ifndef INCISE_SESSION_LOG_H
#define INCISE_SESSION_LOG_H

#include <stdbool.h>
#include "../cli/cli.h"
#include "session.h"

struct session_options {
	const char *path; /* or NULL: no session */
	const char *code; /* or NULL */
};

/* Rows of the table of options, without the outer braces. */
#define SESSION_OPTIONS(type, member)                                                   \
	{'o',                                                                           \
	 "output",                                                                      \
	 "FILE.session",                                                                \
	 "write a session file at the end, for incise assess",                          \
	 CLI_OUTPUT(type, member.path),                                                 \
	 .parse = session_path_parse,                                                   \
	 .extensions = ".session"},                                                     \
	{                                                                               \
		0, "code", "CODE",                                                      \
			"of the session's subject, no name: up to 16 letters, digits, " \
			"'-' and '_'",                                                  \
			CLI_PARSED(type, member.code, session_code_parse)               \
	}

/* Anything but a file and a code is bad usage. */
void session_path_parse(void *path, char *text);
void session_code_parse(void *code, char *text);

/* After parsing: --code without a session is bad usage. */
void session_options_check(const struct session_options *options);

struct session_log;

/* A session that starts. Strings are copied. */
struct session_start {
	const char *program, *source;
	const struct incise_scene *scene;
	const char *scene_path;
	bool real; /* the clock is: the session has the time of the day */
};

/* Open the file, so that a wrong path fails before the run. NULL without a path, else fails. */
struct session_log *session_log_begin(const struct session_options *options,
				      const struct session_start *start);

/* A log that is NULL does nothing, here and below. */
void session_log_tick(struct session_log *log, const struct incise_tick *tick);

/* Ticks that never came, in total. */
void session_log_lost(struct session_log *log, uint64_t lost);

/*
 * Write the file and free the log. @kind: "asked", "signal", "fault"; @why: one line, or "".
 * 0, or a negative errno with @err.
 */
int session_log_end(struct session_log *log, const char *kind, const char *why,
		    struct incise_error *err);

#endif
