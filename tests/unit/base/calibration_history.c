// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/base/calibration_history.c: what is appended is read back the same, what failed is not
 * in force, and a file that is wrong or half written is never taken.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <locale.h>
#include <math.h>
#include <signal.h>
#include <sys/wait.h>
#include <incise/calibration.h>
#include "temp_file.h"

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

static void what_is_appended_is_read(void **state)
{
	struct temp_file file = temp_file_new("calibration.conf", "");
	const struct incise_calibration_record record[] = {force_record(1238.0 + 1.0 / 7),
							   force_record(1e-7 + 1241)};
	struct incise_calibration_record *back;
	struct incise_calibration c;

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

static void what_failed_is_not_in_force(void **state)
{
	struct temp_file file =
		temp_file_new("calibration.conf", "force_mV_N = 1200; # by hand\n"
						  "# mine: keep it\n");
	struct incise_calibration_record record = force_record(5e6), *back;
	struct incise_calibration c;

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
	assert_null(strstr(strstr(content(file.path), "## In") + 1, "## In"));
	temp_file_free(&file);
}

static void every_key_comes_back(void **state)
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
	struct incise_calibration c;

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

static void raw_data_are_named_and_sealed(void **state)
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

static void wrong_records_change_nothing(void **state)
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
		struct incise_error err = {0};

		assert_int_equal(incise_calibration_append(file.path, &row[i], &err),
				 -EINVAL);
		assert_int_equal(err.code, EINVAL);
		assert_non_null(strstr(err.text, "nothing appended: of the calibration"));
		assert_string_equal(content(file.path), "force_mV_N = 1200;\n");
	}
	temp_file_free(&file);
}

static void wrong_files_are_named(void **state)
{
#define ENTRY(rest)                                                                             \
	"history = ( {\nkind = \"force\"; date = \"2026-11-21T14:48:16Z\";\npass = true; " rest \
	"} );\n"
#define VALUE "values = ( { key = \"force_mV_N\"; left = 1240; u = 1; } ); "
	static const struct {
		const char *text, *said;
	} row[] = {
		{"history = 3;", ":1: history: expected a list"},
		{"history = [1, 2];", ":1: history: expected a list"},
		{"history = (\n1 );", ":2: history: expected groups"},
		{ENTRY(""), ":2: history: values: expected a list of 1 to 16"},
		{ENTRY("values = ( );"), ":3: history: values: expected a list"},
		{ENTRY("values = ( 1 );"), ":3: history: values: expected groups"},
		{ENTRY("values = ( { key = \"force_mV_N\"; u = 1; } );"),
		 ":3: left is missing"},
		{ENTRY("values = ( { key = \"x\"; left = 1; u = 1; } );"),
		 "history: values: key: expected a key"},
		{ENTRY("values = ( { key = \"force_mV_N\"; left = 1e999; u = 1; } );"),
		 ":3: left: expected a number from"},
		{ENTRY("values = ( { key = \"force_mV_N\"; left = nan; u = 1; } );"),
		 ":3: syntax error"},
		{ENTRY("values = ( { key = \"force_mV_N\"; left = 0; u = 1; } );"),
		 "history: values: left: expected a number in the range"},
		{ENTRY("values = ( { key = \"force_mV_N\"; left = 9; u = -1; } );"),
		 ":3: u: expected a number from 0"},
		{ENTRY("values = ( { key = \"force_mV_N_force_mV_N_force_mV_N\"; left = 1; "
		       "u = 1; } );"),
		 ":3: key: expected text of at most 31 bytes"},
		{ENTRY(VALUE "covariance = [1.0, 2.0];"),
		 ":2: history: covariance: expected n (n + 1)/2"},
		{ENTRY(VALUE "covariance = [1e999];"),
		 ":3: covariance: expected numbers that are finite"},
		{ENTRY(VALUE "covariance = \"x\";"), ":3: covariance: expected at most"},
		{ENTRY(VALUE "raw_crc32c = \"xyz\";"), ":3: history: raw_crc32c: expect"},
		{ENTRY(VALUE "raw_crc32c = 3;"), ":3: raw_crc32c: expected text"},
		{ENTRY(VALUE "low = 2; high = 1;"), ":2: history: low: expected a range"},
		{ENTRY(VALUE "verdict = 2;"), ":3: verdict: expected text in quotes"},
		{ENTRY(VALUE "sum = 2;"), ":3: sum: unknown key"},
		{"history = ( {\nkind = \"force\";\n", "syntax error"},
		{"tip_mm = [1, 2];", ":1: tip_mm: expected three numbers"},
		{"stepper_backlash_mm = -1;",
		 ":1: stepper_backlash_mm: expected a number"},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		struct temp_file file = temp_file_new("calibration.conf", row[i].text);
		struct incise_calibration_record *records = (void *)1, new;
		struct incise_calibration c = {.force_mV_N = 1};
		struct incise_error err = {0};

		assert_int_equal(incise_calibration_load(file.path, &c, &err), -EINVAL);
		assert_true(c.force_mV_N == 1);
		if (!strstr(err.text, row[i].said) || strncmp(err.text, file.path, 10))
			fail_msg("row %zu: %s", i, err.text);
		assert_int_equal(incise_calibration_history(file.path, &records, NULL),
				 -EINVAL);
		assert_null(records);
		/* a file that is not understood is not overwritten */
		new = force_record(1240);
		assert_int_equal(incise_calibration_append(file.path, &new, NULL),
				 -EINVAL);
		assert_string_equal(content(file.path), row[i].text);
		temp_file_free(&file);
	}
}

/* Whenever the writer dies, the file is whole and its history as long as before, or longer. */
static void a_killed_writer_leaves_a_whole_file(void **state)
{
	struct temp_file file = temp_file_new("calibration.conf", "");
	const struct incise_calibration_record record = force_record(1239);
	int length = 0, grown = 0;
	char command[220];

	for (int i = 0; i < 20; i++) {
		struct incise_calibration_record *records;
		pid_t writer = fork();
		int n;

		assert_true(writer >= 0);
		if (!writer)
			for (;;)
				incise_calibration_append(file.path, &record, NULL);
		usleep(2000 + 700 * i);
		assert_int_equal(kill(writer, SIGKILL), 0);
		assert_int_equal(waitpid(writer, NULL, 0), writer);
		n = incise_calibration_history(file.path, &records, NULL);
		assert_true(n >= length);
		grown += n > length;
		length = n;
		if (n > 0)
			same(&record, &records[n - 1]);
		free(records);
	}
	assert_true(grown > 0); /* it did write */
	/* A hidden name that was about to be the file's may be left: outfile.h says so. */
	snprintf(command, sizeof(command), "rm -rf %s", file.dir);
	assert_int_equal(system(command), 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(what_is_appended_is_read),
		cmocka_unit_test(what_failed_is_not_in_force),
		cmocka_unit_test(every_key_comes_back),
		cmocka_unit_test(raw_data_are_named_and_sealed),
		cmocka_unit_test(wrong_records_change_nothing),
		cmocka_unit_test(wrong_files_are_named),
		cmocka_unit_test(a_killed_writer_leaves_a_whole_file),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
