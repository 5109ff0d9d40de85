// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Reading a dataset from an Arrow stream: types, offsets, nulls, dictionaries, several batches;
 * errors name row and column, and the stream is released in any case.
 */
#include "../unit.h"
#include <incise/arrow.h>
#include <incise/dataset.h>

#define COLUMNS 4
#define BATCHES 2

/* A stream that lies in a test's memory: columns, and the same in each batch. */
struct made {
	struct ArrowSchema schema, columns[COLUMNS], dictionary_schema;
	struct ArrowArray arrays[COLUMNS], dictionary;
	int n_columns, batches, given;
	int64_t rows, offset; /* of a batch, and of its struct */
	int fails;	      /* errno of get_next() */
	bool released;
};

static void no_release_schema(struct ArrowSchema *schema)
{
	schema->release = NULL;
}

static void no_release_array(struct ArrowArray *array)
{
	array->release = NULL;
}

static int get_schema(struct ArrowArrayStream *stream, struct ArrowSchema *out)
{
	static struct ArrowSchema *children[COLUMNS];
	struct made *made = stream->private_data;

	for (int i = 0; i < made->n_columns; i++)
		children[i] = &made->columns[i];
	*out = made->schema;
	if (!out->format)
		out->format = "+s";
	out->n_children = made->n_columns;
	out->children = children;
	out->release = no_release_schema;
	return 0;
}

static int get_next(struct ArrowArrayStream *stream, struct ArrowArray *out)
{
	static const void *none[1];
	static struct ArrowArray *children[COLUMNS];
	struct made *made = stream->private_data;

	if (made->fails)
		return made->fails;
	*out = (struct ArrowArray){0};
	if (made->given++ == made->batches)
		return 0;
	for (int i = 0; i < made->n_columns; i++)
		children[i] = &made->arrays[i];
	*out = (struct ArrowArray){
		.length = made->rows,
		.offset = made->offset,
		.n_buffers = 1,
		.buffers = none,
		.n_children = made->n_columns,
		.children = children,
		.release = no_release_array,
	};
	return 0;
}

static const char *get_last_error(struct ArrowArrayStream *stream)
{
	return "it broke";
}

static void release(struct ArrowArrayStream *stream)
{
	((struct made *)stream->private_data)->released = true;
	stream->release = NULL;
}

static void add_column(struct made *made, const char *name, const char *format,
		       const void **buffers, int64_t offset, int64_t nulls)
{
	made->columns[made->n_columns] =
		(struct ArrowSchema){.format = format, .name = name};
	made->arrays[made->n_columns++] = (struct ArrowArray){
		.length = made->rows,
		.offset = offset,
		.null_count = nulls,
		.buffers = buffers,
	};
}

static const char *const wanted[] = {"force_N", "depth_mm"};

static struct incise_dataset *read_made(struct made *made, const char *group,
					const char *where, size_t *left_out,
					struct incise_error *err)
{
	struct ArrowArrayStream stream = {get_schema, get_next, get_last_error, release,
					  made};
	struct incise_dataset *data = incise_dataset_from_arrow(&stream, wanted, 2, group,
								where, left_out, err);

	assert_true(made->released);
	return data;
}

/* Two columns of numbers, as most cases have. */
static const double forces[] = {0.5, 1, 1.5, 2};
static const float depths[] = {9, 1, 2, 3, 4};
static const void *force_buffers[] = {NULL, forces}, *depth_buffers[] = {NULL, depths};

static struct made pairs(void)
{
	struct made made = {.rows = 3, .batches = BATCHES};

	add_column(&made, "depth_mm", "f", depth_buffers, 1, 0);
	add_column(&made, "force_N", "g", force_buffers, 0, 0);
	return made;
}

TEST(numbers_of_batches)
{
	struct made made = pairs();
	struct incise_dataset *data = read_made(&made, NULL, "advancing", NULL, NULL);

	assert_non_null(data);
	assert_int_equal(incise_dataset_rows(data), 6);
	for (int i = 0; i < 6; i++) {
		assert_true(incise_dataset_row(data, i)[0] == forces[i % 3]);
		assert_true(incise_dataset_row(data, i)[1] == depths[1 + i % 3]);
		assert_int_equal(incise_dataset_group(data, i), -1);
	}
	incise_dataset_free(data);
	/* the table's own offset comes on top of a column's */
	made = pairs();
	made.offset = 1;
	made.batches = 1;
	data = read_made(&made, NULL, NULL, NULL, NULL);
	assert_int_equal(incise_dataset_rows(data), 3);
	assert_true(incise_dataset_row(data, 0)[0] == forces[1]);
	assert_true(incise_dataset_row(data, 2)[1] == depths[4]);
	incise_dataset_free(data);
}

TEST(each_type_of_number)
{
	static const union {
		int8_t c[2];
		uint8_t C[2];
		int16_t s[2];
		uint16_t S[2];
		int32_t i[2];
		uint32_t I[2];
		int64_t l[2];
		uint64_t L[2];
		float f[2];
		double g[2];
	} values[] = {
		{.c = {0, -7}},		  {.C = {0, 200}},	  {.s = {0, -700}},
		{.S = {0, 60000}},	  {.i = {0, -70000}},	  {.I = {0, 4000000000U}},
		{.l = {0, -(1LL << 40)}}, {.L = {0, 1ULL << 40}}, {.f = {0, 0.5F}},
		{.g = {0, 0.1}},	  {.C = {2, 0}},
	};
	static const double expected[] = {-7,	   200,	   -700, 60000, -70000, 4e9,
					  -0x1p40, 0x1p40, 0.5,	 0.1,	1};
	static const char formats[][2] = {"c", "C", "s", "S", "i", "I",
					  "l", "L", "f", "g", "b"};

	for (int i = 0; i < 11; i++) {
		const void *buffers[] = {NULL, &values[i]};
		struct made made = {.rows = 1, .batches = 1};
		struct incise_dataset *data;

		add_column(&made, "force_N", formats[i], buffers, 1, 0);
		add_column(&made, "depth_mm", "f", depth_buffers, 0, 0);
		data = read_made(&made, NULL, NULL, NULL, NULL);
		assert_non_null(data);
		assert_true(incise_dataset_row(data, 0)[0] == expected[i]);
		incise_dataset_free(data);
	}
}

TEST(groups_by_text_number_and_dictionary)
{
	static const int32_t offsets[] = {0, 1, 3, 4}, places[] = {1, 0, 1};
	static const int64_t long_offsets[] = {0, 1, 3, 4}, numbers[] = {12, -1, 12};
	const void *text[] = {NULL, offsets, "abba"},
		   *large[] = {NULL, long_offsets, "abba"};
	const void *number[] = {NULL, numbers}, *index[] = {NULL, places};
	const struct {
		const char *format;
		const void **buffers;
		bool dictionary;
	} cases[] = {
		{"u", text, false},
		{"U", large, false},
		{"l", number, false},
		{"i", index, true},
	};

	for (int c = 0; c < 4; c++) {
		struct made made = pairs();
		struct incise_dataset *data;

		made.batches = 1;
		add_column(&made, "cut", cases[c].format, cases[c].buffers, 0, 0);
		if (cases[c].dictionary) {
			made.dictionary_schema = (struct ArrowSchema){.format = "u"};
			made.dictionary =
				(struct ArrowArray){.length = 2, .buffers = text};
			made.columns[2].dictionary = &made.dictionary_schema;
			made.arrays[2].dictionary = &made.dictionary;
		}
		data = read_made(&made, "cut", NULL, NULL, NULL);
		assert_non_null(data);
		for (int i = 0; i < 3; i++)
			assert_int_equal(incise_dataset_group(data, i), i == 1);
		incise_dataset_free(data);
	}
}

TEST(rows_are_left_out_where_asked)
{
	static const uint8_t advancing[] = {5};
	const void *buffers[] = {NULL, advancing};
	struct made made = pairs();
	struct incise_dataset *data;
	size_t left_out;

	add_column(&made, "advancing", "b", buffers, 0, 0);
	data = read_made(&made, NULL, "advancing", &left_out, NULL);
	assert_int_equal(incise_dataset_rows(data), 4);
	assert_int_equal(left_out, 2);
	assert_true(incise_dataset_row(data, 1)[0] == forces[2]);
	incise_dataset_free(data);
}

TEST(refuses_two_columns_of_a_name)
{
	const void *buffers[] = {NULL, forces};
	struct made made = pairs();

	add_column(&made, "force_N", "g", buffers, 0, 0);
	assert_error(read_made(&made, NULL, NULL, NULL, &err), EINVAL, &err,
		     "column force_N", "twice");
	assert_true(made.released);
}

TEST(refuses_what_is_no_number)
{
	static const double bad[] = {1, NAN, 2};
	static const uint8_t valid[] = {5}, none[] = {0};
	static const int32_t offsets[] = {0, 1, 2, 3}, torn[] = {0, 2, 1, 3};
	static const int32_t outside[] = {0, 7, 0};
	const void *nan[] = {NULL, bad}, *null[] = {valid, forces}, *no[] = {NULL, none};
	const void *text[] = {NULL, offsets, "abc"}, *broken[] = {NULL, torn, "abc"};
	const void *index[] = {NULL, outside};
	const struct {
		const char *format; /* of a column force_N */
		const void **buffers;
		int64_t nulls;
		const char *group_format; /* of a column cut; NULL: none is asked for */
		const void **group;
		bool dictionary;
		int fails, code;
		const char *said;
	} cases[] = {
		{"g", nan, 0, NULL, NULL, false, 0, EINVAL, "row 1, column force_N"},
		{"g", null, 1, NULL, NULL, false, 0, EINVAL, "row 1, column force_N"},
		{"u", text, 0, NULL, NULL, false, 0, EINVAL, "column force_N"},
		{"d:3,1", text, 0, NULL, NULL, false, 0, EINVAL, "column force_N"},
		{NULL, NULL, 0, NULL, NULL, false, 0, EINVAL, "'force_N'"},
		{"g", force_buffers, 0, "g", force_buffers, false, 0, EINVAL,
		 "column cut"},
		{"g", force_buffers, 0, "u", broken, false, 0, EINVAL,
		 "row 1, column cut"},
		{"g", force_buffers, 0, "i", index, true, 0, EINVAL, "row 1, column cut"},
		{"g", force_buffers, 0, NULL, NULL, false, EIO, EIO, "it broke"},
		{"b", no, 0, NULL, NULL, false, 0, ENODATA, "6 rows"},
	};

	for (size_t c = 0; c < sizeof(cases) / sizeof(*cases); c++) {
		struct made made = {
			.rows = 3, .batches = BATCHES, .fails = cases[c].fails};
		struct incise_error err = {0};

		add_column(&made, "depth_mm", "f", depth_buffers, 0, 0);
		if (cases[c].format)
			add_column(&made, "force_N", cases[c].format, cases[c].buffers, 0,
				   cases[c].nulls);
		if (cases[c].group_format)
			add_column(&made, "cut", cases[c].group_format, cases[c].group, 0,
				   0);
		if (cases[c].dictionary) {
			made.dictionary_schema = (struct ArrowSchema){.format = "u"};
			made.dictionary =
				(struct ArrowArray){.length = 2, .buffers = text};
			made.columns[2].dictionary = &made.dictionary_schema;
			made.arrays[2].dictionary = &made.dictionary;
		}
		assert_null(read_made(&made, cases[c].group_format ? "cut" : NULL,
				      cases[c].code == ENODATA ? "force_N" : NULL, NULL,
				      &err));
		assert_int_equal(err.code, cases[c].code);
		assert_says(err.text, cases[c].said);
	}
}

TEST(an_empty_stream_has_no_rows)
{
	struct made made = pairs();

	made.batches = 0;
	assert_null(read_made(&made, NULL, NULL, NULL, NULL));
	assert_int_equal(errno, ENODATA);
	made = pairs();
	made.schema.format = "g";
	assert_null(read_made(&made, NULL, NULL, NULL, NULL));
	assert_int_equal(errno, EINVAL);
}
