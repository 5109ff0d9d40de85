// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/read/rows_array.c: a long table grows the array, only elements that count are
 * kept, and there is no list of nothing, or after a failure.
 */
#include "recorded.h"
#include "../../../lib/record/read/rows_array.h"

#define DB "a.rec/recording.db"

/* Rows of table force whose code divides by that; ends as incise_rows_array_end(). */
static int gather(int divisor, struct incise_rows_array *array, struct incise_error *err)
{
	struct incise_recording *recording = incise_recording_open("a.rec", err);
	int64_t *code;
	int rc;

	assert_non_null(recording);
	rc = incise_rows_array_open(array, recording, "force", "seq, t_ns, code", "iii",
				    sizeof(*code), err);
	while (!rc && (code = incise_rows_array_next(array, &rc, err))) {
		*code = sqlite3_column_int64(array->rows.stmt, 2);
		array->n += *code % divisor == 0;
	}
	rc = incise_rows_array_end(array, rc);
	incise_recording_close(recording);
	return rc;
}

static void elements_are_rows(void **state)
{
	struct incise_rows_array array;
	struct incise_error err = {0};
	const int64_t *codes;

	record("a.rec", "sim:clock=simulated", 600 * MS);
	/* more than the first room, and than twice of it; all codes other than 0 */
	change(DB,
	       "DELETE FROM force; WITH RECURSIVE i(n) AS (SELECT 0 UNION ALL SELECT n + 1 "
	       "FROM i WHERE n < 9999) INSERT INTO force SELECT n, 1000 * n, n + 1 FROM i");
	assert_int_equal(gather(1, &array, &err), 10000);
	codes = array.list;
	for (int i = 0; i < 10000; i++)
		assert_int_equal(codes[i], i + 1);
	free(array.list);

	assert_int_equal(gather(4, &array, &err), 2500);
	codes = array.list;
	assert_true(codes[0] == 4 && codes[2499] == 10000);
	free(array.list);

	assert_int_equal(gather(20000, &array, &err), 0);
	assert_null(array.list);
}

static void after_a_failure_there_is_none(void **state)
{
	struct incise_rows_array array;
	struct incise_error err = {0};

	record("a.rec", "sim:clock=simulated", 600 * MS);
	change(DB, "UPDATE force SET code = 'x' WHERE seq = 5000");
	assert_int_equal(gather(1, &array, &err), -EINVAL);
	assert_null(array.list);
	assert_non_null(strstr(err.text, "table force, row 5000"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(elements_are_rows, enter_folder,
						leave_folder),
		cmocka_unit_test_setup_teardown(after_a_failure_there_is_none,
						enter_folder, leave_folder),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
