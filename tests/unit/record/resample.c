// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/resample.c: the filter against what is said of it, rows against
 * signals that are put into a recording and known at any time.
 */
#include "recorded.h"
#include "../../../lib/record/resample.h"

static int record_once(void **state)
{
	if (enter_folder(state))
		return -1;
	record("known.rec", SHORT_SCRIPT, 3000 * MS);
	/* A slow and a fast sine of 500 codes each; a blade that goes and turns evenly. */
	change("known.rec/recording.db",
	       "UPDATE force SET code = round(2048 + 500 * sin(2 * pi() * 5 * seq / 1e4) + "
	       "500 * sin(2 * pi() * 170 * seq / 1e4));"
	       "DELETE FROM knots; DELETE FROM streams;"
	       "UPDATE tracker SET t_ns = (SELECT min(t_ns) FROM force) + seq * 8000000, "
	       "x_mm = seq * 0.8, y_mm = 1.5, z_mm = -seq * 0.08, "
	       "qw = cos(seq * 0.01), qx = 0.0, qy = sin(seq * 0.01), qz = 0.0;"
	       "UPDATE tracker SET status = 'k' WHERE seq = 60;"
	       "UPDATE tracker SET qw = -qw, qy = -qy WHERE seq % 2;"
	       "UPDATE depth SET t_ns = (SELECT min(t_ns) FROM force) + seq * 8000000, "
	       "depth_mm = seq * 0.08, velocity_mm_s = 100.0;");
	return 0;
}

/* Resample at a rate; the CSV's text, to be freed. */
static char *resample(double rate_hz)
{
	struct incise_recording *recording;
	struct incise_export_options how;
	struct incise_export_report report;
	struct incise_error err = {0};
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	incise_export_options_init(&how);
	how.resample = true;
	how.rate_hz = rate_hz;
	recording = incise_recording_open("known.rec", &err);
	if (!recording || incise_export_csv(&recording, 1, &how, out, &report, &err))
		fail_msg("%s", err.text);
	incise_recording_close(recording);
	fclose(out);
	return text;
}

struct row {
	double cut, t, x[3], q[4], depth, velocity, force, u, clipped, interpolated,
		error;
};

static bool next_row(char **rest, struct row *r)
{
	char *line = strsep(rest, "\n");

	return line && *line &&
	       sscanf(line,
		      "known,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,"
		      "%lf",
		      &r->cut, &r->t, &r->x[0], &r->x[1], &r->x[2], &r->q[0], &r->q[1],
		      &r->q[2], &r->q[3], &r->depth, &r->velocity, &r->force, &r->u,
		      &r->clipped, &r->interpolated, &r->error) == 16;
}

/* Gain at a frequency, in parts of the rate of rows, by the sum over a dense grid. */
static double gain(double frequency)
{
	double sum = 0, all = 0;

	for (int i = -8000; i <= 8000; i++) {
		double w = incise_resample_weight(i * 1e-3);

		sum += w * cos(2 * M_PI * frequency * i * 1e-3);
		all += w;
	}
	return sum / all;
}

static void the_filter_is_as_it_says(void **state)
{
	assert_true(fabs(gain(1 / 3.) - 0.5) < 1e-3);
	for (double f = 0; f < 0.15; f += 0.01)
		assert_true(fabs(gain(f) - 1) < 1e-3);
	for (double f = 0.5; f < 20; f += 0.0137)
		assert_true(fabs(gain(f)) < 1e-3);
	for (double x = 0; x < 9; x += 0.1)
		assert_true(incise_resample_weight(x) == incise_resample_weight(-x));
}

/* 170 Hz is above half of all rates at which it is filtered. */
static void rows_are_those_of_the_signals(void **state)
{
	static const struct {
		double rate;
		bool fast; /* goes through */
	} cases[] = {{100, false},  {130.7, false}, {2000, true},
		     {10000, true}, {25000, true},  {0, true}};
	double zero = ask("known.rec/recording.db",
			  "SELECT value FROM meta WHERE key = 'force_zero_mV'");

	for (size_t k = 0; k < sizeof(cases) / sizeof(*cases); k++) {
		double rate = cases[k].rate ? cases[k].rate : 1e4;
		char *text = resample(cases[k].rate), *rest = text;
		struct row r;
		int n = 0;

		strsep(&rest, "\n");
		for (; next_row(&rest, &r); n++) {
			double at = r.t / 0.008, code, norm = 0;
			int record = (int)at;

			assert_true(fabs(r.t - n / rate) < 1e-6);
			/* the ends have half a window, the tracker fewer records */
			if (r.t < 0.1 || r.t > 2.8)
				continue;
			code = 2048 + 500 * sin(2 * M_PI * 5 * r.t) +
			       (cases[k].fast ? 500 * sin(2 * M_PI * 170 * r.t) : 0);
			/* half a code of rounding, a thousandth of each sine, and of a
			 * line between samples (pi·170/1e4)²/2 of one */
			assert_true(fabs(r.force - (code * 5000 / 4096 - zero) / 1240) <
				    2.5 * 5000 / 4096 / 1240);
			assert_true(r.u > 0 && r.u < 0.1);
			/* four and six decimals */
			assert_true(fabs(r.x[0] - 0.8 * at) < 2e-4);
			assert_true(fabs(r.x[1] - 1.5) < 1e-4);
			assert_true(fabs(r.depth - 0.08 * at) < 2e-4);
			assert_true(fabs(r.velocity - 100) < 1e-3);
			assert_true(fabs(fabs(r.q[0]) - fabs(cos(0.01 * at))) < 2e-6);
			assert_true(fabs(fabs(r.q[2]) - fabs(sin(0.01 * at))) < 2e-6);
			for (int i = 0; i < 4; i++)
				norm += r.q[i] * r.q[i];
			assert_true(fabs(norm - 1) < 4e-6);
			assert_true(r.cut == (r.depth > 0.3));
			assert_true(!r.clipped && !r.interpolated);
			if (fabs(at - record - 0.5) < 0.49)
				assert_true(r.error == (record == 59 || record == 60));
		}
		assert_true(n > 2.9 * rate);
		free(text);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(the_filter_is_as_it_says),
		cmocka_unit_test(rows_are_those_of_the_signals),
	};

	return cmocka_run_group_tests(tests, record_once, leave_folder);
}
