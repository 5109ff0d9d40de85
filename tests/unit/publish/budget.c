// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/publish/budget.c: the parts against draws of the calibrations' values from
 * their covariance, noise against the simulated rig's, and what is not stated.
 */
#include "../unit.h"
#include "../record/recorded.h"
#include <incise/budget.h>
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/publish/writers.h"

#define G_U 1.5 /* mV/N */
#define Z_U 2.0 /* mV */
#define GZ -2.1 /* mV²/N */
#define TIP_CONF                                                                     \
	"{ kind = \"tip\"; date = \"2026-11-20T10:00:00Z\"; pass = true; values = (" \
	"{ key = \"tip_x_mm\"; left = 1.0; u = 0.03; }, "                            \
	"{ key = \"tip_y_mm\"; left = -2.0; u = 0.02; }, "                           \
	"{ key = \"tip_z_mm\"; left = -50.0; u = 0.04; } ); "                        \
	"covariance = [ 9e-4, 3e-4, 4e-4, -2e-4, 1e-4, 16e-4 ]; }"

static const char conf[] =
	"force_mV_N = 1230.0; force_zero_mV = 182.0; tip_mm = [1.0, -2.0, -50.0]; "
	"surface_u_mm = 0.05; tracker_delay_ms = 4.0; tracker_delay_sd_ms = 0.1; "
	"force_delay_ms = 0.0; force_delay_sd_ms = 0.02; history = ( "
	"{ kind = \"force\"; date = \"2026-11-20T10:00:00Z\"; pass = true; values = ("
	"{ key = \"force_mV_N\"; left = 1230.0; u = 1.5; }, "
	"{ key = \"force_zero_mV\"; left = 182.0; u = 2.0; } ); "
	"covariance = [ 2.25, -2.1, 4.0 ]; }, " TIP_CONF
	", { kind = \"delay\"; date = \"2026-11-20T10:00:00Z\"; pass = true; "
	"method = \"least squares, against the force\"; values = ("
	"{ key = \"tracker_delay_ms\"; left = 4.0; u = 0.1; }, "
	"{ key = \"tracker_delay_sd_ms\"; left = 0.1; u = 0.0; } ); } );";

/* A recording by the calibration of a text; without one nominal. */
static void make(const char *path, const char *text)
{
	struct incise_rig *rig = open_rig("sim:clock=simulated,cut_s=2,pause_s=1");
	struct incise_recorder_setup setup = {.calibration_path = text ? "c.conf" : NULL};
	struct incise_calibration calibration;
	FILE *file;

	incise_calibration_nominal(&calibration);
	if (text) {
		file = fopen("c.conf", "w");
		fputs(text, file);
		fclose(file);
		succeeds(!incise_calibration_load("c.conf", &calibration, &err));
	}
	setup.calibration = &calibration;
	end_recorder(start_recorder_by(path, rig, setup), rig, 4000 * MS);
}

static struct incise_budget *budget_of(const char *path,
				       const struct incise_calibration *given,
				       const char *given_path)
{
	struct incise_recording *recording = incise_recording_open(path, &err);
	struct incise_budget *budget =
		recording ? incise_budget_new(recording, given, given_path, &err) : NULL;

	succeeds(budget);
	incise_recording_close(recording);
	return budget;
}

TEST(table_is_consistent)
{
	const struct incise_budget_part *parts = incise_budget_parts();
	const struct incise_budget_value *values = incise_budget_values();
	int n = 0;

	for (int q = 0; q < INCISE_BUDGET_QUANTITIES; q++) {
		assert_int_equal(values[q].first, n);
		for (int i = n; i < n + values[q].n; i++) {
			assert_int_equal(parts[i].quantity, q);
			assert_int_equal(parts[i].scope == INCISE_BUDGET_OWN,
					 parts[i].source == INCISE_BUDGET_NO_SOURCE);
			assert_non_null(strstr(parts[i].column, parts[i].name));
		}
		n += values[q].n;
	}
	assert_int_equal(n, INCISE_BUDGET_PARTS);
}

TEST(uncertainties_are_those_of_the_calibrations, IN_FOLDER)
{
	struct incise_budget *budget;

	make("a.rec", conf);
	budget = budget_of("a.rec", NULL, NULL);
	assert_true(incise_budget_u(budget, INCISE_BUDGET_GAIN) == G_U);
	assert_true(incise_budget_u(budget, INCISE_BUDGET_ZERO) == Z_U);
	assert_true(incise_budget_covariance(budget, INCISE_BUDGET_ZERO,
					     INCISE_BUDGET_GAIN) == GZ);
	assert_true(incise_budget_covariance(budget, INCISE_BUDGET_TIP_Z,
					     INCISE_BUDGET_TIP_X) == -2e-4);
	assert_true(incise_budget_u(budget, INCISE_BUDGET_SURFACE) == 0.05);
	assert_float_equal(incise_budget_u(budget, INCISE_BUDGET_ALIGNMENT), 1e-4, 1e-12);
	assert_float_equal(incise_budget_u(budget, INCISE_BUDGET_DELAY), 2e-5, 1e-12);
	assert_true(incise_budget_u(budget, INCISE_BUDGET_LINE) > 0);
	for (int q = 0; q < INCISE_BUDGET_QUANTITIES; q++)
		if (incise_budget_missing(budget, q))
			fail_msg("%s", incise_budget_missing(budget, q));
	incise_budget_free(budget);
}

/* Columns of rows in 8 attitudes: parts against 20000 draws; 4 sd of a drawn variance are 4 %. */
TEST(parts_are_the_spread_of_draws, IN_FOLDER)
{
	enum { ROWS = 8, DRAWS = 20000 };
	const double c[3][3] = {
		{9e-4, 3e-4, -2e-4}, {3e-4, 4e-4, 1e-4}, {-2e-4, 1e-4, 16e-4}};
	const uint64_t key = 7;
	double part[ROWS][INCISE_BUDGET_PARTS], sum[4][ROWS][ROWS] = {0};
	struct incise_budget_row row[ROWS];
	struct incise_budget *budget;

	make("a.rec", conf);
	budget = budget_of("a.rec", NULL, NULL);
	for (int i = 0; i < ROWS; i++) {
		row[i] = (struct incise_budget_row){
			.force_N = 0.5 * i,
			.depth_rate_mm_s = 10 * i - 30,
			.acceleration_mm_s2 = 100 - 40 * i,
			.direction = {1, 0, 0},
			.tip = {sin(i), cos(i) / 2, -cos(i)},
			.tip_1_s = {0.1 * i, 0.2, -0.1 * i},
			.force_share = 1,
		};
		incise_budget_row(budget, &row[i], part[i]);
	}
	for (int d = 0; d < DRAWS; d++) {
		double z[7], tip[3], e[4][ROWS];

		for (int k = 0; k < 7; k++)
			z[k] = incise_random_normal(key, (uint64_t)d * 7 + k);
		/* A factor of another form than the library's: upper, from the last one on. */
		tip[2] = sqrt(c[2][2]) * z[0];
		double b = c[1][2] / sqrt(c[2][2]), b1 = sqrt(c[1][1] - b * b);
		double a = c[0][2] / sqrt(c[2][2]), a1 = (c[0][1] - a * b) / b1;
		tip[1] = b * z[0] + b1 * z[1];
		tip[0] = a * z[0] + a1 * z[1] + sqrt(c[0][0] - a * a - a1 * a1) * z[2];
		double zero_mV = Z_U * z[3];
		double gain =
			GZ / Z_U * z[3] + sqrt(G_U * G_U - GZ * GZ / Z_U / Z_U) * z[4];
		double alignment_s = 1e-4 * z[5], surface_mm = 0.05 * z[6];

		for (int i = 0; i < ROWS; i++) {
			double mV = row[i].force_N * 1230 + 182;

			e[0][i] = (mV - 182 - zero_mV) / (1230 + gain) - row[i].force_N;
			e[1][i] = v3_dot(row[i].tip, tip) + surface_mm -
				  row[i].depth_rate_mm_s * alignment_s;
			e[2][i] = v3_dot(row[i].tip_1_s, tip) -
				  row[i].acceleration_mm_s2 * alignment_s;
		}
		for (int q = 0; q < 3; q++)
			for (int i = 0; i < ROWS; i++)
				for (int k = 0; k < ROWS; k++)
					sum[q][i][k] += e[q][i] * e[q][k] / DRAWS;
	}
	for (int q = 0; q < 3; q++) {
		const struct incise_budget_value *value = &incise_budget_values()[q];

		for (int i = 0; i < ROWS; i++)
			for (int k = 0; k < ROWS; k++) {
				double stated = 0;

				for (int p = value->first; p < value->first + value->n;
				     p++)
					if (incise_budget_parts()[p].scope !=
						    INCISE_BUDGET_OWN &&
					    strcmp(incise_budget_parts()[p].name,
						   "line") != 0)
						stated += part[i][p] * part[k][p];
				if (fabs(stated - sum[q][i][k]) >
				    0.04 * sqrt(sum[q][i][i] * sum[q][k][k]))
					fail_msg(
						"quantity %d, rows %d and %d: %g, drawn %g",
						q, i, k, stated, sum[q][i][k]);
			}
	}
	incise_budget_free(budget);
}

/* The rig's own: 3 mV and 0.02 mm; 5000 and 480 samples give them to 3 sd of 1 % and 5 %. */
TEST(noise_is_that_of_the_rig, IN_FOLDER)
{
	double part[INCISE_BUDGET_PARTS];
	struct incise_budget *budget;

	make("b.rec", NULL);
	budget = budget_of("b.rec", NULL, NULL);
	incise_budget_row(budget,
			  &(struct incise_budget_row){.force_share = 1,
						      .direction = {1, 0, 0}},
			  part);
	assert_float_equal(part[3], 3. / 1240, 0.03 * 3 / 1240);
	assert_float_equal(part[2], 5000. / 4096 / sqrt(12) / 1240, 1e-9);
	for (int i = 0; i < INCISE_BUDGET_PARTS; i++)
		if (!strcmp(incise_budget_parts()[i].column, "depth_u_noise_mm"))
			assert_float_equal(part[i], 0.02, 0.003);
	/* 5000 samples of 3 mV, and a code of 1.22 mV */
	assert_float_equal(incise_budget_u(budget, INCISE_BUDGET_ZERO),
			   hypot(3, 1.22 / sqrt(12)) / sqrt(5000), 0.005);
	incise_budget_free(budget);
}

TEST(not_stated_is_not_a_number, IN_FOLDER)
{
	const struct incise_budget_row row = {
		.force_N = 1, .force_share = 1, .direction = {1, 0, 0}};
	double part[INCISE_BUDGET_PARTS];
	struct incise_budget *budget;

	make("b.rec", NULL);
	budget = budget_of("b.rec", NULL, NULL);
	incise_budget_row(budget, &row, part);
	for (int q = 0; q < INCISE_BUDGET_QUANTITIES; q++) {
		assert_true(isnan(incise_budget_total(q, part)));
		assert_non_null(incise_budget_missing(budget, q));
	}
	assert_true(isnan(incise_budget_u(budget, INCISE_BUDGET_GAIN)));
	assert_non_null(strstr(incise_budget_missing(budget, INCISE_BUDGET_DEPTH),
			       "surface_u_mm"));
	incise_budget_free(budget);
}

/* A calibration for the export replaces those of force; a value that was changed by hand since
 * its calibration has none. */
TEST(given_calibration_replaces, IN_FOLDER)
{
	struct incise_calibration given;
	struct incise_budget *budget;

	make("b.rec", NULL);
	make("a.rec", conf);
	assert_int_equal(incise_calibration_load("c.conf", &given, NULL), 0);
	budget = budget_of("b.rec", &given, "c.conf");
	assert_true(incise_budget_u(budget, INCISE_BUDGET_GAIN) == G_U);
	assert_true(incise_budget_u(budget, INCISE_BUDGET_SURFACE) == 0.05);
	assert_true(isnan(incise_budget_u(budget, INCISE_BUDGET_TIP_X)));
	incise_budget_free(budget);
	budget = budget_of("b.rec", &given, NULL);
	assert_true(isnan(incise_budget_u(budget, INCISE_BUDGET_GAIN)));
	incise_budget_free(budget);
	given.force_mV_N = 1231;
	budget = budget_of("b.rec", &given, "c.conf");
	assert_true(isnan(incise_budget_u(budget, INCISE_BUDGET_GAIN)));
	incise_budget_free(budget);
}

/* 300 samples between records of the tracker 8.3 ms apart: parts of their mean. */
static void mean_of_rows(const struct incise_budget *budget,
			 double part[INCISE_BUDGET_PARTS])
{
	struct incise_budget_mean mean = {0};

	for (int i = 0; i < 300; i++) {
		const int64_t before_ns = i / 83 * 8300000LL;

		incise_budget_mean_add(
			&mean, budget, 0,
			(const int64_t[2]){before_ns, before_ns + 8300000},
			&(struct incise_budget_row){.force_N = 1,
						    .force_share = 1,
						    .direction = {1, 0, 0},
						    .share = (i % 83 + 0.5) / 83});
	}
	incise_budget_mean_parts(&mean, part);
}

/* Against 4000 draws of the records' noise, whose variance they give to 3 sd of 7 %. */
TEST(mean_of_depths_has_the_noise_of_its_records, IN_FOLDER)
{
	double one[INCISE_BUDGET_PARTS], part[INCISE_BUDGET_PARTS], drawn = 0;
	struct incise_budget *budget;
	const int noise = 10; /* depth_u_noise_mm */

	assert_string_equal(incise_budget_parts()[noise].column, "depth_u_noise_mm");
	make("b.rec", NULL);
	budget = budget_of("b.rec", NULL, NULL);
	incise_budget_row(budget,
			  &(struct incise_budget_row){.force_share = 1,
						      .direction = {1, 0, 0}},
			  one);
	mean_of_rows(budget, part);
	for (int d = 0; d < 4000; d++) {
		double sum = 0;

		for (int i = 0; i < 300; i++) {
			double s = (i % 83 + 0.5) / 83;
			uint64_t at = (uint64_t)d * 10 + i / 83;

			sum += (1 - s) * incise_random_normal(3, at) +
			       s * incise_random_normal(3, at + 1);
		}
		drawn += sum / 300 * sum / 300 / 4000;
	}
	assert_float_equal(part[noise], one[noise] * sqrt(drawn), 0.035 * part[noise]);
	/* white noise of the force */
	assert_float_equal(part[3], one[3] / sqrt(300), 0.1 * part[3]);
	incise_budget_free(budget);
}

/* Noise that is a sum over 8 samples counts an eighth of them; the window lasts 0.4 s, and gives
 * the correlation to some 15 %. */
TEST(mean_of_forces_counts_correlated_samples_as_fewer, IN_FOLDER)
{
	double one[INCISE_BUDGET_PARTS], part[INCISE_BUDGET_PARTS];
	struct incise_budget *budget;

	make("b.rec", NULL);
	change("b.rec/recording.db",
	       "CREATE TABLE white AS SELECT seq, (sin(seq * 12.9898) * 43758.5453) - "
	       "floor(sin(seq * 12.9898) * 43758.5453) AS x FROM force;"
	       "CREATE TABLE red AS SELECT seq, sum(x) OVER (ORDER BY seq ROWS 7 "
	       "PRECEDING) AS x FROM white; CREATE UNIQUE INDEX red_seq ON red (seq);"
	       "UPDATE force SET code = 100 + round(10 * (SELECT x FROM red WHERE "
	       "red.seq = force.seq)) WHERE seq < 5000;"
	       "UPDATE meta SET value = 10 * sqrt(8 / 12.0) * 5000 / 4096 WHERE key = "
	       "'force_zero_sd_mV'; DROP TABLE red; DROP TABLE white");
	budget = budget_of("b.rec", NULL, NULL);
	incise_budget_row(budget,
			  &(struct incise_budget_row){.force_share = 1,
						      .direction = {1, 0, 0}},
			  one);
	mean_of_rows(budget, part);
	assert_float_equal(part[3], one[3] * sqrt(8 / 300.), 0.15 * part[3]);
	/* and so does the zero */
	assert_float_equal(incise_budget_u(budget, INCISE_BUDGET_ZERO),
			   10 * sqrt(8 / 12.) * 5000 / 4096 * sqrt(8 / 5000.),
			   0.15 * incise_budget_u(budget, INCISE_BUDGET_ZERO));
	incise_budget_free(budget);
}
