/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Benchmarks of incise bench. Each is declared by a struct bench, a measurement and tables of
 * its rows; from these the shared code makes the JSON, the metrics and the plots.
 *
 *   run() ─▶ rows ─▶ bench_table ─┬─▶ JSON, metrics     (--json, compare, bench all)
 *                                 └─▶ data, bench_plot  (-o)
 *
 * Of the JSON tools/report makes the text without --json, and the report of incise bench all.
 */
#ifndef INCISE_BENCH_H
#define INCISE_BENCH_H

#include <jansson.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include "../cli/cli.h"
#include "metrics.h"

#define N(array) (int)(sizeof(array) / sizeof(*(array)))

/* --- declaration --- */

enum bench_type {
	BENCH_NUMBER, /* double; NaN: no value */
	BENCH_INT,
	BENCH_INT64,
	BENCH_UINT64,
	BENCH_BOOL,
	BENCH_TEXT,  /* const char *; NULL and "": no value */
	BENCH_CHARS, /* char[], the same */
	BENCH_JSON,  /* json_t *, borrowed; NULL: no value */
};

struct bench_column {
	const char *key; /* of the JSON, "a.b" leads inwards */
	size_t offset;
	enum bench_type type;
	double scale;  /* of the number; 0: 1 */
	bool optional; /* 0 is none */
	bool whole;    /* a whole number is an integer */
	bool data;     /* not in the JSON: for plots and metrics */
};

#define BENCH_MEMBER(row, member) \
	.offset = offsetof(struct row, member),              \
	.type = _Generic(((struct row *)NULL)->member,       \
			double: BENCH_NUMBER,                \
			int: BENCH_INT,                      \
			long: BENCH_INT64,                   \
			unsigned long: BENCH_UINT64,         \
			bool: BENCH_BOOL,                    \
			const char *: BENCH_TEXT,            \
			char *: BENCH_CHARS,                 \
			json_t *: BENCH_JSON)

/* COLUMN(row, "ns_p5", time.ns.p5) of struct row. */
#define COLUMN(row, key_, member, ...)                              \
	{                                                           \
		.key = key_, BENCH_MEMBER(row, member), __VA_ARGS__ \
	}

/* QUANTILES(row, "ns", time): the median, and the 5th and 95th percentile, of a harness_time. */
#define QUANTILES(row, key_, member)                                                \
	COLUMN(row, key_, member.ns.median), COLUMN(row, key_ "_p5", member.ns.p5), \
		COLUMN(row, key_ "_p95", member.ns.p95)

/* A metric of each row. Its name is a template of keys, "{name}, {drift_ppm:%+g} ppm". */
struct bench_metric {
	enum metric_kind kind;
	size_t offset; /* struct harness_time, struct harness_spread or double */
	const char *unit, *name;
	const char *where; /* rows with "KEY=TEXT,KEY!=TEXT|TEXT"; NULL: all */
};

#define METRIC(kind_, row, member, ...)                                         \
	{                                                                       \
		.kind = METRIC_##kind_, .offset = offsetof(struct row, member), \
		__VA_ARGS__                                                     \
	}

#define BENCH_COLUMNS 32
#define BENCH_METRICS 8

/* A column "failed" has the reason why a row failed. */
struct bench_table {
	const char *key; /* of the list in the JSON, "a.b" leads inwards; NULL: no list */
	size_t row_bytes;
	struct bench_column columns[BENCH_COLUMNS];
	struct bench_metric metrics[BENCH_METRICS];
};

/*
 * A plot: a script of tools/bench/plots. It finds
 *
 *   data, more         names of files: a line of keys, a line for each row
 *   NAME               each scalar of bench_values(); cpu and kernel
 */
struct bench_plot {
	const char *suffix; /* the plot is NAME-suffix; NULL: NAME */
	const char *script;
	int width, height;  /* px */
	const char *across; /* a panel of that width for each value of this key */
	const struct bench_table *data, *more;
};

/* Loads beside wake-ups; NULL at the end. */
extern const char *const bench_loads[];

/* As incise haptic asks for it, with the CPU; NULL where it is not granted. */
struct incise_realtime *bench_realtime(int cpu);

extern const char text_precision_gp[], text_stability_map_gp[];

struct bench_run;

struct bench {
	const char *name, *operands; /* "loop", "[SCENE]" */
	const char *summary;	     /* in --help */
	int n_operands;		     /* at most */
	bool takes_duration, takes_load, takes_seed;
	void (*run)(struct bench_run *run);
	struct bench_plot plot; /* without its script -o is bad usage */
};

extern const struct bench bench_loop, bench_precision, bench_realism, bench_scenes,
	bench_stability, bench_training;

/* Parts of bench_stability. */
void stability_rest(struct bench_run *run);
void stability_integrators(struct bench_run *run);

/* Its device: light, in a loop of 1 kHz. */
#define DEVICE_KG 0.05
#define PERIOD_S 1e-3

/* --- a run --- */

#define BENCH_TABLES 16 /* of a report */

struct bench_run {
	const struct bench *bench;
	bool json, quick;
	double seconds;			   /* 0: not given */
	long seed;			   /* the same */
	const char *plot, *load, *against; /* NULL: not given */
	char **operands;
	int n_operands;

	json_t *machine, *report, *metrics;
	char failed[600];
	const char *folder, *name; /* of the plot */
	struct bench_rows {
		const struct bench_table *table;
		const char *rows;
		int n;
	} rows[BENCH_TABLES];
	int n_rows;
};

/* Run the benchmark, print, compare and draw its report, and fail the program with the line that
 * bench_fail() was given. */
void bench_measure(struct bench_run *run);

/* Members of the JSON, an object of json_pack(). */
void bench_values(struct bench_run *run, const char *fmt, ...);

/* A member of the JSON; takes the value. */
void bench_value(struct bench_run *run, const char *key, json_t *value);

/* Report rows: as JSON and metrics, and for plots. The rows, and their texts and lists, live until
 * the end of the run. */
void bench_rows(struct bench_run *run, const struct bench_table *table, const void *rows,
		int n);

/* Time rows in turns: run() does so many units. The time is the table's first metric; failed
 * rows are left out. */
void bench_times(const struct bench_table *table, void *rows, int n,
		 void (*run)(void *row), double units, int turns);

/* After the report fail the program with this line; the first one counts. */
void bench_fail(struct bench_run *run, const char *fmt, ...) INCISE_PRINTF(2, 3);

/* Points of a plot that are no rows of the JSON. */
struct bench_point {
	char block[48];
	double x, y;
};
extern const struct bench_table bench_points;

#endif
