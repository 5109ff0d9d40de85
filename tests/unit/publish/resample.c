// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/publish/resample.c: the filter against what is said of it, rows against
 * signals that are put into a recording and known at any time.
 */
#include "../unit.h"
#include "../record/recorded.h"
#include "../../../lib/publish/interpolators.h"
#include "../../../lib/publish/writers.h"

static int record_once(void **state)
{
	if (enter_folder(state))
		return -1;
	record("known.rec", SHORT_SCRIPT, 3000 * MS);
	/* A slow and a fast sine of 500 codes each; a blade that goes and turns evenly. */
	change("known.rec/recording.db",
	       "UPDATE force SET code = round(2048 + 500 * sin(2 * pi() * 5 * seq / 1e4) + "
	       "500 * sin(2 * pi() * 170 * seq / 1e4));"
	       "UPDATE tracker SET t_ns = (SELECT min(t_ns) FROM force) + seq * 8000000, "
	       "x_mm = seq * 0.8, y_mm = 1.5, z_mm = -seq * 0.08, "
	       "qw = cos(seq * 0.01), qx = 0.0, qy = sin(seq * 0.01), qz = 0.0;"
	       "DELETE FROM knots; DELETE FROM streams;"
	       "UPDATE tracker SET status = 'k' WHERE seq = 60;"
	       "UPDATE tracker SET button = seq >= 100;"
	       "UPDATE tracker SET qw = -qw, qy = -qy WHERE seq % 2;");
	return 0;
}

/* Resample at a rate, by another calibration or NULL; the CSV's text, to be freed. */
static char *resample(const char *path, double rate_hz,
		      const struct incise_calibration *calibration)
{
	struct incise_recording *recording;
	struct incise_export_options how;
	struct incise_export_report report;

	incise_export_options_init(&how);
	how.resample = true;
	how.rate_hz = rate_hz;
	how.calibration = calibration;
	recording = incise_recording_open(path, &err);
	succeeds(recording &&
		 !incise_export(&recording, 1, &how, "out.csv", &report, &err));
	incise_recording_close(recording);
	return text_of("out.csv");
}

struct row {
	double cut, t, x[3], x_u, q[4], station, button, depth, depth_u, velocity, force,
		u, clipped, interpolated, error, advancing, acceleration, tilt, time,
		mean_speed, deepest, camera[5];
};

/* Columns in the order of the struct, with the camera's or without. */
static bool next_row(char **rest, struct row *r)
{
	char *line = strsep(rest, "\n"), *end;
	double *to = &r->cut;

	if (!line || !*line)
		return false;
	for (line = strchr(line, ','); line && *line == ','; line = end)
		*to++ = strtod(line + 1, &end);
	return line && !*line && (to == r->camera || to == r->camera + 5);
}

/* Gain at a frequency, in parts of the rate of rows, by the sum over a dense grid. */
static double gain(double frequency)
{
	double sum = 0, all = 0;

	for (int i = -8000; i <= 8000; i++) {
		double w = incise_force_weight(i * 1e-3);

		sum += w * cos(2 * M_PI * frequency * i * 1e-3);
		all += w;
	}
	return sum / all;
}

TEST(the_filter_is_as_it_says)
{
	assert_true(fabs(gain(1 / 3.) - 0.5) < 1e-3);
	for (double f = 0; f < 0.15; f += 0.01)
		assert_true(fabs(gain(f) - 1) < 1e-3);
	for (double f = 0.5; f < 20; f += 0.0137)
		assert_true(fabs(gain(f)) < 1e-3);
	for (double x = 0; x < 9; x += 0.1)
		assert_true(incise_force_weight(x) == incise_force_weight(-x));
}

/* 170 Hz is above half of all rates at which it is filtered. */
TEST(rows_are_those_of_the_signals)
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
		char *text = resample("known.rec", cases[k].rate, NULL), *rest = text;
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
			/* with z's 10 mm/s; three decimals */
			assert_true(fabs(r.velocity - sqrt(10100)) < 1e-3);
			/* no noise in it, and nothing is known of times */
			assert_true(r.x_u == 0 && r.depth_u == 0);
			assert_true(r.station == 1 && r.button == (record >= 100));
			assert_true(fabs(fabs(r.q[0]) - fabs(cos(0.01 * at))) < 2e-6);
			assert_true(fabs(fabs(r.q[2]) - fabs(sin(0.01 * at))) < 2e-6);
			for (int i = 0; i < 4; i++)
				norm += r.q[i] * r.q[i];
			assert_true(fabs(norm - 1) < 4e-6);
			assert_true(r.cut == (r.depth > 0.3));
			assert_true(!r.clipped && !r.interpolated);
			/* always deeper, and along the skin */
			assert_true(r.advancing == 1);
			/* Even motion, once the filter that starts at rest has found it. */
			assert_true(at < 60 || fabs(r.acceleration) < 0.2);
			/* It turns by 0.02 rad a record, over and over; two decimals. */
			assert_true(fabs(r.tilt - acos(cos(0.02 * at)) * 180 / M_PI) <
				    2e-2);
			assert_true(fabs(r.time - 0.008 * at) < 2e-4);
			assert_true(fabs(r.mean_speed - r.velocity) < 1e-2);
			assert_true(r.deepest == r.depth);
			if (fabs(at - record - 0.5) < 0.49)
				assert_true(r.error == (record == 59 || record == 60));
		}
		assert_true(n > 2.9 * rate);
		free(text);
	}
}

static double at(const char *sql)
{
	return ask("camera.rec/recording.db", sql);
}

/*
 * Noise on the records, frames on a saw, times that are uncertain by 1 ms of the tracker's
 * and 2 ms of the camera's: what is said of each is what was put in.
 */
TEST(uncertainties_are_what_was_put_in)
{
	struct incise_calibration calibration;
	struct row r, other;
	char *text, *rest, *text2, *rest2;
	double x_u = 0, depth_u = 0, first;
	int n = 0, seen = 0;

	assert_int_equal(system("cp -r known.rec camera.rec"), 0);
	change("camera.rec/recording.db",
	       "DELETE FROM streams; INSERT INTO streams(name, device, stamped, delay_ns, "
	       "grain_ns, rows, lost, late, offset_sd_ns) VALUES"
	       "('tracker', 't', 0, 5000000, 0, 1, 0, 0, 1e6),"
	       "('camera', 'c', 1, 2000000, 0, 1, 0, 0, 2e6);"
	       /* ±0.05 in turn has second differences of 0.2: √(0.04/6) of noise */
	       "UPDATE tracker SET y_mm = 1.5 + (seq % 2) * 0.1;"
	       "UPDATE tracker SET z_mm = z_mm - (seq % 2) * 0.06;"
	       "INSERT INTO frames WITH RECURSIVE f(i) AS (SELECT 0 UNION ALL SELECT i + 1 "
	       "FROM f WHERE i < 250) SELECT i, (SELECT min(t_ns) FROM force) + i * "
	       "10000000, 0, 0, 1, 0, 100.0, 0.5, 0.2 * i, CASE WHEN i % 50 = 7 THEN 0.4 "
	       "ELSE 0.9 END, zeroblob(32) FROM f;"
	       "UPDATE frames SET depth_mm = NULL, sd_px = NULL WHERE seq IN (20, 21);"
	       "DELETE FROM frames WHERE seq BETWEEN 100 AND 105");
	incise_calibration_nominal(&calibration);
	text = rest = resample("camera.rec", 1000, NULL);
	first = at("SELECT value FROM meta WHERE key = 'depth_mm_px'");
	assert_non_null(strstr(
		strsep(&rest, "\n"),
		"tracker_error,advancing,acceleration_mm_s2,tilt_deg,"
		"time_in_tissue_s,mean_speed_mm_s,deepest_mm,camera_depth_mm,camera_depth_sd_mm,"
		"camera_depth_u_mm,quality,low_quality"));
	for (int i = 0; next_row(&rest, &r); i++) {
		int frame = i / 10;
		double share = i % 10 / 10.0, line = hypot(share, 1 - share);
		bool low = frame % 50 == 7 || frame % 50 == 6;

		if (i < 200 || i >= 2500)
			continue;
		if (frame >= 19 && frame <= 21) {
			assert_true(isnan(r.camera[0]) && isnan(r.camera[3]));
			assert_true(r.camera[4] == 1);
		} else if (frame >= 99 && frame < 106) {
			assert_true(isnan(r.camera[0]) && r.camera[4] == 1);
		} else {
			double sd = 0.5 * first * line;

			assert_true(fabs(r.camera[0] - 0.02 * i) < 1e-4);
			assert_true(fabs(r.camera[1] - sd) < 1e-4);
			assert_true(fabs(r.camera[2] - hypot(sd, 20 * 2e-3)) < 1e-4);
			assert_true(r.camera[3] <= 0.9 && r.camera[3] >= 0.4);
			assert_true(r.camera[4] == low);
			seen++;
		}
		/* at a record (each 8 ms): its own noise; 100 mm/s for 1 ms */
		if (i % 8 == 0 && i < 2400) {
			x_u += r.x_u;
			depth_u += r.depth_u;
			n++;
		}
	}
	assert_true(seen > 2000 && n > 200);
	/* two axes of three have it: 0.2²/18 and 0.12²/18; and the way, which the noise itself
	 * makes longer: up to √(0.8² + 0.14² + 0.1²)/8 ms */
	assert_true(fabs(x_u / n - hypot(hypot(0.2, 0.12) / sqrt(18), 0.1)) < 2e-3);
	/* 0.12 of second differences; 10 mm/s, and in turn 7.5 more and less */
	assert_true(fabs(depth_u / n - hypot(0.12 / sqrt(6), 0.01)) < 2e-3);

	/* Another calibration: twice the depth, and later by 3 ms less of a delay. */
	calibration.depth_mm_px = 2 * first;
	calibration.camera_delay_ms = -1;
	calibration.tracker_delay_ms = 9;
	text2 = rest2 = resample("camera.rec", 1000, &calibration);
	strsep(&rest2, "\n");
	for (int i = 0; next_row(&rest2, &other); i++)
		if (i > 1200 && i < 2400) {
			assert_true(fabs(other.camera[0] - 2 * 0.02 * (i - 3)) < 1e-4);
			/* x goes on by 0.1 mm each ms, and was there 4 ms before */
			assert_true(fabs(other.x[0] - 0.1 * (i + 4)) < 2e-4);
		}
	free(text);
	free(text2);
}

TEST(damage_is_told)
{
	static const struct {
		const char *sql, *message;
	} cases[] = {
		{"UPDATE force SET t_ns = 2305843009213693951 WHERE seq = (SELECT max(seq) "
		 "FROM force)",
		 "force"},
		{"UPDATE force SET code = 4096 WHERE seq = 900", "table force, row 900"},
		{"DELETE FROM tracker WHERE seq = 70", "359 rows"},
		{"UPDATE tracker SET x_mm = 9e999 WHERE seq = 70",
		 "stream tracker, block"},
		{"UPDATE tracker SET t_ns = 5 WHERE seq = 70", "row 70"},
		{"INSERT INTO frames VALUES(0, 1, 1, 0, 1, 0, 1.0, 1.0, 9e999, 1.0, zeroblob(32))",
		 "stream camera, block 0"},
		{"INSERT INTO frames VALUES(0, 5, 1, 0, 1, 0, 1.0, 1.0, 1.0, 1.0, zeroblob(32)), "
		 "(1, 5, 1, 0, 1, 0, 1.0, 1.0, 1.0, 1.0, zeroblob(32))",
		 "table frames, row 1"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_export_options how = {.resample = true, .rate_hz = 100};
		struct incise_recording *recording;

		assert_int_equal(system("rm -rf hurt.rec; cp -r known.rec hurt.rec"), 0);
		change("hurt.rec/recording.db", cases[i].sql);
		recording = incise_recording_open("hurt.rec", &err);
		assert_non_null(recording);
		assert_error(incise_export(&recording, 1, &how, "/dev/null", NULL, &err),
			     EINVAL, &err, cases[i].message);
		/* Nobody need want the message. */
		assert_int_equal(incise_export(&recording, 1, &how, "/dev/null", NULL,
					       NULL),
				 -EINVAL);
		incise_recording_close(recording);
	}
}

GROUP(record_once, leave_folder);
