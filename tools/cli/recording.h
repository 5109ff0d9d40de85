/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A recording that exists already: to read, to remove, to replace. Every failure ends the
 * program.
 */
#ifndef INCISE_TOOLS_RECORDING_H
#define INCISE_TOOLS_RECORDING_H

#include <stdbool.h>
#include <incise/recording.h>

/* Open one. */
struct incise_recording *recording_open(const char *path);

/* Row of the table of options for --damaged, a bool. */
#define RECORDING_DAMAGED(type, member)                                       \
	{                                                                     \
		0, "damaged", NULL,                                           \
			"use a recording that failed verification, as it is", \
			CLI_FLAG(type, member)                                \
	}

/*
 * Compare a recording with its ledger: all @samples, or the tables alone where its summary is enough. Returns
 * 0; 1 and the first difference; -errno and the reason.
 */
int recording_altered(const char *path, bool samples, struct incise_error *err);

/*
 * Whether the rows of a recording are those that were recorded, by its ledger. If not, says what
 * is wrong first: as a warning with @damaged, else as an error in @err, for a caller that fails
 * the program with it.
 */
bool recording_intact(const char *path, bool samples, bool damaged,
		      struct incise_error *err);

/* Cuts by the depth of the tip, counted as in incise-export(1). */
#define RECORDING_CUTS_MOST 10000

struct recording_cuts {
	bool inside;
	int n;
	struct recording_cut {
		double from_s, to_s;
	} cut[RECORDING_CUTS_MOST];
};

/* The next depth. */
void recording_cuts_step(struct recording_cuts *cuts, double t_s, double depth_mm);

/* Whether people want to see events of a kind: losses are seen in the streams, cuts in the depth. */
bool recording_shows_event(const char *kind);

/* Remove a recording; a folder with anything else in it stays. */
void recording_remove(const char *path);

/*
 * The path to record into, for recording_replace(): @path itself, or with --overwrite one next
 * to it: free(3). What is at @path must be a recording then, and what interrupted ones left
 * there is removed.
 */
char *recording_target(const char *path);

/*
 * Put the complete recording @target under its @path. With --overwrite it takes the place of
 * an older one in one step, which is then removed.
 */
void recording_replace(const char *target, const char *path);

#endif
