// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/batch.c: bytes as in incise-recording(5); random batches come back bit by bit, and forged
 * ones are in ../../fuzz/block.c. And of lib/record/read/source.c: formats 4 and 5 give one thing.
 */
#include "../unit.h"
#include "recorded.h"
#include "../cases.h"
#include "../../../lib/base/random.h"
#include "../../../lib/record/batch.h"
#include "../../../lib/record/read/source.h"

#define DB "a.rec/recording.db"

static uint64_t key, drawn;

static uint64_t draw(void)
{
	return incise_random_bits(key, drawn++);
}

/* A column is like what devices give, or like nothing: constant, near a line, narrow, any. */
static int64_t draw_integer(int kind, int64_t base, size_t k)
{
	const uint64_t any = draw();

	switch (kind) {
	case 0:
		return base;
	case 1:
		return (int64_t)((uint64_t)base + k * 100000);
	case 2:
		return (int64_t)((uint64_t)base + k * 8333333 + any % 5000);
	case 3:
		return (int64_t)(any % 4096);
	case 4:
		return (int64_t)((uint64_t)base + any % 70000);
	default:
		return (int64_t)any;
	}
}

static double draw_real(int kind, size_t k, bool missing)
{
	const uint64_t any = draw();
	double value;

	if (missing && any % 5 == 0)
		return NAN;
	switch (kind) {
	case 0:
		return -0.0;
	case 1:
		return (double)(k / 4) * 0.25;
	case 2:
		return (float)incise_random_uniform(key, any);
	default:
		memcpy(&value, &any, sizeof(value));
		return isfinite(value) ? value : 1e-300;
	}
}

/* @n rows, numbers increasing with gaps or without. */
static void fill(struct incise_batch *batch, size_t n)
{
	const bool gaps = draw() % 2;
	int64_t seq = (int64_t)(draw() % (1ULL << 60));

	assert_true(incise_batch_reserve(batch, n));
	batch->n = n;
	for (int i = 0; batch->form->types[i]; i++) {
		const int kind = (int)(draw() % 6);
		const int64_t base = (int64_t)(draw() >> draw() % 64);
		const bool same = draw() % 3 == 0;

		for (size_t k = 0; k < n; k++) {
			union incise_column *column = &batch->column[i];
			const uint64_t any = same ? 7 : draw();

			switch (batch->form->types[i]) {
			case 'i':
				column->i[k] = draw_integer(kind, base, k);
				break;
			case 'r':
			case 'n':
				column->r[k] =
					draw_real(kind, k, batch->form->types[i] == 'n');
				break;
			case 'c':
				column->c[k] = (char)any;
				break;
			case 's':
				memset(column->s[k], 0, sizeof(*column->s));
				memset(column->s[k], 'a' + (int)(any % 26), any % 24);
				break;
			default:
				memset(column->h[k], (int)any, sizeof(*column->h));
			}
		}
	}
	/* Times are of 73 years. */
	for (size_t k = 0; k < n; k++)
		batch->column[1].i[k] /= 5;
	for (size_t k = 0; k < n; k++, seq += gaps && draw() % 9 == 0 ? 5 : 1)
		batch->column[0].i[k] = seq;
}

static struct incise_ledger_block block_of(const struct incise_batch *batch)
{
	return (struct incise_ledger_block){
		.first_seq = batch->column[0].i[0],
		.last_seq = batch->column[0].i[batch->n - 1],
		.first_ns = batch->column[1].i[0],
		.last_ns = batch->column[1].i[batch->n - 1],
		.count = (int64_t)batch->n,
	};
}

static size_t size_of(char type)
{
	return type == 'c' ? 1 : type == 's' ? 24 : type == 'h' ? 32 : 8;
}

/* Bit by bit, but that all NaN are one. */
static void compare(const struct incise_batch *a, const struct incise_batch *b)
{
	assert_int_equal(a->n, b->n);
	for (int i = 0; a->form->types[i]; i++) {
		const char type = a->form->types[i];

		for (size_t k = 0; k < a->n; k++)
			if ((type == 'r' || type == 'n') && isnan(a->column[i].r[k]))
				assert_true(isnan(b->column[i].r[k]));
			else
				assert_memory_equal(
					(char *)a->column[i].any + k * size_of(type),
					(char *)b->column[i].any + k * size_of(type),
					size_of(type));
	}
}

TEST(a_block_is_of_these_bytes)
{
	/* numbers 5, 6, 8; times from 100 on; codes from 1000 on */
	static const uint8_t expected[] = {
		0, 5, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0,	 0,  1, 100, 0,
		0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 11, 20, 2, 232, 3,
		0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,	 44, 1, 1,   0,
	};
	struct incise_batch batch = {.form = &incise_ledger_forms[INCISE_LEDGER_FORCE]},
			    again = {.form = batch.form};
	static const int64_t rows[3][3] = {
		{5, 100, 1000}, {6, 111, 1300}, {8, 120, 1001}};
	uint8_t data[200];
	struct incise_ledger_block block;
	size_t n;

	assert_true(incise_batch_reserve(&batch, 3));
	for (batch.n = 0; batch.n < 3; batch.n++)
		for (int i = 0; i < 3; i++)
			batch.column[i].i[batch.n] = rows[batch.n][i];
	n = incise_batch_encode(&batch, data);
	block = block_of(&batch);
	assert_null(incise_batch_decode(&again, &block, data, n));
	compare(&batch, &again);
	/* 5 + floor(3 k / 2) is 5, 6, 8: nothing is left */
	assert_int_equal(n, sizeof(expected));
	assert_memory_equal(data, expected, n);
	incise_batch_free(&batch);
	incise_batch_free(&again);
}

/* Batches of all streams; what is cut off, longer, or has another end is refused. */
TEST(random_batches_come_back)
{
	const int cases = cases_of(20000, 1000);

	key = incise_random_key(cases_seed(5), 0);
	for (int c = 0; c < cases; c++) {
		const int stream = (int)(draw() % INCISE_LEDGER_FORMS);
		struct incise_batch batch = {.form = &incise_ledger_forms[stream]},
				    again = {.form = batch.form};
		struct incise_ledger_block block;
		size_t bound, n;
		uint8_t *data;

		fill(&batch, 1 + draw() % (c % 50 ? 40 : 3000));
		bound = incise_batch_bound(&batch);
		data = malloc(bound + 1);
		n = incise_batch_encode(&batch, data);
		assert_true(n <= bound);
		block = block_of(&batch);
		if (incise_batch_decode(&again, &block, data, n))
			fail_msg("case %d: %s", c,
				 incise_batch_decode(&again, &block, data, n));
		compare(&batch, &again);
		assert_non_null(incise_batch_decode(&again, &block, data, n - 1));
		assert_non_null(incise_batch_decode(&again, &block, data, n + 1));
		assert_int_equal(again.n, 0);
		block.last_ns++;
		assert_non_null(incise_batch_decode(&again, &block, data, n));
		free(data);
		incise_batch_free(&batch);
		incise_batch_free(&again);
	}
}

/* Samples of all streams of two recordings are the same to the bit, however they are batched. */
TEST(older_formats_give_the_same_samples, IN_FOLDER)
{
	struct incise_recording *now, *before;

	record("a.rec", SHORT_SCRIPT, 5000 * MS);
	assert_int_equal(system("cp -r a.rec b.rec"), 0);
	change("b.rec/recording.db", TO_FORM_4);
	now = open_recording("a.rec");
	before = open_recording("b.rec");
	assert_int_equal(before->form, 4);
	for (int stream = 0; stream <= INCISE_SOURCE_DEPTH; stream++) {
		struct incise_source a, b;
		size_t rows = 0, at = 0;

		succeeds(!incise_source_open(&a, now, stream, &err) &&
			 !incise_source_open(&b, before, stream, &err));
		while (incise_source_next(&a, &err) > 0)
			for (size_t k = 0; k < a.batch.n; k++, rows++, at++) {
				if (!rows || at == b.batch.n) {
					assert_int_equal(incise_source_next(&b, &err), 1);
					at = 0;
				}
				for (int i = 0; a.batch.form->types[i]; i++) {
					size_t size = size_of(a.batch.form->types[i]);

					assert_memory_equal(
						(char *)a.batch.column[i].any + k * size,
						(char *)b.batch.column[i].any + at * size,
						size);
				}
			}
		assert_int_equal(incise_source_next(&b, &err), 0);
		assert_int_equal(rows, stream == INCISE_LEDGER_FORCE ? 50000
				       : stream == INCISE_LEDGER_TRACKER ||
						       stream == INCISE_SOURCE_DEPTH
					       ? 600
					       : 0);
		incise_source_close(&a);
		incise_source_close(&b);
	}
	incise_recording_close(now);
	incise_recording_close(before);
}

/* A damaged block is one error, and those behind it are read. */
TEST(behind_a_damaged_block_reading_goes_on, IN_FOLDER)
{
	struct incise_recording *recording;
	struct incise_source source;
	size_t rows = 0;
	int errors = 0, rc;

	record("a.rec", SHORT_SCRIPT, 1000 * MS);
	change(DB,
	       "UPDATE blocks SET data = substr(data, 1, 50) WHERE stream = 'force' AND "
	       "block IN (2, 5)");
	recording = open_recording("a.rec");
	succeeds(!incise_source_open(&source, recording, INCISE_LEDGER_FORCE, &err));
	while ((rc = incise_source_next(&source, &err)) != 0) {
		rows += rc > 0 ? source.batch.n : 0;
		errors += rc < 0;
		if (rc < 0)
			assert_says(err.text, errors == 1 ? "stream force, block 2"
							  : "stream force, block 5");
	}
	assert_int_equal(errors, 2);
	assert_int_equal(rows, 8000);
	incise_source_close(&source);
	/* from a number on */
	succeeds(!incise_source_open_at(&source, recording, INCISE_LEDGER_FORCE, 7500,
					&err));
	assert_int_equal(incise_source_next(&source, &err), 1);
	assert_int_equal(source.batch.column[0].i[0], 7000);
	incise_source_close(&source);
	incise_recording_close(recording);
}
