// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Variable projection: it goes downhill, finds planted premises, and its step solves the
 * projected problem.
 */
#include "../unit.h"
#include "../../../lib/learn/basis.h"
#include "../../../lib/base/random.h"
#include "../../../lib/learn/varpro.h"

#define PAIRS 300

static double rows[PAIRS * 3];
static const struct incise_ridge ridge = {1e-6, 1, 27, 9};

static void even(struct incise_basis *basis, enum incise_mf_type type)
{
	static const struct incise_variable in[] = {{"a", 0, 1}, {"b", 0, 1}};
	const int mfs[] = {3, 3};
	struct incise_model *model =
		incise_model_new_grid(2, in, mfs, type, &in[0], NULL);

	assert_int_equal(incise_basis_init(basis, model), 0);
	incise_model_free(model);
}

/* Pairs that the premises in basis explain without an error. */
static void plant(const struct incise_basis *basis)
{
	double consequents[27], w[9], f[9];
	uint64_t seed = 5;

	for (int k = 0; k < 27; k++)
		consequents[k] = incise_random_symmetric(&seed);
	for (int i = 0; i < PAIRS; i++) {
		double *x = rows + 3 * i;

		x[0] = (1 + incise_random_symmetric(&seed)) / 2;
		x[1] = (1 + incise_random_symmetric(&seed)) / 2;
		incise_basis_firing(basis, x, w);
		x[2] = incise_basis_output(basis, w, x, consequents, f);
	}
}

struct trace {
	int epochs;
	double last;
};

/* Penalised squared error, which never grows. */
static bool on_epoch(void *user, int epoch, const struct incise_basis *basis,
		     const double *consequents)
{
	struct trace *trace = user;
	double w[9], f[9], sum = 0;

	for (int i = 0; i < PAIRS; i++) {
		const double *x = rows + 3 * i;

		incise_basis_firing(basis, x, w);
		sum += pow(incise_basis_output(basis, w, x, consequents, f) - x[2], 2);
	}
	for (int k = 0; k < 27; k++)
		sum += ridge.ridge * consequents[k] * consequents[k];
	assert_int_equal(epoch, ++trace->epochs);
	if (epoch > 1)
		assert_true(sum < trace->last);
	trace->last = sum;
	return true;
}

TEST(test_finds_planted_premises)
{
	for (int type = 0; type < 2; type++) {
		struct incise_pairs pairs = {.rows = rows, .n = PAIRS, .n_inputs = 2};
		struct trace trace = {0};
		struct incise_basis basis, planted;
		struct incise_varpro varpro = {.pairs = &pairs,
					       .ridge = &ridge,
					       .epochs = 60,
					       .each = on_epoch,
					       .user = &trace};
		double consequents[27], first;

		even(&basis, type);
		planted = basis;
		incise_premises_jitter(&planted, 21);
		plant(&planted);
		varpro.epochs = 1;
		assert_int_equal(incise_varpro_run(&basis, consequents, &varpro), 0);
		first = trace.last;
		trace = (struct trace){0};
		varpro.epochs = 60;
		assert_int_equal(incise_varpro_run(&basis, consequents, &varpro), 0);
		assert_int_equal(varpro.run, trace.epochs);
		/* The data have no noise: what is left is the ridge, 1e-6·Σp² ≈ 1e-5. */
		assert_true(first > 1e-2 && trace.last < 1e-3 * first);
	}
}

/*
 * With μ → 0 and a start next to the minimum a Gauss–Newton step lands on it, up to second
 * order; a Jacobian of the wrong sign or of the unprojected problem would not. Here seen
 * as convergence: few epochs reduce the error by many orders.
 */
TEST(test_converges_fast_near_the_minimum)
{
	struct incise_pairs pairs = {.rows = rows, .n = PAIRS, .n_inputs = 2};
	struct trace trace = {0};
	struct incise_ridge tiny = {1e-12, 1, 27, 9};
	struct incise_basis basis, planted;
	struct incise_varpro varpro = {
		.pairs = &pairs, .ridge = &tiny, .epochs = 1, .each = on_epoch};
	double consequents[27], first, step[18];
	uint64_t seed = 2;

	varpro.user = &trace;
	even(&planted, INCISE_MF_GAUSS);
	incise_premises_jitter(&planted, 21);
	plant(&planted);
	for (int k = 0; k < 18; k++)
		step[k] = 0.01 * incise_random_symmetric(&seed);
	basis = planted;
	incise_premises_step(&basis, step);
	varpro.each = NULL;
	assert_int_equal(incise_varpro_run(&basis, consequents, &varpro), 0);
	trace = (struct trace){0};
	on_epoch(&trace, 1, &basis, consequents);
	first = trace.last;
	varpro.epochs = 12;
	assert_int_equal(incise_varpro_run(&basis, consequents, &varpro), 0);
	trace = (struct trace){0};
	on_epoch(&trace, 1, &basis, consequents);
	/* on_epoch() counts 1e-6·Σp² of ridge at both ends: take it off. */
	for (int k = 0; k < 27; k++)
		trace.last -= ridge.ridge * consequents[k] * consequents[k];
	assert_true(trace.last < 1e-3 * first);
}

static bool stop_at_3(void *user, int epoch, const struct incise_basis *basis,
		      const double *consequents)
{
	return epoch < 3;
}

TEST(test_ends_when_told)
{
	struct incise_pairs pairs = {.rows = rows, .n = PAIRS, .n_inputs = 2};
	struct incise_varpro varpro = {
		.pairs = &pairs, .ridge = &ridge, .epochs = 60, .each = stop_at_3};
	struct incise_basis basis, planted;
	double consequents[27];

	even(&basis, INCISE_MF_GAUSS);
	planted = basis;
	incise_premises_jitter(&planted, 21);
	plant(&planted);
	assert_int_equal(incise_varpro_run(&basis, consequents, &varpro), 0);
	assert_int_equal(varpro.run, 3);
}
