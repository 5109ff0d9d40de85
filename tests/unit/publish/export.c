// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/publish/export.c: against the same done by brute force from the tables,
 * all in memory, with nothing of the library.
 */
#include "../cases.h"
#include "../unit.h"
#include "../record/recorded.h"
#include <locale.h>
#include <sys/resource.h>

#define DEPTH_BINS 12
#define VELOCITY_BINS 10
#define BINS (DEPTH_BINS * VELOCITY_BINS)
#define CUTS_MAX 40

/* --- by brute force ------------------------------------------------------------------ */

struct truth {
	int n; /* samples inside cuts */
	struct truth_sample {
		int cut;
		double t_s, depth, velocity, force;
		bool clipped;
		bool advancing; /* as exported: tests/unit/signal/progress.c has the rule */
	} * samples;
	int cuts;
	double depth_max, velocity_max; /* where it advances */
};

struct row {
	double t, a, b;
};

static struct row *table(const char *file, const char *sql, int *n)
{
	struct row *rows = NULL;
	sqlite3_stmt *stmt;
	sqlite3 *db;

	*n = 0;
	db = rows_look(file);
	assert_int_equal(sqlite3_prepare_v2(db, sql, -1, &stmt, NULL), SQLITE_OK);
	while (sqlite3_step(stmt) == SQLITE_ROW) {
		if ((*n & (*n - 1)) ==
		    0) /* at each power of two: room for as many again */
			rows = realloc(rows, (*n ? 2 * *n : 1) * sizeof(*rows));
		rows[(*n)++] = (struct row){sqlite3_column_int64(stmt, 0),
					    sqlite3_column_double(stmt, 1),
					    sqlite3_column_double(stmt, 2)};
	}
	sqlite3_finalize(stmt);
	sqlite3_close(db);
	return rows;
}

static struct truth brute_force(const char *file)
{
	struct truth truth = {0};
	int n_force, n_depth, k = 0;
	struct row *force =
		table(file, "SELECT t_ns, code, 0 FROM force ORDER BY t_ns", &n_force);
	struct row *depth = table(
		file,
		/* on the tracker's line, which here starts but once */
		"SELECT (SELECT a.t_ns + CAST((depth.seq - a.seq) * ((b.t_ns - "
		"a.t_ns) * 1.0 / (b.seq - a.seq)) AS INTEGER) FROM knots a, knots b "
		"WHERE a.stream = 'tracker' AND b.stream = 'tracker' AND b.knot = "
		"a.knot + 1 AND (a.seq <= depth.seq OR a.knot = 0) ORDER BY a.knot "
		"DESC LIMIT 1), depth_mm, velocity_mm_s FROM depth ORDER BY seq",
		&n_depth);
	double zero = ask(file, "SELECT value FROM meta WHERE key = 'force_zero_mV'");
	bool inside = false;

	truth.samples = calloc(n_force, sizeof(*truth.samples));
	for (int i = 0; i < n_force; i++) {
		struct truth_sample *s = &truth.samples[truth.n];
		double share;

		while (k < n_depth && depth[k].t <= force[i].t)
			k++;
		if (k == 0 || k == n_depth || depth[k].t - depth[k - 1].t > 50e6)
			continue;
		share = (force[i].t - depth[k - 1].t) / (depth[k].t - depth[k - 1].t);
		s->depth = depth[k - 1].a + share * (depth[k].a - depth[k - 1].a);
		s->velocity = depth[k - 1].b + share * (depth[k].b - depth[k - 1].b);
		if (!inside && s->depth > 0.3)
			truth.cuts++, inside = true;
		else if (inside && s->depth < 0.1)
			inside = false;
		if (!inside)
			continue;
		s->cut = truth.cuts;
		s->t_s = (force[i].t - force[0].t) / 1e9;
		s->clipped = force[i].a == 0 || force[i].a == 4095;
		s->force = (force[i].a * 5000 / 4096 - zero) / 1240;
		truth.n++;
	}
	free(force);
	free(depth);
	return truth;
}

/* --- what is exported ------------------------------------------------------------------ */

/* One recording of the short script for all tests, and its truth. */
static struct truth truth;

#define INPUTS "acceleration_mm_s2,tilt_deg,time_in_tissue_s,mean_speed_mm_s,deepest_mm"

static void read_advancing(void);

static int record_once(void **state)
{
	if (enter_folder(state))
		return -1;
	record("liver.rec", SHORT_SCRIPT, 0);
	if (ask("liver.rec/recording.db", "SELECT sum(begins) FROM knots WHERE stream = "
					  "'tracker'") != 1)
		return -1;
	truth = brute_force("liver.rec/recording.db");
	read_advancing();
	return 0;
}

static int forget(void **state)
{
	free(truth.samples);
	return leave_folder(state);
}

/* Export some recordings; the text, to be freed, or NULL with err. */
static char *export(const char *const *paths, int n,
		    const struct incise_export_options *how,
		    struct incise_export_report *report, struct incise_error *err)
{
	struct incise_recording *recordings[4] = {0};
	int rc;

	for (int i = 0; i < n; i++) {
		recordings[i] = incise_recording_open(paths[i], err);
		if (!recordings[i])
			fail_msg("%s", err->text);
	}
	rc = incise_export(recordings, n, how, "out.csv", report, err);
	assert_int_equal(-rc, rc ? err->code : 0);
	for (int i = 0; i < n; i++)
		incise_recording_close(recordings[i]);
	return rc ? NULL : text_of("out.csv");
}

static char *export_liver(const struct incise_export_options *how,
			  struct incise_export_report *report)
{
	const char *path = "liver.rec";
	char *text = export(&path, 1, how, report, &err);

	succeeds(text);
	return text;
}

/* Take the line of a text. */
static char *next_line(char **text)
{
	return strsep(text, "\n");
}

/* The column of a line, from 0. */
static const char *column(const char *line, int n)
{
	while (n--)
		line = strchr(line, ',') + 1;
	return line;
}

/* The column `advancing` of all samples, and the largest values there. */
static void read_advancing(void)
{
	struct incise_export_options how;
	struct incise_export_report report;
	char *text, *rest, *line;
	int advancing = 0;

	incise_export_options_init(&how);
	text = rest = export_liver(&how, &report);
	next_line(&rest);
	for (int n = 0; *(line = next_line(&rest)); n++) {
		struct truth_sample *s = &truth.samples[n];

		assert_true(n < truth.n);
		s->advancing = *column(line, 6) == '1';
		advancing += s->advancing;
		if (!s->advancing || s->clipped)
			continue;
		truth.depth_max = fmax(truth.depth_max, s->depth);
		truth.velocity_max = fmax(truth.velocity_max, s->velocity);
	}
	/* The surgeon is on the way out for a fifth of the way. */
	assert_true(advancing > truth.n / 2 && advancing < truth.n * 19 / 20);
	free(text);
}

/* Printed with nine digits; sums of 1e5 doubles differ in the last few of sixteen. */
static bool near(double a, double b)
{
	return fabs(a - b) <= 1e-8 * fabs(b) + 1e-12;
}

/* --- averages --------------------------------------------------------------------------- */

struct mean {
	long double n, depth, velocity, force, force2;
	bool cuts[CUTS_MAX];
};

/* Bins of one cut, or of all (cut 0), as two plain loops. */
static void average(struct mean bins[2 * BINS], int cut, double depth_max,
		    double velocity_max)
{
	memset(bins, 0, 2 * BINS * sizeof(*bins));
	for (int pass = 0; pass < 2; pass++) {
		for (int i = 0; i < truth.n; i++) {
			const struct truth_sample *s = &truth.samples[i];
			int d = s->depth / depth_max * DEPTH_BINS;
			int v = s->velocity / velocity_max * VELOCITY_BINS;
			struct mean *bin;

			if (s->clipped || (cut && s->cut != cut) ||
			    s->depth > depth_max || s->velocity > velocity_max)
				continue;
			d = d < DEPTH_BINS ? d : DEPTH_BINS - 1;
			v = v < VELOCITY_BINS ? v : VELOCITY_BINS - 1;
			bin = &bins[2 * (d * VELOCITY_BINS + v) + s->advancing];
			if (pass) {
				bin->force2 += powl(s->force - bin->force / bin->n, 2);
				continue;
			}
			bin->n++;
			bin->depth += s->depth;
			bin->velocity += s->velocity;
			bin->force += s->force;
			bin->cuts[s->cut] = true;
		}
	}
}

/* Compare the lines of one average with the bins that hold enough. Returns how many. */
static int compare(char **text, const struct mean bins[2 * BINS], int min_count,
		   const char *name)
{
	int rows = 0;

	for (int i = 0; i < 2 * BINS; i++) {
		double depth, velocity, force, sd;
		int count, cuts, advancing, expected = 0;
		char *line;

		if (bins[i].n < min_count || bins[i].n == 0)
			continue;
		line = next_line(text);
		assert_non_null(line);
		if (name) {
			assert_int_equal(strncmp(line, name, strlen(name)), 0);
			line += strlen(name);
		}
		assert_int_equal(sscanf(line, "%lf,%lf,%lf,%lf,%d,%d,%d", &depth,
					&velocity, &force, &sd, &count, &cuts,
					&advancing),
				 7);
		assert_int_equal(advancing, i & 1);
		for (int k = 0; k < CUTS_MAX; k++)
			expected += bins[i].cuts[k];
		assert_int_equal(count, (int)bins[i].n);
		assert_int_equal(cuts, expected);
		assert_true(near(depth, bins[i].depth / bins[i].n));
		assert_true(near(velocity, bins[i].velocity / bins[i].n));
		assert_true(near(force, bins[i].force / bins[i].n));
		assert_true(near(
			sd, bins[i].n > 1 ? sqrtl(bins[i].force2 / (bins[i].n - 1)) : 0));
		rows++;
	}
	return rows;
}

TEST(averages_are_those_of_brute_force)
{
	static const struct {
		double depth_max, velocity_max;
		int min_count;
	} cases[] = {
		{0, 0, 50},  {0, 0, 1},	      {0, 0, 0},    {15, 0, 50},
		{0, 40, 50}, {10.5, 33.3, 7}, {25, 60, 50},
	};

	assert_int_equal(truth.cuts, 14);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_export_options how;
		struct incise_export_report report;
		struct mean bins[2 * BINS];
		char *text, *rest;
		double depth_max =
			cases[i].depth_max ? cases[i].depth_max : truth.depth_max;
		double velocity_max = cases[i].velocity_max ? cases[i].velocity_max
							    : truth.velocity_max;

		incise_export_options_init(&how);
		assert_int_equal(how.min_count, 50);
		how.depth_bins = DEPTH_BINS;
		how.velocity_bins = VELOCITY_BINS;
		how.depth_max_mm = cases[i].depth_max;
		how.velocity_max_mm_s = cases[i].velocity_max;
		how.min_count = cases[i].min_count;
		text = rest = export_liver(&how, &report);
		average(bins, 0, depth_max, velocity_max);
		assert_string_equal(
			next_line(&rest),
			"depth_mm,velocity_mm_s,force_N,sd_N,count,cuts,advancing," INPUTS);
		assert_int_equal(report.rows, compare(&rest, bins, how.min_count, NULL));
		assert_string_equal(rest, ""); /* not a line more */
		assert_int_equal(report.cuts, 14);
		assert_int_equal(report.clipped, 0);
		/* the same interpolation, so the same double but for a rounding */
		assert_true(near(report.depth_max_mm, depth_max));
		assert_true(near(report.velocity_max_mm_s, velocity_max));
		free(text);
	}
}

/* The rows of a part are those of the whole, to the last digit, with the numbers of their cuts. */
TEST(a_part_is_that_of_the_whole)
{
	const char *path = "liver.rec";
	struct incise_export_options how;
	char *whole;

	incise_export_options_init(&how);
	whole = export(&path, 1, &how, NULL, &err);
	assert_non_null(whole);
	for (int i = 0; i < 40; i += cases_are_all() ? 1 : 3) {
		const double from = 1.1 * i, to = from + (i % 2 ? 0.9 : 7.3);
		char *text, *part, *rest, *line, *copy;
		struct incise_error none = {0};
		int rows = 0;

		/* the last one is behind all 14 */
		how.cut = i >= 34 ? 3 * (i - 34) + 1 : 0;
		how.from_s = how.cut ? 0 : from;
		how.to_s = how.cut ? 0 : to;
		text = part = export(&path, 1, &how, NULL, &none);
		copy = rest = strdup(whole);
		line = strsep(&rest, "\n");
		if (text)
			assert_string_equal(strsep(&part, "\n"), line);
		while ((line = strsep(&rest, "\n")) && *line) {
			double t_s = atof(strchr(line, ',') + 1);
			int cut = atoi(strchr(line, '-') + 1);

			if (how.cut ? cut != how.cut
				    : t_s < from - 1e-7 || t_s >= to - 1e-7)
				continue;
			assert_non_null(text);
			assert_string_equal(line, strsep(&part, "\n"));
			rows++;
		}
		if (text)
			assert_string_equal(part, "");
		else
			assert_int_equal(none.code, ENODATA);
		if (!text != !rows)
			fail_msg("part %d: %d rows", i, rows);
		free(text);
		free(copy);
	}
	free(whole);
}

TEST(averages_by_cut)
{
	struct incise_export_options how = {.depth_bins = DEPTH_BINS,
					    .velocity_bins = VELOCITY_BINS,
					    .by_cut = true,
					    .min_count = 20};
	struct incise_export_report report;
	char *text, *rest;
	uint64_t rows = 0;

	text = rest = export_liver(&how, &report);
	assert_string_equal(
		next_line(&rest),
		"cut,depth_mm,velocity_mm_s,force_N,sd_N,count,cuts,advancing," INPUTS);
	for (int cut = 1; cut <= truth.cuts; cut++) {
		struct mean bins[2 * BINS];
		char name[20];

		snprintf(name, sizeof(name), "liver-%02d,", cut);
		average(bins, cut, truth.depth_max, truth.velocity_max);
		rows += compare(&rest, bins, 20, name);
	}
	assert_int_equal(report.rows, rows);
	assert_string_equal(rest, "");
	free(text);
}

TEST(clipped_samples_are_left_out)
{
	struct incise_export_options how = {.depth_bins = 4, .velocity_bins = 4};
	struct incise_export_report report;
	const char *path = "clipped.rec";
	char *text, *line, *rest;
	uint64_t clipped = 0, flagged = 0;
	double force;

	/* At 3.3 times the sensitivity the converter ends at 1.2 N. */
	record(path, "sim:clock=simulated,cut_s=1,pause_s=0.6,force_mV_N=4000", 0);
	for (int pass = 0; pass < 2; pass++) {
		how.depth_bins = how.velocity_bins = pass ? 0 : 4;
		text = rest = export(&path, 1, &how, &report, &err);
		assert_non_null(text);
		next_line(&rest);
		if (!pass) {
			clipped = report.clipped;
			/* Nothing at the end of the range takes part: (4095 LSB - zero)/1240 */
			while (*(line = next_line(&rest))) {
				assert_int_equal(sscanf(line, "%*f,%*f,%lf", &force), 1);
				assert_true(force < (5000 - 180) / 1240.0);
			}
		}
		while (pass && *(line = next_line(&rest)))
			flagged += *column(line, 5) == '1';
		free(text);
	}
	assert_true(clipped > 1000);
	assert_int_equal(clipped, flagged);
	assert_int_equal(clipped, report.clipped);
	change("clipped.rec/recording.db", "UPDATE force SET code = 4095");
	how.depth_bins = how.velocity_bins = 4;
	assert_null(export(&path, 1, &how, &report, &err));
	assert_int_equal(err.code, ENODATA);
}

/* --- raw ---------------------------------------------------------------------------------- */

TEST(raw_rows_are_the_samples)
{
	struct incise_export_options how;
	struct incise_export_report report;
	char *text, *rest, *line;
	double deepest = 0, way;
	int n = 0, before = 0;

	incise_export_options_init(&how);
	text = rest = export_liver(&how, &report);
	assert_string_equal(
		next_line(&rest),
		"cut,t_s,depth_mm,velocity_mm_s,force_N,clipped,advancing," INPUTS
		",way_mm");
	for (; *(line = next_line(&rest)); n++) {
		const struct truth_sample *s = &truth.samples[n];
		double t, depth, velocity, force;
		int cut, clipped;

		assert_true(n < truth.n);
		assert_int_equal(sscanf(line, "liver-%d,%lf,%lf,%lf,%lf,%d", &cut, &t,
					&depth, &velocity, &force, &clipped),
				 6);
		assert_int_equal(cut, s->cut);
		assert_int_equal(clipped, s->clipped);
		/* half of the last printed digit each, and the rounding of the text */
		assert_true(fabs(t - s->t_s) < 0.51e-6);
		assert_true(fabs(depth - s->depth) < 0.51e-4);
		assert_true(fabs(velocity - s->velocity) < 0.51e-3);
		assert_true(fabs(force - s->force) < 0.51e-5);
		/* It never falls in a cut, and each depth is a way. */
		way = strtod(strrchr(line, ',') + 1, NULL);
		assert_true(way > depth - 1.1e-4);
		assert_true(cut != before || way >= deepest);
		deepest = way;
		before = cut;
	}
	assert_int_equal(n, truth.n);
	assert_int_equal(report.rows, truth.n);
	assert_int_equal(report.cuts, truth.cuts);
	free(text);
}

TEST(raw_rows_at_a_rate)
{
	static const double rates[] = {1, 50, 120, 1000, 3333, 20000};

	for (size_t r = 0; r < sizeof(rates) / sizeof(*rates); r++) {
		struct incise_export_options how = {.rate_hz = rates[r]};
		struct incise_export_report report;
		char *text, *rest, *line;
		uint64_t rows = 0;

		text = rest = export_liver(&how, &report);
		next_line(&rest);
		for (int i = 0; i < truth.n; rows++) {
			const struct truth_sample *first = &truth.samples[i];
			/* Slots of whole ns: no time lies on an edge by rounding alone. */
			long slot = floor((first->t_s + 0.5e-9) * rates[r]);
			double t = 0, depth = 0, velocity = 0, force = 0, got[4];
			int n = 0, cut, advancing, all = 1;

			for (; i < truth.n && truth.samples[i].cut == first->cut &&
			       (long)floor((truth.samples[i].t_s + 0.5e-9) * rates[r]) ==
				       slot;
			     i++, n++) {
				t += truth.samples[i].t_s;
				depth += truth.samples[i].depth;
				velocity += truth.samples[i].velocity;
				force += truth.samples[i].force;
				all &= truth.samples[i].advancing;
			}
			line = next_line(&rest);
			assert_int_equal(sscanf(line, "liver-%d,%lf,%lf,%lf,%lf,0,%d",
						&cut, &got[0], &got[1], &got[2], &got[3],
						&advancing),
					 6);
			assert_int_equal(advancing, all);
			assert_int_equal(cut, first->cut);
			assert_true(fabs(got[0] - t / n) < 0.51e-6);
			assert_true(fabs(got[1] - depth / n) < 0.51e-4);
			assert_true(fabs(got[2] - velocity / n) < 0.51e-3);
			assert_true(fabs(got[3] - force / n) < 0.51e-5);
		}
		assert_string_equal(rest, "");
		assert_int_equal(report.rows, rows);
		free(text);
	}
}

/* --- several recordings, names, faults ------------------------------------------------------ */

TEST(recordings_are_pooled_and_kept_apart)
{
	const char *paths[] = {"liver.rec", "b/liver.rec", "a \"b\", c.rec"};
	struct incise_export_options how = {.depth_bins = 2, .velocity_bins = 1};
	struct incise_export_report one, three;
	char *text;

	assert_int_equal(system("mkdir -p b; cp -r liver.rec b; "
				"cp -r liver.rec 'a \"b\", c.rec'"),
			 0);
	free(export(paths, 1, &how, &one, &err));
	text = export(paths, 3, &how, &three, &err);
	assert_non_null(text);
	assert_int_equal(three.cuts, 3 * one.cuts);
	assert_int_equal(three.rows, one.rows);
	free(text);
	how.by_cut = true;
	text = export(paths, 3, &how, &three, &err);
	assert_non_null(text);
	assert_non_null(strstr(text, "\nliver-01,"));
	assert_non_null(strstr(text, "\nliver~2-01,"));
	assert_non_null(strstr(text, "\n\"a \"\"b\"\", c-14\","));
	free(text);
}

TEST(nothing_to_export)
{
	const char *air[] = {"air.rec"};
	struct incise_export_options how;

	incise_export_options_init(&how);
	record("air.rec", "sim:clock=simulated", 800 * MS);
	for (int bins = 0; bins < 2; bins++) {
		how.depth_bins = how.velocity_bins = bins;
		assert_error(export(air, 1, &how, NULL, &err), ENODATA, &err, "air.rec:");
	}
	how.min_count = 100000000;
	assert_error(export((const char *[]){"liver.rec"}, 1, &how, NULL, &err), ENODATA,
		     &err, "bin");

	change("air.rec/recording.db",
	       "UPDATE meta SET value = NULL WHERE key = 'force_zero_mV'");
	assert_error(export(air, 1, &how, NULL, &err), EINVAL, &err, "zero");
}

TEST(damage_stops_the_export)
{
	const char *path = "hurt.rec";
	struct incise_export_options how;

	assert_int_equal(system("cp -r liver.rec hurt.rec"), 0);
	change("hurt.rec/recording.db",
	       "UPDATE tracker SET z_mm = 9e999 WHERE seq = 4000");
	incise_export_options_init(&how);
	assert_error(export(&path, 1, &how, NULL, &err), EINVAL, &err, "stream tracker",
		     "block");
}

TEST(options_out_of_range)
{
	static const struct incise_export_options cases[] = {
		{.rate_hz = -1},
		{.rate_hz = NAN},
		{.rate_hz = INFINITY},
		{.depth_bins = -1, .velocity_bins = 3},
		{.depth_bins = 3},
		{.velocity_bins = 3},
		{.depth_bins = 1 << 30, .velocity_bins = 1 << 30},
		{.depth_bins = 2, .velocity_bins = 2, .depth_max_mm = -1},
		{.depth_bins = 2, .velocity_bins = 2, .depth_max_mm = NAN},
		{.depth_bins = 2, .velocity_bins = 2, .velocity_max_mm_s = INFINITY},
		{.depth_bins = 2, .velocity_bins = 2, .min_count = -1},
	};
	const char *path = "liver.rec";

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};

		assert_null(export(&path, 1, &cases[i], NULL, &err));
		assert_int_equal(err.code, EINVAL);
	}
	assert_int_equal(incise_export(NULL, 0, &(struct incise_export_options){0},
				       "none.csv", NULL, NULL),
			 -EINVAL);
}

TEST(full_disk_is_told)
{
	struct incise_recording *recording = incise_recording_open("liver.rec", &err);
	struct incise_export_options how;

	incise_export_options_init(&how);
	assert_int_equal(incise_export(&recording, 1, &how, "/dev/full", NULL, &err),
			 -ENOSPC);
	how.depth_bins = how.velocity_bins = 2;
	assert_int_equal(incise_export(&recording, 1, &how, "/dev/full", NULL, &err),
			 -ENOSPC);
	incise_recording_close(recording);
}

TEST(commas_of_a_locale_stay_out)
{
	struct incise_export_options how = {.depth_bins = 2, .velocity_bins = 2};
	char *plain = export_liver(&how, NULL), *other;

	if (!setlocale(LC_NUMERIC, "de_DE.UTF-8")) {
		free(plain);
		print_message("skipped: no locale de_DE.UTF-8\n");
		skip();
	}
	other = export_liver(&how, NULL);
	setlocale(LC_NUMERIC, "C");
	assert_string_equal(plain, other);
	free(plain);
	free(other);
}

GROUP(record_once, forget);
