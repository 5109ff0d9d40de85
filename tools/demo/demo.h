/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The results of incise demo: plots, and a summary that grows from chapter to chapter.
 */
#ifndef INCISE_DEMO_H
#define INCISE_DEMO_H

#include <stdbool.h>
#include <stdio.h>
#include <jansson.h>
#include <incise/model.h>

#define DEMO_SPLITS 12 /* of the paper's protocol */

struct demo {
	const char *folder; /* all is left in it */
	long seed;	    /* of the virtual rig */
	bool quiet;	    /* --json: no steps and commands */
	bool silent;	    /* commands warn unseen, as long as they succeed */
	json_t *summary, *pictures;
};

/* The path of a file in the folder: free(3). */
char *demo_path(const struct demo *demo, const char *name);

/* Fails the program, after a signal. */
_Noreturn void demo_interrupted(const char *folder);

/* Read a model of the folder; fails the program. */
struct incise_model *demo_model(const struct demo *demo, const char *name);

/* A summary with version, seed and the paper's results. */
json_t *demo_summary_begin(long seed);

/* Add the error of the model and of its fixed form to the summary. */
void demo_worth(struct demo *demo, const struct incise_model *model);

/* Draw all plots of the walk, and add the error on the new cut to the summary. */
void demo_figures(struct demo *demo, const struct incise_model *model);

/* The summary as text; and both forms into the folder. */
void demo_summary_print(const struct demo *demo, FILE *out, double seconds);
void demo_summary_save(const struct demo *demo, double seconds);

#endif
