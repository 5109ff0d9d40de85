/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Properties of the library that hold whatever comes in. Each generates cases, the same ones by
 * seed, and checks them. Unit tests try a part of the cases, tests/bench/extremes all of them.
 *
 *     case ──▶ held     the result is as it must be, and within its limits
 *          ├─▶ refused  with a line that gives the reason
 *          └─▶ wrong    neither: the row keeps the first, with its numbers to the bit
 */
#ifndef INCISE_EXTREMES_H
#define INCISE_EXTREMES_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

struct extremes_setup {
	uint64_t seed;
	int part;	    /* try one of so many cases */
	const char *scenes; /* folder of the scenes that ship */
};

struct extremes_row {
	const char *name, *what;
	long tried, held, refused, wrong;
	char failed[600]; /* the first wrong case; empty */
	const struct extremes_setup *setup;
};

struct property {
	const char *name, *what; /* the cases, and the rule */
	long cases;		 /* of @each, or of what @all takes for one */
	/* One case, or all of them. */
	void (*each)(struct extremes_row *row, const struct property *property);
	void (*all)(struct extremes_row *row, const struct property *property);
	int kind;	     /* of several properties that share a function */
	const void *of;	     /* the same */
	bool for_tests_only; /* tests/bench/extremes has no row for it */
};

/* By interface; each ends with a property without a name. */
extern const struct property model_properties[], fixed_properties[], surface_properties[],
	control_properties[], motion_properties[], plan_properties[], wall_properties[],
	device_properties[], file_properties[];

/* Try a property. @setup is used as long as @row. */
void extremes_try(const struct property *property, const struct extremes_setup *setup,
		  struct extremes_row *row);

/* The number of cases to try of so many in full. */
long extremes_cases(const struct extremes_row *row, long full);

/* Count a case. The first wrong one is described by @fmt and its number; numbers are %a. */
void extremes_check(struct extremes_row *row, bool held, const char *fmt, ...)
	INCISE_PRINTF(3, 4);

/* Count a refused case, which is wrong without a line of @err that gives the reason. */
void extremes_refused(struct extremes_row *row, const struct incise_error *err);

/* Count a case that is refused by a return value alone. */
void extremes_refused_plainly(struct extremes_row *row);

/* A vector in a description of a case. */
#define V3 "(%a, %a, %a)"
#define V3_OF(v) (v)[0], (v)[1], (v)[2]

#endif
