// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/base/calibration.c: the paper's figures; what is appended is read back the same, what
 * failed is not in force, what is damaged is refused; the text of a file, to the letter.
 */
#include "../unit.h"
#include <locale.h>
#include <signal.h>
#include <sys/wait.h>
#include <incise/calibration.h>
#include "../../../lib/base/calibration.c"
#include "temp_file.h"

TEST(nominal_is_the_papers)
{
	struct incise_calibration c = {0};

	incise_calibration_nominal(&c);
	assert_true(c.force_mV_N == 1240);
	assert_true(isnan(c.force_zero_mV));
	assert_true(c.depth_mm_px == 0.11875); /* 47.5 mm over 400 px */
	assert_true(isnan(c.force_delay_ms) && isnan(c.tracker_delay_ms) &&
		    isnan(c.camera_delay_ms) && isnan(c.tracker_delay_sd_ms));
}

TEST(absent_keys_are_nominal)
{
	struct temp_file file =
		temp_file_new("calibration.conf", "force_zero_mV = 175.5;\n");
	struct incise_calibration c = {.force_mV_N = 1, .force_zero_mV = 2};

	assert_int_equal(incise_calibration_load(file.path, &c, NULL), 0);
	assert_true(c.force_mV_N == 1240 && c.force_zero_mV == 175.5);
	assert_true(c.depth_mm_px == 0.11875);
	temp_file_free(&file);
}

TEST(all_keys_are_read)
{
	struct temp_file file = temp_file_new(
		"calibration.conf",
		"force_mV_N = 1238.5;\nforce_zero_mV = -12;\ndepth_mm_px = 0.12;\n"
		"force_delay_ms = 0.1;\nforce_delay_sd_ms = 0.01;\n"
		"tracker_delay_ms = 8.5;\ntracker_delay_sd_ms = 0.2;\n"
		"camera_delay_ms = -3.5;\ncamera_delay_sd_ms = 0.5;\n");
	struct incise_calibration c = {0};

	assert_int_equal(incise_calibration_load(file.path, &c, NULL), 0);
	assert_true(c.force_mV_N == 1238.5 && c.force_zero_mV == -12 &&
		    c.depth_mm_px == 0.12);
	assert_true(c.force_delay_ms == 0.1 && c.force_delay_sd_ms == 0.01);
	assert_true(c.tracker_delay_ms == 8.5 && c.tracker_delay_sd_ms == 0.2);
	assert_true(isnan(c.stepper_N_step) && isnan(c.stepper_steps_s));
	assert_true(c.camera_delay_ms == -3.5 && c.camera_delay_sd_ms == 0.5);
	temp_file_free(&file);
}

TEST(faults_leave_the_calibration_alone)
{
	static const struct {
		const char *text, *says[2];
	} row[] = {
		{"\nforce_mV_N = 0;", {":2: force_mV_N:", "0"}},
		{"force_zero_mV = 1e5;", {":1: force_zero_mV:", "100000"}},
		{"depth_mm_px = \"x\";", {":1: depth_mm_px:", "\"x\""}},
		{"gain = 1;", {":1: gain:"}},
		{"force_mV_N", {":1: syntax error:"}},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		struct temp_file file = temp_file_new("calibration.conf", row[i].text);
		struct incise_calibration c = {
			.force_mV_N = 1, .force_zero_mV = 2, .depth_mm_px = 3};

		assert_error(incise_calibration_load(file.path, &c, &err), EINVAL, &err,
			     file.path, row[i].says[0], row[i].says[1]);
		assert_true(c.force_mV_N == 1 && c.force_zero_mV == 2 &&
			    c.depth_mm_px == 3);
		temp_file_free(&file);
	}
	assert_int_equal(incise_calibration_load("/nowhere/c.conf",
						 &(struct incise_calibration){0}, NULL),
			 -ENOENT);
}

static struct incise_calibration_record force_record(double sensitivity_mV_N)
{
	return (struct incise_calibration_record){
		.kind = "force",
		.date = "2026-11-21T14:48:16Z",
		.device = "sim: \"seed\" 7 \\ µ",
		.method = "weights, after ISO 376",
		.raw = "pairs.csv",
		.raw_crc = 0xfedcba98,
		.n = 2,
		.values = {{"force_mV_N", "mV/N", 1240, sensitivity_mV_N, 1.0 / 3},
			   {"force_zero_mV", "mV", NAN, 176.1, 0.5}},
		.covariance = {1.0 / 9, -0.01, 0.25},
		.n_covariance = 3,
		.low = 0,
		.high = 4.03,
		.range_unit = "N",
		.pass = true,
		.verdict = "within 5 % of 1240 mV/N",
	};
}

static void same(const struct incise_calibration_record *a,
		 const struct incise_calibration_record *b)
{
	assert_string_equal(a->kind, b->kind);
	assert_string_equal(a->date, b->date);
	assert_string_equal(a->device, b->device);
	assert_string_equal(a->method, b->method);
	assert_string_equal(a->raw, b->raw);
	assert_string_equal(a->range_unit, b->range_unit);
	assert_string_equal(a->verdict, b->verdict);
	assert_int_equal(a->raw_crc, b->raw_crc);
	assert_int_equal(a->pass, b->pass);
	assert_true(a->low == b->low || (isnan(a->low) && isnan(b->low)));
	assert_true(a->high == b->high || (isnan(a->high) && isnan(b->high)));
	assert_int_equal(a->n, b->n);
	for (int i = 0; i < a->n; i++) {
		const struct incise_calibration_value *v = &a->values[i],
						      *w = &b->values[i];

		assert_string_equal(v->key, w->key);
		assert_string_equal(v->unit, w->unit);
		/* to the last bit: numbers are written for that */
		assert_true(v->found == w->found || (isnan(v->found) && isnan(w->found)));
		assert_true(v->left == w->left && v->u == w->u);
	}
	assert_int_equal(a->n_covariance, b->n_covariance);
	for (int i = 0; i < a->n_covariance; i++)
		assert_true(a->covariance[i] == b->covariance[i]);
}

static char *content(const char *path)
{
	static char text[20000];
	FILE *in = fopen(path, "r");
	size_t n;

	assert_non_null(in);
	n = fread(text, 1, sizeof(text) - 1, in);
	text[n] = 0;
	fclose(in);
	return text;
}

TEST(what_is_appended_is_read)
{
	struct temp_file file = temp_file_new("calibration.conf", "");
	const struct incise_calibration_record record[] = {force_record(1238.0 + 1.0 / 7),
							   force_record(1e-7 + 1241)};
	struct incise_calibration_record *back;
	struct incise_calibration c = {0};

	unlink(file.path); /* made where there is none */
	/* A decimal comma, where the system has such a locale, must not come into the file. */
	setlocale(LC_ALL, "de_DE.UTF-8");
	for (int i = 0; i < 2; i++) {
		assert_int_equal(incise_calibration_append(file.path, &record[i], NULL),
				 0);
		assert_int_equal(incise_calibration_load(file.path, &c, NULL), 0);
		assert_true(c.force_mV_N == record[i].values[0].left);
		assert_true(c.force_zero_mV == 176.1);
		assert_true(c.depth_mm_px == 0.11875); /* still nominal */
	}
	setlocale(LC_ALL, "C");
	assert_int_equal(incise_calibration_history(file.path, &back, NULL), 2);
	same(&record[0], &back[0]);
	same(&record[1], &back[1]);
	free(back);
	temp_file_free(&file);
}

TEST(what_failed_is_not_in_force)
{
	struct temp_file file =
		temp_file_new("calibration.conf", "force_mV_N = 1200; # by hand\n"
						  "# mine: keep it\n");
	struct incise_calibration_record record = force_record(5e6), *back;
	struct incise_calibration c = {0};

	record.pass = false; /* and far out of the key's range */
	record.low = record.high = NAN;
	assert_int_equal(incise_calibration_append(file.path, &record, NULL), 0);
	assert_int_equal(incise_calibration_load(file.path, &c, NULL), 0);
	assert_true(c.force_mV_N == 1200 && isnan(c.force_zero_mV));
	assert_int_equal(incise_calibration_history(file.path, &back, NULL), 1);
	same(&record, &back[0]);
	free(back);
	record = force_record(1250);
	assert_int_equal(incise_calibration_append(file.path, &record, NULL), 0);
	assert_int_equal(incise_calibration_load(file.path, &c, NULL), 0);
	assert_true(c.force_mV_N == 1250);
	assert_non_null(strstr(content(file.path), "\n# mine: keep it\n"));
	assert_non_null(strstr(content(file.path),
			       "force_mV_N = 1250.0; ## mV/N, U = 0.67 (k = 2), force, "
			       "2026-11-21\n"));
	/* our own comments are not heaped up */
	assert_null(strstr(strstr(content(file.path), "## Active") + 1, "## Active"));
	temp_file_free(&file);
}

TEST(the_last_value_that_passed_is_found)
{
	const struct incise_calibration_record records[] = {
		{.date = "a",
		 .n = 1,
		 .values = {{"force_mV_N", "mV/N", NAN, 1230, 1}},
		 .pass = true},
		{.date = "b",
		 .n = 2,
		 .values = {{"force_zero_mV", "mV", NAN, 180, 1},
			    {"force_mV_N", "mV/N", 1230, 1250, 2}},
		 .pass = true},
		{.date = "c", .n = 1, .values = {{"force_mV_N", "mV/N", 1250, 900, 3}}},
	};
	const struct incise_calibration_record *record = NULL;

	assert_ptr_equal(incise_calibration_last(records, 3, "force_mV_N", &record),
			 &records[1].values[1]);
	assert_ptr_equal(record, &records[1]);
	assert_ptr_equal(incise_calibration_last(records, 1, "force_mV_N", NULL),
			 &records[0].values[0]);
	assert_null(incise_calibration_last(records, 3, "depth_mm_px", NULL));
	assert_null(incise_calibration_last(records, 0, "force_mV_N", NULL));
}

TEST(every_key_comes_back)
{
	struct temp_file file = temp_file_new("calibration.conf", "");
	struct incise_calibration_record record = {
		.kind = "stepper",
		.n = 8,
		.values = {{"stepper_N_step", "N", NAN, -1e-3, 1e-5},
			   {"stepper_backlash_mm", "mm", NAN, 0.05, 0.01},
			   {"stepper_hysteresis_N", "N", NAN, 0.1, 0.01},
			   {"stepper_stiction_N", "N", NAN, 0.2, 0.01},
			   {"stepper_steps_s", "1/s", NAN, 5000, 100},
			   {"tip_z_mm", "mm", 0, 3.25, 0.1},
			   {"tip_x_mm", "mm", 0, 1, 0.1},
			   {"tip_y_mm", "mm", 0, -2, 0.1}},
		.low = NAN,
		.high = NAN,
		.pass = true,
	};
	struct incise_calibration_record *back;
	struct incise_calibration c = {0};

	assert_int_equal(incise_calibration_append(file.path, &record, NULL), 0);
	assert_int_equal(incise_calibration_load(file.path, &c, NULL), 0);
	assert_true(c.tip_mm[0] == 1 && c.tip_mm[1] == -2 && c.tip_mm[2] == 3.25);
	for (int i = 0; i < record.n; i++)
		assert_true(incise_calibration_get(&c, record.values[i].key) ==
			    record.values[i].left);
	assert_true(isnan(incise_calibration_get(&c, "force_zero_mV")));
	assert_true(isnan(incise_calibration_get(&c, "tip_mm")));
	assert_true(c.stepper_N_step == -1e-3 && c.stepper_backlash_mm == 0.05 &&
		    c.stepper_hysteresis_N == 0.1 && c.stepper_stiction_N == 0.2 &&
		    c.stepper_steps_s == 5000);
	assert_int_equal(incise_calibration_history(file.path, &back, NULL), 1);
	/* No date was given: that of now, which is of this century. */
	assert_int_equal(strlen(back[0].date), 20);
	assert_memory_equal(back[0].date, "20", 2);
	free(back);
	temp_file_free(&file);
}

TEST(raw_data_are_named_and_sealed)
{
	/* RFC 3720, B.4: check value of CRC32C */
	struct temp_file file = temp_file_new("pairs.csv", "123456789");
	struct incise_calibration_record record = {.raw = "as it was"};

	assert_int_equal(incise_calibration_raw(&record, "/nowhere/x", NULL), -ENOENT);
	assert_int_equal(incise_calibration_raw(&record, file.dir, NULL), -EISDIR);
	assert_string_equal(record.raw, "as it was");
	assert_int_equal(incise_calibration_raw(&record, file.path, NULL), 0);
	assert_string_equal(record.raw, "pairs.csv");
	assert_int_equal(record.raw_crc, 0xe3069283);
	temp_file_free(&file);
}

TEST(wrong_records_change_nothing)
{
	struct temp_file file = temp_file_new("calibration.conf", "force_mV_N = 1200;\n");
	struct incise_calibration_record row[12];
	const int n = sizeof(row) / sizeof(row[0]);

	for (int i = 0; i < n; i++)
		row[i] = force_record(1240);
	strcpy(row[0].kind, "Force");
	strcpy(row[1].date, "yesterday");
	row[2].n = 0;
	row[3].n = INCISE_CALIBRATION_VALUES + 1;
	strcpy(row[4].values[0].key, "force_mN_V");
	row[5].values[0].left = NAN;
	row[6].values[0].left = 0; /* below the key's range */
	row[7].values[1].u = -1;
	row[8].values[1].u = INFINITY;
	row[9].n_covariance = 2;
	row[10].covariance[1] = NAN;
	row[11].low = 5; /* above high */
	for (int i = 0; i < n; i++) {
		assert_error(incise_calibration_append(file.path, &row[i], &err), EINVAL,
			     &err, "nothing appended");
		assert_string_equal(content(file.path), "force_mV_N = 1200;\n");
	}
	temp_file_free(&file);
}

TEST(wrong_files_are_named)
{
#define ENTRY(rest)                                                                             \
	"history = ( {\nkind = \"force\"; date = \"2026-11-21T14:48:16Z\";\npass = true; " rest \
	"} );\n"
#define VALUE "values = ( { key = \"force_mV_N\"; left = 1240; u = 1; } ); "
	static const struct {
		const char *text, *said;
	} row[] = {
		{"history = 3;", ":1: history:"},
		{"history = [1, 2];", ":1: history:"},
		{"history = (\n1 );", ":2: history[1]"},
		{ENTRY(""), ":2: history[1].values:"},
		{ENTRY("values = ( );"), ":3: history[1].values:"},
		{ENTRY("values = ( 1 );"), ":3: history[1].values[1]:"},
		{ENTRY("values = ( { key = \"force_mV_N\"; u = 1; } );"),
		 ":3: history[1].values[1].left:"},
		{ENTRY("values = ( { key = \"x\"; left = 1; u = 1; } );"),
		 "history: values: key:"},
		{ENTRY("values = ( { key = \"force_mV_N\"; left = 1e999; u = 1; } );"),
		 ":3: history[1].values[1].left:"},
		{ENTRY("values = ( { key = \"force_mV_N\"; left = 0; u = 1; } );"),
		 "history: values: left:"},
		{ENTRY("values = ( { key = \"force_mV_N\"; left = 9; u = -1; } );"),
		 ":3: history[1].values[1].u:"},
		{ENTRY("values = ( { key = \"force_mV_N_force_mV_N_force_mV_N\"; left = 1; "
		       "u = 1; } );"),
		 ":3: history[1].values[1].key:"},
		{ENTRY(VALUE "covariance = [1.0, 2.0];"), ":2: history: covariance:"},
		{ENTRY(VALUE "covariance = [1e999];"), ":3: history[1].covariance:"},
		{ENTRY(VALUE "raw_crc32c = \"xyz\";"), ":3: history[1].raw_crc32c:"},
		{ENTRY(VALUE "low = 2; high = 1;"), ":2: history: low:"},
		{ENTRY(VALUE "sum = 2;"), ":3: history[1].sum:"},
		{"history = ( {\nkind = \"force\";\n", "syntax error"},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		struct temp_file file = temp_file_new("calibration.conf", row[i].text);
		struct incise_calibration_record *records = (void *)1, new;
		struct incise_calibration c = {.force_mV_N = 1};

		assert_error(incise_calibration_load(file.path, &c, &err), EINVAL, &err,
			     file.path, row[i].said);
		assert_true(c.force_mV_N == 1);
		assert_int_equal(incise_calibration_history(file.path, &records, NULL),
				 -EINVAL);
		assert_null(records);
		/* a text is read by the same rules */
		assert_error(incise_calibration_text(row[i].text, "text", &c, &records,
						     &err),
			     EINVAL, &err, "text:", row[i].said);
		assert_null(records);
		/* a file that is not understood is not overwritten */
		new = force_record(1240);
		assert_int_equal(incise_calibration_append(file.path, &new, NULL),
				 -EINVAL);
		assert_string_equal(content(file.path), row[i].text);
		temp_file_free(&file);
	}
}

/*
 * Whenever the writer dies, the file is whole and its history as long as what the writer reported,
 * or one longer. It has written once at least, however late it started.
 */
TEST(a_killed_writer_leaves_a_whole_file)
{
	struct temp_file file = temp_file_new("calibration.conf", "");
	const struct incise_calibration_record record = force_record(1239);
	int length = 0;
	char command[220];

	for (int i = 0; i < 20; i++) {
		struct incise_calibration_record *records;
		int reports[2], n;
		pid_t writer;
		char done;

		assert_int_equal(pipe(reports), 0);
		writer = fork();
		assert_true(writer >= 0);
		if (!writer) {
			while (!incise_calibration_append(file.path, &record, NULL) &&
			       write(reports[1], "", 1) == 1)
				;
			_exit(1);
		}
		close(reports[1]);
		assert_int_equal(read(reports[0], &done, 1), 1);
		usleep(700 * i);
		assert_int_equal(kill(writer, SIGKILL), 0);
		assert_int_equal(waitpid(writer, NULL, 0), writer);
		for (length++; read(reports[0], &done, 1) == 1; length++)
			;
		close(reports[0]);
		n = incise_calibration_history(file.path, &records, NULL);
		assert_in_range(n, length, length + 1);
		length = n;
		if (n > 0)
			same(&record, &records[n - 1]);
		free(records);
	}
	/* A hidden name that was about to be the file's may be left: outfile.h says so. */
	snprintf(command, sizeof(command), "rm -rf %s", file.dir);
	assert_int_equal(system(command), 0);
}

static void say_present(struct file_content *file, const char *name)
{
	int element;

	file->present[find_key(name, &element) - incise_calibration_settings] = true;
}

static char *written(const struct file_content *file, const char *notes)
{
	char *text;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	assert_non_null(out);
	put_file(file, notes, out);
	assert_int_equal(fclose(out), 0);
	return text;
}

TEST(what_is_empty_is_said)
{
	struct file_content file = {0};
	char *text;

	incise_calibration_nominal(&file.in_force);
	text = written(&file, "# by hand\n");
	assert_string_equal(
		text,
		"## Calibration of a haptic cutting rig, kept by 'incise calibrate'; "
		"see calibration.conf(5).\n# by hand\n\n## Active values; absent keys "
		"have their nominal value.\n\n## Each calibration, oldest first; u is "
		"a standard uncertainty (k = 1).\nhistory = (\n);\n");
	free(text);
}

TEST(text_is_as_documented)
{
	struct incise_calibration_record records[] = {
		{
			.kind = "force",
			.date = "2026-11-21T14:48:16Z",
			.device = "a \"b\" \\",
			.raw = "pairs.csv",
			.raw_crc = 0xbeef,
			.n = 2,
			.values = {{"force_mV_N", "mV/N", 1240, 1238.25, 1.25},
				   {"force_zero_mV", "mV", NAN, 176, 0.5}},
			.covariance = {1.5625, -0.1, 0.25},
			.n_covariance = 3,
			.low = 0,
			.high = 4.03,
			.range_unit = "N",
			.pass = true,
		},
		{
			.kind = "tip",
			.date = "2026-11-22T00:00:00Z",
			.n = 1,
			.values = {{"tip_x_mm", "mm", 0, 9, 0.1}},
			.low = NAN,
			.high = NAN,
			.verdict = "no",
		},
	};
	struct file_content file = {.records = records, .n = 2};
	char *text;

	incise_calibration_nominal(&file.in_force);
	file.in_force.force_mV_N = 1238.25;
	file.in_force.force_zero_mV = 170; /* changed by hand since */
	file.in_force.tip_mm[1] = 1.0 / 3;
	say_present(&file, "force_mV_N");
	say_present(&file, "force_zero_mV");
	for (int i = 0; i < 3; i++)
		say_present(&file,
			    (const char *[]){"tip_x_mm", "tip_y_mm", "tip_z_mm"}[i]);
	/* a decimal comma, where the system has such a locale, must not come into the file */
	setlocale(LC_ALL, "de_DE.UTF-8");
	text = written(&file, "");
	setlocale(LC_ALL, "C");
	assert_non_null(strstr(
		text,
		"## Active values; absent keys have their nominal value.\n"
		"force_mV_N = 1238.25; ## mV/N, U = 2.5 (k = 2), force, 2026-11-21\n"
		"force_zero_mV = 170.0; ## mV\n"
		"tip_mm = [0.0, 0.3333333333333333, 0.0]; ## mm\n"));
	assert_non_null(strstr(text, "history = (\n{\n  kind = \"force\";\n"));
	assert_non_null(strstr(text, "  device = \"a \\\"b\\\" \\\\\";\n"));
	assert_non_null(strstr(text,
			       "  raw = \"pairs.csv\";\n"
			       "  raw_crc32c = \"0000beef\";\n"
			       "  values = (\n"
			       "    { key = \"force_mV_N\"; unit = \"mV/N\"; found = "
			       "1240.0; left = 1238.25; u = 1.25; },\n"
			       "    { key = \"force_zero_mV\"; unit = \"mV\"; left = "
			       "176.0; u = 0.5; } );\n"
			       "  covariance = [1.5625, -0.1, 0.25];\n"
			       "  low = 0.0;\n  high = 4.03;\n"
			       "  range_unit = \"N\";\n  pass = true;\n}, {\n"));
	assert_non_null(strstr(text, "  pass = false;\n  verdict = \"no\";\n}\n);\n"));
	free(text);
}
