// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Jang's engine: its gradient against finite differences, and which epoch it keeps. What
 * it computes is held against published tables in train.c.
 */
#include "../unit.h"
#include "../../../lib/learn/anfis.h"
#include "../../../lib/learn/pairs.h"
#include "../model/paper_model.h"

#define PAIRS 150

static double rows[PAIRS * 3];

static void fill(void)
{
	uint64_t seed = 11;

	for (int i = 0; i < PAIRS; i++) {
		rows[3 * i] = 10 + 10 * paper_random(&seed);
		rows[3 * i + 1] = 25 + 25 * paper_random(&seed);
		rows[3 * i + 2] = sin(rows[3 * i] / 4) + cos(rows[3 * i + 1] / 9) +
				  0.1 * paper_random(&seed);
	}
}

static double squared_error(const struct incise_model *model,
			    const struct incise_pairs *pairs)
{
	double rmse = incise_pairs_rmse(model, pairs, false);

	return rmse * rmse * pairs->n;
}

/*
 * One epoch moves the premises by a step of length k against the gradient, consequents
 * held. So (moved - before)/k must be the direction that finite differences find.
 */
TEST(test_gradient)
{
	struct incise_pairs pairs = {.rows = rows, .n = PAIRS, .n_inputs = 2};

	fill();
	for (int type = 0; type < 2; type++) {
		struct incise_model *model = paper_model(type, 3, 1);
		struct incise_anfis anfis = {
			.train = &pairs, .ridge = 0.1, .step = 1e-4, .epochs = 2};
		int n_params = type == INCISE_MF_GAUSS ? 2 : 3, n = 0;
		double want[9 * 3], moved[9 * 3], norm = 0, dot = 0;
		struct incise_model *fixed;

		paper_disturb(model, 4, 0.2);
		/* The consequents of epoch 1, at the first premises. */
		fixed = incise_model_copy(model);
		anfis.epochs = 1;
		assert_int_equal(incise_anfis_run(fixed, &anfis), 0);
		/* The premises of epoch 2, which is the better one, are those after one move. */
		anfis.epochs = 2;
		struct incise_model *after = incise_model_copy(model);

		assert_int_equal(incise_anfis_run(after, &anfis), 0);
		assert_int_equal(anfis.best_epoch, 2);
		for (int i = 0; i < 2; i++)
			for (int k = 0; k < incise_model_info(model)->n_mfs[i]; k++)
				for (int j = 0; j < n_params; j++, n++) {
					double p[4], h, up, down;

					memcpy(p, incise_model_mf(model, i, k)->p,
					       sizeof(p));
					moved[n] =
						incise_model_mf(after, i, k)->p[j] - p[j];
					h = 1e-5 * fmax(fabs(p[j]), 1);
					p[j] += h;
					incise_model_set_mf(fixed, i, k, p);
					up = squared_error(fixed, &pairs);
					p[j] -= 2 * h;
					incise_model_set_mf(fixed, i, k, p);
					down = squared_error(fixed, &pairs);
					p[j] += h;
					incise_model_set_mf(fixed, i, k, p);
					want[n] = (up - down) / (2 * h);
					norm = hypot(norm, want[n]);
				}
		for (int m = 0; m < n; m++) {
			/* Central differences with h = 1e-5 are good to about 1e-7. */
			assert_true(fabs(-moved[m] / anfis.step - want[m] / norm) < 1e-5);
			dot += moved[m] * moved[m];
		}
		assert_true(fabs(sqrt(dot) - anfis.step) < 1e-9);
		incise_model_free(model);
		incise_model_free(fixed);
		incise_model_free(after);
	}
}

static int count_epoch(void *user, const struct incise_train_step *step)
{
	int *epochs = user;

	if (!step->epoch)
		return 0;
	assert_int_equal(step->epoch, ++*epochs);
	assert_true(isfinite(step->train_rmse) && isnan(step->check_rmse));
	return 0;
}

/* The epoch of the least training error is returned, not the last. */
TEST(test_best_epoch_is_kept)
{
	struct incise_pairs pairs = {.rows = rows, .n = PAIRS, .n_inputs = 2};
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);
	int epochs = 0;
	struct incise_watch watch = {.progress = count_epoch, .user = &epochs};
	struct incise_anfis anfis = {
		.train = &pairs, .ridge = 1e-6, .step = 3, .epochs = 20, .watch = &watch};

	fill();
	assert_int_equal(incise_anfis_run(model, &anfis), 0);
	assert_int_equal(epochs, 20);
	/* So long a step does not go downhill to the end. */
	assert_true(anfis.best_epoch < 20);
	assert_true(fabs(incise_pairs_rmse(model, &pairs, false) - anfis.train_rmse) <
		    1e-9 * anfis.train_rmse);
	incise_model_free(model);
}
