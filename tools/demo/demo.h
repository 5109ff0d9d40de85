/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What the parts of incise demo hand to each other: the folder that all is left in, and the
 * summary that grows from chapter to chapter.
 *
 *   walk ─▶ reports of the verbs ─▶ worth ─▶ figures ─▶ summary
 */
#ifndef INCISE_DEMO_H
#define INCISE_DEMO_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <jansson.h>
#include <incise/dataset.h>
#include <incise/model.h>

struct demo {
	const char *folder;
	long seed;  /* of the virtual rig */
	bool quiet; /* --json: no steps and commands */
	json_t *summary, *pictures;
};

/* Seeds end below those of a rig by as much as another liver's is more. */
#define DEMO_OTHER_LIVER 1000
#define DEMO_SEED_MAX (INT32_MAX - DEMO_OTHER_LIVER)

/* Make a folder, which may be there already only if that is said; fails the program. */
void demo_make_folder(const char *folder, bool may_exist);

/* Formatted, and the path of a file in the folder: free(3). */
char *demo_text(const char *fmt, ...) INCISE_PRINTF(1, 2);
char *demo_path(const struct demo *demo, const char *name);

/* Files in the folder; what cannot be read fails the program. */
struct incise_dataset *demo_dataset(const struct demo *demo, const char *name,
				    const char *const *columns, int n, const char *group);
struct incise_model *demo_model(const struct demo *demo, const char *name);

/* A chapter begins. */
void demo_step(const struct demo *demo, const char *what);

/* The verbs, one after the other; their reports go into the summary. */
void demo_walk(struct demo *demo, const char *loop_time);

/* What the model and its fixed form are worth, into the summary. */
void demo_worth(struct demo *demo, const struct incise_model *model);

/* All pictures, after demo_walk(); what the new cut tells goes into the summary. */
void demo_figures(struct demo *demo, const struct incise_model *model);

/* A summary that says what this is. */
json_t *demo_summary_begin(long seed);

/* The summary as text, and both forms into the folder. */
void demo_summary_print(const struct demo *demo, FILE *out, double seconds);
void demo_summary_save(const struct demo *demo, double seconds);

/* A number of a report, of an object in it where there is @b; and a quantile of the loop's, us. */
double demo_number(const json_t *report, const char *a, const char *b);
char *demo_quantile_us(const json_t *haptic, const char *what, const char *name,
		       double unit);

#endif
