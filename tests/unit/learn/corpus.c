// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A corpus: counts and ranges, the same sides and sample for any order and division of the
 * sources, and what is refused. Includes the source, to reach its parts.
 */
#include "../unit.h"
#include "../../../lib/learn/corpus.c"

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
			assert_int_equal(check->rows, 9900);
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

TEST(test_refused)
{
	static const int one[] = {0, 1};
	struct incise_corpus *corpus = survey(one, 1, true, true);
	struct incise_variable inputs[] = {{"a", 0, 20}, {"b", 0, 2}}, out = {"c", -1, 3};
	const int n_mfs[] = {2, 2}, stop = 1;
	struct incise_model *model =
		incise_model_new_grid(2, inputs, n_mfs, INCISE_MF_GAUSS, &out, NULL);
	struct incise_factor *fit = incise_factor_new(model, NULL);
	struct made made;

	make(&made, 0, true);
	assert_int_equal(incise_corpus_survey(corpus, &made.source, &err), -EEXIST);
	assert_int_equal(incise_corpus_settle(corpus, 0, &err), 0);
	made.rows--;
	assert_int_equal(incise_corpus_fold(corpus, &made.source, fit, NULL, NULL, &err),
			 -ESTALE);
	incise_corpus_set_stop(corpus, &stop);
	make(&made, 1, true);
	assert_int_equal(incise_corpus_survey(corpus, &made.source, &err), -ECANCELED);
	assert_int_equal(incise_corpus_fold(corpus, &made.source, fit, NULL, NULL, &err),
			 -ECANCELED);
	incise_corpus_free(corpus);
	corpus = incise_corpus_new(2, true, 1, 10);
	assert_int_equal(incise_corpus_settle(corpus, 0, &err), -ENODATA);
	incise_corpus_free(corpus);
	incise_factor_free(fit);
	incise_model_free(model);
}
