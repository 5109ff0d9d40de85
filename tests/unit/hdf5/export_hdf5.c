// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/publish/hdf5/export_hdf5.c: what it wrote is read back through libhdf5's
 * own interface.
 */
#include "../unit.h"
#include <sys/resource.h>
#include <signal.h>
#include <hdf5.h>
#include <incise/outfile.h>
#include "../../../lib/publish/table_writer.h"

struct row {
	int64_t cut;
	double t_s, force_N;
	int64_t count;
	bool clipped;
};

#define AT(member) offsetof(struct row, member), NULL, NULL, NULL

static const struct incise_table_column columns[] = {
	{"cut", "1", "a name", INCISE_COLUMN_NAME, 0, AT(cut)},
	{"t_s", "s", "a time", INCISE_COLUMN_REAL, 6, AT(t_s)},
	{"force_N", "N", "a force", INCISE_COLUMN_SINGLE, 5, AT(force_N)},
	{"count", "1", "a count", INCISE_COLUMN_INTEGER, 0, AT(count)},
	{"clipped", "1", "a flag", INCISE_COLUMN_FLAG, 0, AT(clipped)},
};

#define FILE_NAME "table.h5"

static int enter(void **state)
{
	char path[] = "/tmp/incise-hdf5-XXXXXX";

	if (!mkdtemp(path) || chdir(path))
		return -1;
	*state = strdup(path);
	return 0;
}

static int leave(void **state)
{
	int rc;

	unlink(FILE_NAME);
	rc = chdir("/") || rmdir(*state);
	free(*state);
	return rc;
}

static double time_of(int64_t row)
{
	return row * 1e-4 + 1e6;
}

/* So uneven that little of it can be deflated away: the last step of splitmix64. */
static int64_t mix(uint64_t x)
{
	x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
	x = (x ^ x >> 27) * 0x94d049bb133111ebu;
	return (int64_t)(x ^ x >> 31);
}

/* Write n rows; the first error, or 0. */
static int write_rows(int64_t n, const struct incise_provenance *provenance,
		      struct incise_error *err)
{
	struct incise_outfile *file = incise_outfile_open(FILE_NAME, err);
	struct incise_table table = {
		.format = &incise_table_hdf5,
		.columns = columns,
		.n_columns = 5,
		.provenance = provenance,
	};
	char name[32];
	int rc;

	assert_non_null(file);
	table.out = incise_outfile_stream(file);
	rc = incise_table_open(&table, err);
	for (int64_t i = 0; i < n && !rc; i++) {
		int64_t mixed = mix(i);

		snprintf(name, sizeof(name), "liver-%02d", (int)(i / 20000) + 1);
		rc = incise_table_add(&table,
				      &(struct row){incise_table_name(&table, name),
						    time_of(i), mixed * 0x1p-60, mixed,
						    i % 3 == 0},
				      err);
	}
	if (!rc)
		rc = incise_table_finish(&table, err);
	incise_table_close(&table);
	if (!rc)
		return incise_outfile_commit(file, err);
	incise_outfile_abort(file);
	return rc;
}

static void text_attribute(hid_t at, const char *key, const char *expected)
{
	hid_t attribute = H5Aopen(at, key, H5P_DEFAULT), type;
	char text[100] = "";

	assert_true(attribute >= 0);
	type = H5Aget_type(attribute);
	assert_true(H5Tget_size(type) < sizeof(text));
	assert_true(H5Aread(attribute, type, text) >= 0);
	assert_string_equal(text, expected);
	H5Tclose(type);
	H5Aclose(attribute);
}

/* All of a column, as libhdf5 converts it to doubles. */
static double *read_column(hid_t file, const char *name, hsize_t n, const char *unit)
{
	hid_t set = H5Dopen2(file, name, H5P_DEFAULT), space = H5Dget_space(set);
	double *values = calloc(n ? n : 1, sizeof(*values));
	hsize_t rows;

	assert_true(set >= 0);
	assert_int_equal(H5Sget_simple_extent_ndims(space), 1);
	H5Sget_simple_extent_dims(space, &rows, NULL);
	assert_int_equal(rows, n);
	assert_true(H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT,
			    values) >= 0);
	text_attribute(set, "units", unit);
	H5Sclose(space);
	H5Dclose(set);
	return values;
}

TEST(rows_come_back)
{
	/* none, one, a block, one more, and several with a rest */
	static const int64_t sizes[] = {0, 1, INCISE_TABLE_BLOCK, INCISE_TABLE_BLOCK + 1,
					50001};
	struct incise_provenance provenance = {0};

	incise_provenance_add(&provenance, "source", "liver.rec");
	for (size_t k = 0; k < sizeof(sizes) / sizeof(*sizes); k++) {
		int64_t n = sizes[k];
		double *cut, *t_s, *force, *count, *clipped;
		hid_t file;

		succeeds(!write_rows(n, &provenance, &err));
		file = H5Fopen(FILE_NAME, H5F_ACC_RDONLY, H5P_DEFAULT);
		assert_true(file >= 0);
		text_attribute(file, "source", "liver.rec");
		cut = read_column(file, "cut", n, "1");
		t_s = read_column(file, "t_s", n, "s");
		force = read_column(file, "force_N", n, "N");
		count = read_column(file, "count", n, "1");
		clipped = read_column(file, "clipped", n, "1");
		for (int64_t i = 0; i < n; i++) {
			int64_t mixed = mix(i);

			assert_true(cut[i] == i / 20000 + 1);
			assert_true(t_s[i] == time_of(i));
			assert_true(force[i] == (float)(mixed * 0x1p-60));
			assert_true(count[i] == (double)mixed);
			assert_true(clipped[i] == (i % 3 == 0));
		}
		free(cut);
		free(t_s);
		free(force);
		free(count);
		free(clipped);
		H5Fclose(file);
	}
	incise_provenance_free(&provenance);
}

TEST(names_stand_beside_their_column)
{
	char names[3][8];
	hid_t file, set, type;

	assert_int_equal(write_rows(50001, NULL, &err), 0);
	file = H5Fopen(FILE_NAME, H5F_ACC_RDONLY, H5P_DEFAULT);
	set = H5Dopen2(file, "cut_names", H5P_DEFAULT);
	assert_true(set >= 0);
	type = H5Dget_type(set);
	assert_int_equal(H5Tget_size(type), 8);
	assert_true(H5Dread(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, names) >= 0);
	assert_memory_equal(names, "liver-01liver-02liver-03", sizeof(names));
	H5Tclose(type);
	H5Dclose(set);
	H5Fclose(file);
}

/* No more than so many bytes of a file, as on a full disk. */
TEST(no_room_leaves_nothing)
{
	static const rlim_t sizes[] = {100, 5000, 300000};
	struct rlimit before, limit;

	signal(SIGXFSZ, SIG_IGN);
	getrlimit(RLIMIT_FSIZE, &before);
	unlink(FILE_NAME);
	for (size_t i = 0; i < sizeof(sizes) / sizeof(*sizes); i++) {
		struct incise_error err = {0};
		int rc;

		limit = before;
		limit.rlim_cur = sizes[i];
		setrlimit(RLIMIT_FSIZE, &limit);
		rc = write_rows(50001, NULL, &err);
		setrlimit(RLIMIT_FSIZE, &before);
		if (rc != -EFBIG)
			fail_msg("%ld: %d", (long)sizes[i], rc);
		assert_int_equal(err.code, EFBIG);
		assert_int_equal(access(FILE_NAME, F_OK), -1);
	}
}

GROUP(enter, leave);
