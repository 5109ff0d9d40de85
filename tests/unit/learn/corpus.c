// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A corpus: counts and ranges, the same sides and sample for any order and division of the
 * sources, and what is refused. Includes the source, to reach its parts.
 */
#include "../unit.h"
#include "../../../lib/learn/corpus.c"
#include "../cases.h"

#define SOURCES 3

struct made {
	struct incise_corpus_source source;
	char hash[65];
	int number, rows;
};

static int read_made(void *user, incise_row_taker take, void *taker,
		     struct incise_error *err)
{
	const struct made *made = user;
	int rc = 0;

	for (int i = 0; i < made->rows && !rc; i++) {
		uint64_t seed = (uint64_t)made->number * 1000003 + (uint64_t)i;
		double row[3];
		char cut[16];

		row[0] = 10 + 10 * incise_random_symmetric(&seed);
		row[1] = made->number;
		row[2] = row[0] / 10 + 0.1 * incise_random_symmetric(&seed);
		snprintf(cut, sizeof(cut), "%d", i / 500);
		rc = take(taker, row, cut, err);
	}
	return rc;
}

static void make(struct made *made, int number, bool own)
{
	*made = (struct made){.number = number, .rows = 10000 + 1000 * number};
	memset(made->hash, 'a' + number, 64);
	made->source = (struct incise_corpus_source){.name = "made",
						     .hash = made->hash,
						     .text = "made",
						     .group = "",
						     .own_groups = own,
						     .read = read_made,
						     .user = made};
}

static struct incise_corpus *survey(const int *order, int n, bool grouped, bool own)
{
	struct incise_corpus *corpus =
		incise_corpus_new(2, grouped, 7, INCISE_CORPUS_SAMPLE);

	for (int i = 0; i < n; i++) {
		struct made made;

		make(&made, order[i], own);
		assert_int_equal(incise_corpus_survey(corpus, &made.source, NULL), 0);
	}
	return corpus;
}

static void same(const struct incise_corpus *a, const struct incise_corpus *b)
{
	for (int side = 0; side < 2; side++) {
		const struct incise_corpus_side *p = incise_corpus_side(a, side);
		const struct incise_corpus_side *q = incise_corpus_side(b, side);

		assert_int_equal(p->rows, q->rows);
		assert_int_equal(p->n_groups, q->n_groups);
		assert_int_equal(p->sample.pairs.n, q->sample.pairs.n);
		assert_memory_equal(p->sample.pairs.rows, q->sample.pairs.rows,
				    p->sample.pairs.n * 3 * sizeof(double));
		if (p->sample.groups)
			assert_memory_equal(p->sample.groups, q->sample.groups,
					    p->sample.pairs.n * sizeof(int));
	}
}

/* Rows, cuts of each source, and cuts whose names mean the same in all sources. */
TEST(test_division)
{
	static const int one[] = {0, 1, 2}, other[] = {2, 0, 1};

	for (int kind = 0; kind < 3; kind++) {
		bool grouped = kind > 0, own = kind == 1;
		struct incise_corpus *a = survey(one, SOURCES, grouped, own);
		struct incise_corpus *b = survey(other, SOURCES, grouped, own);
		struct incise_corpus *c = survey(one + 1, 2, grouped, own);
		struct incise_corpus *d = survey(one, 1, grouped, own);
		const struct incise_corpus_side *fit, *check;
		double min[3], max[3];
		size_t size;
		void *bytes = incise_corpus_encode(d, &size);

		assert_int_equal(incise_corpus_add(c, bytes, size, NULL), 0);
		assert_int_equal(incise_corpus_add(d, bytes, size, NULL), -EEXIST);
		for (size_t short_by = 1; short_by < size; short_by += 9973)
			assert_int_equal(incise_corpus_add(d, bytes, size - short_by,
							   NULL),
					 -EINVAL);
		assert_int_equal(incise_corpus_settle(a, 0.3, NULL), 0);
		assert_int_equal(incise_corpus_settle(b, 0.3, NULL), 0);
		assert_int_equal(incise_corpus_settle(c, 0.3, NULL), 0);
		same(a, b);
		same(a, c);
		fit = incise_corpus_side(a, false);
		check = incise_corpus_side(a, true);
		assert_int_equal(fit->rows + check->rows, 33000);
		if (!grouped)
			assert_in_range(check->rows, 9890, 9910); /* bins */
		else
			assert_in_range(check->rows, 9000, 10800);
		assert_int_equal(fit->n_groups + check->n_groups, !grouped ? 0
								  : own	   ? 66
									   : 24);
		assert_int_equal(fit->sample.pairs.n + check->sample.pairs.n,
				 INCISE_CORPUS_SAMPLE);
		incise_corpus_ranges(a, min, max);
		assert_true(min[0] < 0.1 && max[0] > 19.9);
		assert_true(min[1] == 0 && max[1] == 2);
		free(bytes);
		incise_corpus_free(a);
		incise_corpus_free(b);
		incise_corpus_free(c);
		incise_corpus_free(d);
	}
}

/* Rows of a table in memory; groups by number, or NULL. */
struct table {
	struct incise_corpus_source source;
	char hash[65];
	double rows[400][5]; /* the last two are further inputs */
	int group[400], n;
};

static int read_table(void *user, incise_row_taker take, void *taker,
		      struct incise_error *err)
{
	const struct table *table = user;
	int rc = 0;

	for (int i = 0; i < table->n && !rc; i++) {
		char cut[16];

		snprintf(cut, sizeof(cut), "%d", table->group[i]);
		rc = take(taker, table->rows[i], cut, err);
	}
	return rc;
}

static void make_table(struct table *table, int number)
{
	memset(table->hash, 'a' + number, 64);
	table->hash[64] = table->n = 0;
	table->source = (struct incise_corpus_source){.name = "table",
						      .hash = table->hash,
						      .text = "table",
						      .group = "",
						      .read = read_table,
						      .user = table};
}

/* Number of the different row, and its group. */
static int number_of(const double *row)
{
	return (int)lround(row[1]);
}

/*
 * Different rows, each repeated by chance in two sources: equal ones count once, are in the sample
 * once, and are on one side without groups.
 */
TEST(test_repeated_rows)
{
	static struct table table[2];
	uint64_t seed = cases_seed(5);

	for (int c = 0; c < cases_of(400, 40); c++) {
		int different =
			2 + (int)(incise_random_uniform(seed + (uint64_t)c, 0) * 80);
		bool grouped = c % 2;
		struct incise_corpus *corpus[2];
		const struct incise_corpus_side *side[2];
		uint64_t times[100] = {0}, rows = 0, found[2] = {0};
		int seen[100] = {0};

		make_table(&table[0], 0);
		make_table(&table[1], 1);
		for (int i = 0; i < 600 && rows < 700; i++) {
			double u = incise_random_uniform(seed + (uint64_t)c,
							 (uint64_t)i + 1);
			int k = i < different ? i : (int)(u * different);
			struct table *to = &table[(int)(u * 1024) % 2];

			if (to->n == 400)
				continue;
			to->group[to->n] = k % 7;
			memcpy(to->rows[to->n++],
			       (double[]){k ? k * 0.1 : -0.0 * u, k, 1},
			       3 * sizeof(double));
			times[k]++;
			rows++;
		}
		for (int way = 0; way < 2; way++) {
			corpus[way] = incise_corpus_new(2, grouped, (uint64_t)c, 1000);
			for (int i = 0; i < 2; i++)
				assert_int_equal(incise_corpus_survey(
							 corpus[way],
							 &table[way ? 1 - i : i].source,
							 NULL),
						 0);
			assert_int_equal(incise_corpus_settle(corpus[way], 0.3, NULL), 0);
		}
		same(corpus[0], corpus[1]);
		for (int s = 0; s < 2; s++) {
			side[s] = incise_corpus_side(corpus[0], s);
			assert_int_equal(side[s]->different, side[s]->sample.pairs.n);
			for (size_t i = 0; i < side[s]->sample.pairs.n; i++) {
				int k = number_of(side[s]->sample.pairs.rows + 3 * i);

				assert_int_equal(seen[k]++, 0);
				found[s] += times[k];
			}
			assert_int_equal(side[s]->rows, found[s]);
			assert_true(found[s] > 0);
		}
		assert_int_equal(found[0] + found[1], rows);
		assert_int_equal(side[0]->different + side[1]->different, different);
		incise_corpus_free(corpus[0]);
		incise_corpus_free(corpus[1]);
	}
}

/* Beyond the sample the number of different rows is an estimate: to 4 sd of its 1/sqrt(1000). */
TEST(test_estimated_different)
{
	static struct table table;
	struct incise_corpus *corpus = incise_corpus_new(2, false, 1, 1000);
	const struct incise_corpus_side *side;

	for (int s = 0; s < 26; s++) {
		make_table(&table, s);
		for (table.n = 0; table.n < 400; table.n++)
			memcpy(table.rows[table.n], (double[]){s / 2, table.n % 200, 0},
			       3 * sizeof(double));
		if (s < 6)
			memset(table.hash, 'a' + s, 64);
		else
			memset(table.hash, '0' + s % 10, 64 - (size_t)s / 10);
		assert_int_equal(incise_corpus_survey(corpus, &table.source, &err), 0);
	}
	assert_int_equal(incise_corpus_settle(corpus, 0, NULL), 0);
	side = incise_corpus_side(corpus, false);
	assert_int_equal(side->rows, 26 * 400);
	assert_int_equal(side->sample.pairs.n, 1000);
	assert_in_range(side->different, 2600 * 87 / 100, 2600 * 113 / 100);
	incise_corpus_free(corpus);
}

/*
 * A gap of a further input anywhere, in the sample of 20 rows or not, held out or not, leaves that
 * input out; also in surveys of another process.
 */
TEST(test_gap_of_a_further_input)
{
	static struct table table;

	for (int gap = -1; gap < 400; gap += 1 + 400 / cases_of(401, 40)) {
		struct incise_corpus *corpus = incise_corpus_new(2, true, 1, 20);
		struct incise_corpus *other = incise_corpus_new(2, true, 1, 20);
		size_t size;
		void *bytes;

		make_table(&table, 0);
		for (table.n = 0; table.n < 400; table.n++) {
			memcpy(table.rows[table.n],
			       (double[]){table.n, 1, 1, 1, table.n == gap ? NAN : 1},
			       sizeof(*table.rows));
			table.group[table.n] = table.n / 40;
		}
		incise_corpus_keep(corpus, 3, 2);
		assert_int_equal(incise_corpus_survey(corpus, &table.source, &err), 0);
		bytes = incise_corpus_encode(corpus, &size);
		assert_int_equal(incise_corpus_add(other, bytes, size, &err), 0);
		incise_corpus_free(corpus);
		assert_int_equal(incise_corpus_settle(other, 0.3, &err), 0);
		for (int i = 0; i < 2; i++) {
			double *extended = incise_corpus_extend(other, i);

			assert_int_equal(!extended, i == 1 && gap >= 0);
			free(extended);
		}
		free(bytes);
		incise_corpus_free(other);
	}
}

/* Another value, another order or another group in the second reading is an error. */
TEST(test_changed_between_readings)
{
	static struct table table;
	struct incise_variable inputs[] = {{"a", 0, 20}, {"b", 0, 20}},
			       out = {"c", -1, 3};
	const int n_mfs[] = {2, 2};
	struct incise_model *model =
		incise_model_new_grid(2, inputs, n_mfs, INCISE_MF_GAUSS, &out, NULL);

	for (int change = 0; change < 4; change++) {
		struct incise_corpus *corpus = incise_corpus_new(2, true, 1, 10);
		struct incise_factor *fit = incise_factor_new(model, NULL);

		make_table(&table, 0);
		for (table.n = 0; table.n < 100; table.n++) {
			memcpy(table.rows[table.n],
			       (double[]){table.n * 0.1, table.n * 0.2, table.n * 0.02},
			       3 * sizeof(double));
			table.group[table.n] = table.n / 10;
		}
		assert_int_equal(incise_corpus_survey(corpus, &table.source, NULL), 0);
		assert_int_equal(incise_corpus_settle(corpus, 0, NULL), 0);
		if (change == 1)
			table.rows[50][2] = nextafter(table.rows[50][2], 2);
		if (change == 2)
			for (int i = 0; i < 3; i++) {
				double held = table.rows[51][i];

				table.rows[51][i] = table.rows[52][i];
				table.rows[52][i] = held;
			}
		if (change == 3)
			table.group[59] = 6;
		if (change)
			assert_error(incise_corpus_fold(corpus, &table.source, fit, NULL,
							&err),
				     ESTALE, &err, "table", "changed while it was read");
		else
			assert_int_equal(incise_corpus_fold(corpus, &table.source, fit,
							    NULL, NULL),
					 0);
		incise_factor_free(fit);
		incise_corpus_free(corpus);
	}
	incise_model_free(model);
}

TEST(test_refused)
{
	static const int one[] = {0, 1};
	struct incise_corpus *corpus = survey(one, 1, true, true);
	struct incise_variable inputs[] = {{"a", 0, 20}, {"b", 0, 2}}, out = {"c", -1, 3};
	const int n_mfs[] = {2, 2};
	struct incise_model *model =
		incise_model_new_grid(2, inputs, n_mfs, INCISE_MF_GAUSS, &out, NULL);
	struct incise_factor *fit = incise_factor_new(model, NULL);
	struct made made;

	make(&made, 0, true);
	assert_int_equal(incise_corpus_survey(corpus, &made.source, &err), -EEXIST);
	assert_int_equal(incise_corpus_settle(corpus, 0, &err), 0);
	made.rows--;
	assert_int_equal(incise_corpus_fold(corpus, &made.source, fit, NULL, &err),
			 -ESTALE);
	incise_corpus_free(corpus);
	corpus = incise_corpus_new(2, true, 1, 10);
	assert_int_equal(incise_corpus_settle(corpus, 0, &err), -ENODATA);
	incise_corpus_free(corpus);
	incise_factor_free(fit);
	incise_model_free(model);
}
