// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/publish/table_writer.c and of the CSV that comes of it: numbers are held
 * against printf(3), blocks against rows given one by one.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/publish/table_writer.h"

struct row {
	int64_t name;
	double value;
	int64_t n;
	bool flag;
};

#define AT(member) offsetof(struct row, member), NULL, NULL, NULL

static const struct incise_table_column columns[] = {
	{"name", "1", "a name", INCISE_COLUMN_NAME, 0, AT(name)},
	{"fixed", "mm", "a real", INCISE_COLUMN_REAL, 4, AT(value)},
	{"micro", "s", "a real", INCISE_COLUMN_SINGLE, 6, AT(value)},
	{"free", "N", "a real", INCISE_COLUMN_REAL, -1, AT(value)},
	{"count", "1", "a count", INCISE_COLUMN_INTEGER, 0, AT(n)},
	{"flag", "1", "a flag", INCISE_COLUMN_FLAG, 0, AT(flag)},
};

#define N_COLUMNS ((int)(sizeof(columns) / sizeof(*columns)))

static char *text;
static size_t size;

static void start(struct incise_table *table, const struct incise_provenance *provenance,
		  FILE *out)
{
	*table = (struct incise_table){
		.format = &incise_table_csv,
		.out = out,
		.columns = columns,
		.n_columns = N_COLUMNS,
		.provenance = provenance,
	};
	assert_int_equal(incise_table_open(table, &err), 0);
}

static FILE *begin(struct incise_table *table, const struct incise_provenance *provenance)
{
	FILE *out = open_memstream(&text, &size);

	start(table, provenance, out);
	return out;
}

static void add(struct incise_table *table, const char *name, double value, int64_t n)
{
	int number = incise_table_name(table, name);

	assert_true(number > 0);
	assert_int_equal(
		incise_table_add(table, &(struct row){number, value, n, n & 1}, &err), 0);
}

static void end(struct incise_table *table, FILE *out)
{
	assert_int_equal(incise_table_finish(table, &err), 0);
	incise_table_close(table);
	fclose(out);
}

/* Ties, carries, signs, what does not fit the fast way, and a random walk over sizes. */
TEST(numbers_are_those_of_printf)
{
	static const double special[] = {
		0,	  -0.0,	     0.5,	   0.00005,	0.00015,    0.00025,
		1.00005,  -1e-9,     -0.00004999,  0.99995,	0.99994999, 9.9999999,
		0x1p40,	  -0x1p39,   1e15,	   -1e300,	1e-300,	    12345.67895,
		INFINITY, -INFINITY, 1.0000004999, 1.0000005001};
	struct incise_table table;
	FILE *out = begin(&table, NULL);
	int n = sizeof(special) / sizeof(*special);
	uint64_t random = 1;
	double *values = calloc(n + 200000, sizeof(*values));
	char *rest, expected[1500];

	memcpy(values, special, sizeof(special));
	for (int i = 0; i < 60000; i++) {
		incise_random_step(&random);
		values[n++] = ldexp((int64_t)random, -(int)(random >> 20 & 63) - 20);
		/* on a tie of four decimals, or beside it by one digit */
		values[n++] = nextafter(((int64_t)random >> 40) * 1e-4 + 0.5e-4,
					random & 1 ? 1e9 : -1e9);
	}
	for (int i = 0; i < n; i++)
		add(&table, "a", values[i], i - 3);
	end(&table, out);
	rest = text;
	assert_string_equal(strsep(&rest, "\n"), "name,fixed,micro,free,count,flag");
	for (int i = 0; i < n; i++) {
		snprintf(expected, sizeof(expected), "a,%.4f,%.6f,%.9g,%d,%d", values[i],
			 values[i], values[i], i - 3, (i - 3) & 1);
		assert_string_equal(strsep(&rest, "\n"), expected);
	}
	assert_string_equal(rest, "");
	free(values);
	free(text);
}

TEST(names_are_quoted_and_provenance_is_comments)
{
	struct incise_provenance provenance = {0};
	struct incise_table table;
	FILE *out;

	incise_provenance_add(&provenance, "source", "a\nb%s", ".rec");
	incise_provenance_add(&provenance, "nothing", "%s", "");
	assert_int_equal(provenance.rc, 0);
	out = begin(&table, &provenance);
	add(&table, "plain", 1, 0);
	add(&table, "say \"a,b\"", 1, 0);
	add(&table, "say \"a,b\"", 1, 0);
	assert_int_equal(table.n_names, 2);
	add(&table, "=cmd()-01", 1, 0);
	add(&table, "@a b", 1, 0);
	end(&table, out);
	assert_string_equal(text, "# source: a_b.rec\n"
				  "name,fixed,micro,free,count,flag\n"
				  "plain,1.0000,1.000000,1,0,0\n"
				  "\"say \"\"a,b\"\"\",1.0000,1.000000,1,0,0\n"
				  "\"say \"\"a,b\"\"\",1.0000,1.000000,1,0,0\n"
				  "'=cmd()-01,1.0000,1.000000,1,0,0\n"
				  "\"'@a b\",1.0000,1.000000,1,0,0\n");
	incise_provenance_free(&provenance);
	free(text);
}

TEST(nothing_is_written_before_a_row)
{
	struct incise_table table;
	FILE *out = begin(&table, NULL);

	end(&table, out);
	assert_int_equal(size, 0);
	free(text);
}

TEST(a_full_disk_is_told)
{
	struct incise_table table;
	FILE *out = fopen("/dev/full", "w");

	start(&table, NULL, out);
	add(&table, "a", 1, 1);
	assert_int_equal(incise_table_finish(&table, &err), -ENOSPC);
	assert_int_equal(err.code, ENOSPC);
	incise_table_close(&table);
	fclose(out);
}
