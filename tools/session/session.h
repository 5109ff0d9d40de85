/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A session: one run of the procedure on a scene, as incise-session(5) writes it. It is a function
 * of the scene and of the loop's ticks alone, so that the same ticks give the same file.
 *
 *     ticks ──▶ digest ──▶ struct session ──▶ NAME.session ──▶ struct session ──▶ judged
 *
 * mm, in the tracker's frame; N; s since the first tick. NAN: not there. A file holds every length,
 * force and time to 1e-4 of its unit.
 */
#ifndef INCISE_SESSION_H
#define INCISE_SESSION_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <incise/error.h>
#include <incise/plan.h>
#include <incise/scene.h>

/* Schema of the file: readers refuse others. */
#define SESSION_FORM 1

#define SESSION_CODE_MAX 16 /* characters */
#define SESSION_PHASES_MAX 256
#define SESSION_CUTS_MAX 1024 /* as of tissue.cuts_most */
#define SESSION_TRACE_MAX 16384

/* Beyond these a value is damage: a year, and lib/tissue's limit of a place. */
#define SESSION_TIME_MAX_S 3.2e7
#define SESSION_PLACE_MAX_MM 1e6
#define SESSION_FORCE_MAX_N 1e6

/* A time in which one tool was in the tissue. */
struct session_phase {
	enum incise_tool tool;
	double from_s, to_s;
	double depth_mm, force_N; /* largest */
};

struct session_cut {
	int incision; /* lowest number of the cuts that it is joined with */
	double from_mm[3], to_mm[3]; /* ends, in the surface */
	double length_mm;
	double direction_deg; /* seen along z, from x towards y; above -90, at most 90 */
	double depth_mm, depth_median_mm, open_mm; /* largest and median along it */
	double off_target_mm;			   /* from the membrane's axis, or NAN */
};

/* Largest depth and force of an interval, and the place at its start. */
struct session_sample {
	double t_s, tool_mm[3], depth_mm, force_N;
	enum incise_tool tool; /* in the tissue; else INCISE_TOOL_AUTO */
};

struct session {
	char version[32], program[16];
	char source[256];		 /* of the ticks: a rig, a recording … */
	char code[SESSION_CODE_MAX + 1]; /* or "" */
	double start_unix_s;		 /* NAN in simulated time */
	struct {
		char kind[16]; /* "asked", "signal", "fault" */
		char why[300]; /* or "" */
	} end;

	struct {
		char path[512];
		char crc32c[9]; /* hexadecimal */
		double rate_hz;
	} scene;
	bool has_membrane;
	struct incise_scene_membrane membrane;
	struct incise_scene_criterion criteria[INCISE_CRITERIA];

	double ticks, lost, unusable; /* counts */
	double duration_s;
	double first_s, last_s; /* contacts */
	double needed_s; /* from the first contact until the tube is in place, or the last contact */

	double phases_apart_s; /* shorter gaps between phases of one tool are closed */
	double phases_left_out;
	int n_phases;
	struct session_phase phase[SESSION_PHASES_MAX];

	bool cuts_full; /* the blade was to cut beyond tissue.cuts_most */
	int n_cuts;
	struct session_cut cut[SESSION_CUTS_MAX];

	/* By the handle; turns of 30° or more in a cut, and the largest one out of its line. */
	struct {
		double force_N, open_mm, turns, turned_deg, time_s;
	} enlarging;
	/* Numbers of the tube; its depth now is its depth at the end. */
	struct {
		double depth_mm, seated_mm, force_N, placed_s;
	} insertion;
	/* Numbers of tools that came to the depth of the membrane. */
	struct {
		bool hit, punctured;
		enum incise_tool tool;	 /* that hit it first; AUTO: no tool */
		double t_s, off_axis_mm; /* then */
		double missed;		 /* how often a tool came beside it */
		double missed_mm;	 /* least distance from the axis then */
	} target;
	struct {
		double touched; /* how often */
		double deepest_mm;
	} back_wall;
	struct {
		double largest_N, t_s;
		enum incise_tool tool;
	} force;

	double trace_s; /* interval of samples in the tissue; ten times that in the air */
	int n_trace;
	struct session_sample trace[SESSION_TRACE_MAX];
};

/* Letters, digits, '-' and '_', at most SESSION_CODE_MAX, no '-' first: a code, no name of a person. */
bool session_is_code(const char *text);

/* --- ticks to a session --- */

struct session_digest;

/*
 * Start the digest of a session on a scene, which is needed here alone; NULL with errno and @err.
 * session_digest_free().
 */
struct session_digest *session_digest_new(const struct incise_scene *scene,
					  struct incise_error *err);

/* Add a tick, each once and in order. A tick that is not finite or of the past is only counted. */
void session_digest_tick(struct session_digest *digest, const struct incise_tick *tick);

/* Ticks that never came, in total. */
void session_digest_lost(struct session_digest *digest, uint64_t lost);

/* The result of the ticks so far; valid, and for the caller to complete, until the next one. */
struct session *session_digest_now(struct session_digest *digest);

/* NULL is accepted. */
void session_digest_free(struct session_digest *digest);

/* --- the file --- */

/* Write it; NULL if there is no memory. json_decref(). */
json_t *session_json(const struct session *session);

/*
 * Read one from text that may hold anything; @name: for messages. free(3); NULL with errno EINVAL,
 * EPROTO (another form), ENOMEM, and @err.
 */
struct session *session_parse(const char *text, size_t n, const char *name,
			      struct incise_error *err);

/* The same from a file; also errno of incise_infile_read(). */
struct session *session_read(const char *path, struct incise_error *err);

/* --- the criteria --- */

struct session_verdict {
	double value; /* or NAN */
	bool judged;  /* asked for, on a scene that can have a value */
	bool met;
};

void session_judge(const struct session *session,
		   struct session_verdict verdicts[INCISE_CRITERIA]);

/* "length of the incision", its unit, and "20 to 40", "at most 5", "yes". */
const char *session_criterion_label(int criterion);
const char *session_criterion_head(int criterion); /* of a column */
const char *session_criterion_unit(int criterion);
void session_criterion_asked(int criterion, const struct incise_scene_criterion *asked,
			     char *text, size_t size);

/* To so many digits, and without a negative 0. */
double session_rounded(double value, int digits);

/* NAN: yes and no have no difference. */
double session_criterion_difference(int criterion, double value, double reference);

/* "29.6", "yes", "-" without a value. */
void session_criterion_value(int criterion, double value, char *text, size_t size);

/* --- figures --- */

/*
 * Commands for a script of cli/plot.h: the tool's path from above with the cuts, and the force and
 * the depth over time with the phases. The session has samples, @reference may be NULL.
 */
void session_figure_path(FILE *script, const struct session *session,
			 const struct session *reference);
void session_figure_force(FILE *script, const struct session *session,
			  const struct session *reference);
void session_figure_depth(FILE *script, const struct session *session,
			  const struct session *reference);

#endif
