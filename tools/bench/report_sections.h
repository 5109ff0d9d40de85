/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What stands in the report of incise bench all, as data: a section for each word of incise
 * bench, with what it asks, how, and which keys of its JSON are which columns; and the figures
 * that matter most, by promise.
 */
#ifndef INCISE_REPORT_SECTIONS_H
#define INCISE_REPORT_SECTIONS_H

/* What of the rows stands in a cell. */
enum report_part {
	PART_VALUE,   /* the row's own */
	PART_LEAST,   /* of several rows, as all below */
	PART_LARGEST, /* of magnitude */
	PART_RANGE,   /* "least to largest" */
	PART_MEDIAN,
	PART_SUM,
	PART_ROWS,   /* how many there are */
	PART_HOLDING /* how many have it: true, or a text; "3 of 12" */
};

/*
 * A key may lead inwards, "tick_ns.median", or be a ratio, "tick_ns/full_ns"; "@" is the name
 * of the array that the row is in. A key that no row has is no column.
 */
struct report_column {
	const char *key, *heading;
	int digits; /* significant ones; 0: text, or yes and no */
	enum report_part part;
	double scale; /* shown is the value times this; 0 is 1 */
};

#define REPORT_COLUMNS 14

/*
 * @rows is a path to an array, or several, "exact_limit,colgate". When parts of several rows
 * are asked for, rows whose PART_VALUE columns are equal are one. Only rows where "key=text".
 */
struct report_table {
	const char *caption, *rows, *where;
	struct report_column columns[REPORT_COLUMNS];
};

struct report_picture {
	const char *part; /* pictures/WORD-PART.svg, "": pictures/WORD.svg */
	const char *caption, *instead;
};

struct report_section {
	const char *word, *title;
	const char *question, *method, *reference, *limits;
	const char *program; /* that has the word */
	struct report_picture pictures[5];
	struct report_table tables[6];
};

struct report_fact {
	int promise;
	const char *word, *what, *unit;
	const char *rows, *where;
	struct report_column column;
};

struct report_promise {
	const char *title, *text;
};

/* Each ends with {0}. */
extern const struct report_section report_sections[];
extern const struct report_fact report_facts[];
extern const struct report_promise report_promises[];

#endif
