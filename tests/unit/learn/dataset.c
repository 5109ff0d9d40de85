// SPDX-License-Identifier: GPL-2.0-or-later
/* Reading CSV: values, groups, and errors that name line and column. */
#include "../unit.h"
/* before cmocka.h, which has a macro fail() */
#include "../../../lib/learn/dataset.c"
#include "../base/temp_file.h"

static const char *const columns[] = {"force_N", "depth_mm"};

static struct incise_dataset *read_text(const char *text, const char *group,
					struct incise_error *err)
{
	struct temp_file file = temp_file_new("d.csv", text);
	struct incise_dataset *data =
		incise_dataset_read(file.path, columns, 2, group, err);

	temp_file_free(&file);
	return data;
}

TEST(test_values_in_the_order_asked_for)
{
	/* Byte-order mark, CR LF, comments, quotes, an empty line, no final newline. */
	struct incise_dataset *data = read_text("\xef\xbb\xbf# liver\r\n"
						"cut,depth_mm,other,force_N\r\n"
						"\"a, \"\"1\"\"\",1.5,x,-2e-3\r\n"
						"\r\n"
						" \t\r\n"
						"b,2,y, 4 \n"
						"\"a, \"\"1\"\"\",3,,5",
						"cut", NULL);

	assert_non_null(data);
	assert_int_equal(incise_dataset_rows(data), 3);
	assert_true(incise_dataset_row(data, 0)[0] == -2e-3);
	assert_true(incise_dataset_row(data, 0)[1] == 1.5);
	assert_true(incise_dataset_row(data, 2)[0] == 5);
	assert_int_equal(data->n_groups, 2);
	assert_int_equal(incise_dataset_group(data, 0), 0);
	assert_int_equal(incise_dataset_group(data, 1), 1);
	assert_int_equal(incise_dataset_group(data, 2), 0);
	assert_string_equal(data->names[0], "a, \"1\"");
	incise_dataset_free(data);
}

TEST(test_without_groups)
{
	struct incise_dataset *data = read_text("depth_mm,force_N\n1,2\n", NULL, NULL);

	assert_int_equal(data->n_groups, 0);
	assert_int_equal(incise_dataset_group(data, 0), -1);
	incise_dataset_free(data);
}

/* More rows and groups than the first allocation has room for. */
TEST(test_many_rows)
{
	static char text[200000];
	size_t used = sprintf(text, "cut,depth_mm,force_N\n");
	struct incise_dataset *data;

	for (int i = 0; i < 5000; i++)
		used += sprintf(text + used, "c%d,%d,%d\n", i / 10, i, -i);
	data = read_text(text, "cut", NULL);
	assert_int_equal(incise_dataset_rows(data), 5000);
	assert_int_equal(data->n_groups, 500);
	for (int i = 0; i < 5000; i++) {
		assert_true(incise_dataset_row(data, i)[0] == -i);
		assert_true(incise_dataset_row(data, i)[1] == i);
		assert_int_equal(incise_dataset_group(data, i), i / 10);
	}
	incise_dataset_free(data);
}

TEST(test_errors_say_where)
{
	static const struct {
		const char *text, *group;
		int code;
		const char *says[2];
	} cases[] = {
		{"", NULL, ENODATA, {"d.csv", "empty"}},
		{"# only a comment\n", NULL, ENODATA, {"d.csv", "empty"}},
		{"depth_mm,force_N\n", NULL, ENODATA, {":1:", "no rows"}},
		{"depth_mm,force\n1,2\n", NULL, EINVAL, {"'force_N'", "depth_mm, force"}},
		{"depth_mm,force_N\n1,2\n",
		 "cut",
		 EINVAL,
		 {"'cut'", "depth_mm, force_N"}},
		{"depth_mm,force_N\n1,2\n3,four\n",
		 NULL,
		 EINVAL,
		 {":3: column 2", "'four'"}},
		{"depth_mm,force_N\n1,2\n3,4x\n", NULL, EINVAL, {":3: column 2", "'4x'"}},
		{"depth_mm,force_N\n1,2\n,4\n", NULL, EINVAL, {":3: column 1", ":3:"}},
		{"depth_mm,force_N\nnan,2\n", NULL, EINVAL, {":2: column 1", ":2:"}},
		{"depth_mm,force_N\n1,-inf\n", NULL, EINVAL, {":2: column 2", ":2:"}},
		{"depth_mm,force_N\n1,1e999\n", NULL, EINVAL, {":2: column 2", ":2:"}},
		{"depth_mm,force_N\n1,2\n3\n",
		 NULL,
		 EINVAL,
		 {":3: column 2", "1 fields"}},
		{"depth_mm,force_N\n1,2,3\n", NULL, EINVAL, {":2: column 3", "3 fields"}},
		{"depth_mm,force_N\n\"1,2\n", NULL, EINVAL, {":2:", "closed"}},
		{"depth_mm,force_N,x,force_N\n1,2,3,4\n",
		 NULL,
		 EINVAL,
		 {":1:", "two columns are called force_N"}},
		{"cut,depth_mm,cut,force_N\n1,2,3,4\n",
		 "cut",
		 EINVAL,
		 {":1:", "two columns are called cut"}},
		{"depth_mm,force_N\n1,\"1,002.0\"\n", NULL, EINVAL, {":2:", "thousands"}},
		{"depth_mm,force_N\n1,2,\n", NULL, EINVAL, {":2:", "last field"}},
		{"depth_mm [mm],force_N [N]\n1,2\n",
		 NULL,
		 EINVAL,
		 {":1:", "did you mean 'force_N [N]'?"}},
		{"depth_mm,force_N\n\"1\"2,3\n", NULL, EINVAL, {":2:", "quote"}},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		assert_error(read_text(cases[i].text, cases[i].group, &err),
			     cases[i].code, &err, cases[i].says[0], cases[i].says[1]);
	}
}

TEST(test_where)
{
	static const struct {
		const char *text, *where;
		size_t rows, left_out;
	} cases[] = {
		/* what is left out may hold anything */
		{"a,depth_mm,force_N,cut\n1,1,2,p\n0,nan,x,q\n0.0,3,4,r\n2,5,6,s\n", "a",
		 2, 2},
		{"depth_mm,force_N,cut\n1,2,p\n3,4,q\n", "a", 2, 0},
		{"a,depth_mm,force_N,cut\n0,1,2,p\n", NULL, 1, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct temp_file file = temp_file_new("d.csv", cases[i].text);
		size_t left_out = 99;
		struct incise_dataset *data = incise_dataset_read_where(
			file.path, columns, 2, "cut", cases[i].where, &left_out, NULL);

		assert_non_null(data);
		assert_int_equal(incise_dataset_rows(data), cases[i].rows);
		assert_int_equal(left_out, cases[i].left_out);
		/* no group of rows that are not there */
		assert_int_equal(data->n_groups, cases[i].rows);
		if (!i)
			assert_true(incise_dataset_row(data, 1)[1] == 5);
		incise_dataset_free(data);
		temp_file_free(&file);
	}
}

TEST(test_where_refuses)
{
	static const struct {
		const char *text;
		int code;
		const char *says;
	} cases[] = {
		{"a,depth_mm,force_N\n0,1,2\n0,3,4\n", ENODATA, "'a'"},
		{"a,depth_mm,force_N\nnan,1,2\n", EINVAL, "column 1 (a)"},
		{"a,depth_mm,force_N\n", ENODATA, ":1"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct temp_file file = temp_file_new("d.csv", cases[i].text);
		struct incise_error err = {0};
		size_t left_out;

		assert_null(incise_dataset_read_where(file.path, columns, 2, NULL, "a",
						      &left_out, &err));
		assert_int_equal(err.code, cases[i].code);
		assert_says(err.text, cases[i].says);
		temp_file_free(&file);
	}
}

TEST(test_missing_and_binary_files)
{
	struct temp_file file = temp_file_new("d.csv", "");
	FILE *out = fopen(file.path, "w");

	assert_null(incise_dataset_read("/nonexistent.csv", columns, 2, NULL, &err));
	assert_int_equal(err.code, ENOENT);
	fwrite("SQLite format 3\0\0\0", 1, 18, out);
	fclose(out);
	assert_error(incise_dataset_read(file.path, columns, 2, NULL, &err), EINVAL, &err,
		     "NUL");
	assert_null(incise_dataset_read(file.dir, columns, 2, NULL, &err));
	assert_int_equal(err.code, EISDIR);
	temp_file_free(&file);
}

/* Four cuts of three rows: both sides hold whole cuts, and the rows as they were. */
TEST(test_split)
{
	struct incise_dataset *data = read_text(
		"cut,depth_mm,force_N\np,1,10\np,2,20\np,3,30\nq,4,40\nq,5,50\nq,6,60\n"
		"r,7,70\nr,8,80\nr,9,90\ns,10,100\ns,11,110\ns,12,120\n",
		"cut", NULL);
	struct incise_train_side fit, check = {0};
	double sum = 0;

	assert_int_equal(incise_train_split(data, 0.25, 1, &fit, &check, NULL), 0);
	assert_int_equal(fit.pairs.n, 9);
	assert_int_equal(fit.n_groups, 3);
	assert_int_equal(check.pairs.n, 3);
	assert_int_equal(check.n_groups, 1);
	for (size_t i = 0; i < 12; i++) {
		const struct incise_train_side *side = i < 9 ? &fit : &check;
		const double *row = side->pairs.rows + 2 * (i < 9 ? i : i - 9);

		assert_true(row[0] == 10 * row[1]);
		assert_int_equal(side->groups[i < 9 ? i : i - 9], (int)(row[1] - 1) / 3);
		sum += row[1];
	}
	assert_true(sum == 78);
	incise_train_side_free(&fit);
	incise_train_side_free(&check);
	check = (struct incise_train_side){0};
	assert_int_equal(incise_train_split(data, 0, 1, &fit, &check, NULL), 0);
	assert_int_equal(fit.pairs.n, 12);
	assert_null(check.pairs.rows);
	incise_train_side_free(&fit);
	assert_int_equal(incise_train_split(data, 1, 1, &fit, &check, NULL), -EINVAL);
	incise_dataset_free(data);
}

/* A column that a file has, and whether its first row states a number there. */
TEST(test_has)
{
	static const struct {
		const char *text;
		bool has, stated;
	} cases[] = {
		{"# x\ncut,u\na,0.5\nb,nan\n", true, true},
		{"cut,u\na,nan\nb,1\n", true, false},
		{"cut,u\na,x\n", true, false},
		{"cut,u\na\n", true, false},
		{"cut,u\n", true, true},
		{"cut,v\na,nan\n", false, true},
		{"", false, true},
	};
	bool stated = false;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct temp_file file = temp_file_new("d.csv", cases[i].text);

		stated = true;
		assert_int_equal(incise_dataset_has(file.path, "u", &stated),
				 cases[i].has);
		assert_int_equal(stated, cases[i].stated);
		assert_int_equal(incise_dataset_has(file.path, "u", NULL), cases[i].has);
		temp_file_free(&file);
	}
	stated = false;
	assert_false(incise_dataset_has("/none", "u", &stated));
	assert_false(stated); /* others have set it */
}
