// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The model in double against its formulas in long double, and where those break down.
 */
#include "../unit.h"
#include <float.h>
#include "../cases.h"
#include "any_model.h"

/*
 * Any model within its ranges: all kinds, free lists, weights, prod and min, up to 8 inputs
 * and 256 rules.
 */
TEST(test_against_formulas)
{
	static const struct {
		int n_inputs, n_rules, rounds;
	} cases[] = {{1, 1, 50}, {1, 7, 200}, {2, 20, 200}, {3, 40, 100}, {8, 256, 40}};
	struct incise_model *model = calloc(1, sizeof(*model));
	int fired = 0, not_fired = 0, min = 0;
	uint64_t seed = 1;

	for (size_t c = 0; c < sizeof(cases) / sizeof(*cases); c++)
		for (int n = 0; n < cases[c].rounds; n++) {
			any_model(model, &seed, cases[c].n_inputs, cases[c].n_rules, 1);
			min += model->info.and_method == INCISE_AND_MIN;
			for (int k = 0; k < 20; k++) {
				long double w[INCISE_MODEL_RULES_MAX], largest;
				double x[INCISE_MODEL_INPUTS_MAX], y;
				unsigned int flags;

				for (int i = 0; i < model->info.n_inputs; i++)
					x[i] = 10 * paper_random(&seed);
				y = incise_model_eval(model, x, &flags);
				largest = any_strengths(model, x, w);
				if (largest < 1e-300L) {
					not_fired++;
					continue;
				}
				fired++;
				assert_int_equal(flags, 0);
				/*
				 * Outputs reach 90; a strength of 1e-300 is a log of
				 * -690, off by as many ulp.
				 */
				if (fabsl(y - any_output(model, x)) > 90 * 700 * 1e-16)
					fail_msg("%d inputs, %d rules: %.17g, not %.17Lg",
						 cases[c].n_inputs, cases[c].n_rules, y,
						 any_output(model, x));
			}
		}
	/* Both methods, and mostly points where something fires. */
	assert_true(min > 200 && min < 390);
	assert_true(fired > 5 * not_fired && not_fired > 0);
	free(model);
}

/* A grid of kinds at random, of 1 to 4 inputs. */
static void any_grid(struct incise_model *model, uint64_t *seed)
{
	int rest;

	do {
		any_model(model, seed, 1 + any_below(seed, 4), 1, 1);
		model->info.n_rules = 1;
		for (int i = 0; i < model->info.n_inputs; i++)
			model->info.n_rules *= model->info.n_mfs[i];
	} while (model->info.n_rules > INCISE_MODEL_RULES_MAX);
	model->info.and_method = INCISE_AND_PROD;
	for (int r = 0; r < model->info.n_rules; r++) {
		rest = r;
		model->rule[r].weight = 1;
		for (int i = 0; i < model->info.n_inputs; i++) {
			model->rule[r].mf[i] = rest % model->info.n_mfs[i];
			rest /= model->info.n_mfs[i];
		}
		for (int i = 0; i <= model->info.n_inputs; i++)
			model->rule[r].p[i] = paper_random(seed);
	}
	incise_model_classify(model);
}

/*
 * The way of grids gives what the general one gives, also far outside where nothing
 * fires. Weights add up to 1, so their difference is one relative to the consequents.
 */
TEST(test_grids_go_a_way_of_their_own)
{
	struct incise_model *model = calloc(1, sizeof(*model));
	double w[2][INCISE_MODEL_RULES_MAX], apart = 0;
	uint64_t seed = 3;
	int fired = 0;

	for (int n = 0; n < 2000; n++) {
		any_grid(model, &seed);
		assert_true(model->is_grid);
		for (int k = 0; k < 20; k++) {
			double x[INCISE_MODEL_INPUTS_MAX], sum = 0, y = 0, size = 0;
			bool fires;

			for (int i = 0; i < model->info.n_inputs; i++)
				x[i] = paper_random(&seed) *
				       (k < 15 ? 10 : any_width(&seed, 300));
			fires = incise_model_firing_grid(model, x, w[0]);
			assert_int_equal(incise_model_firing_rules(model, x, w[1]),
					 fires);
			fired += fires;
			for (int r = 0; r < model->info.n_rules; r++)
				sum += fabs(w[0][r] - w[1][r]);
			apart = fmax(apart, sum);
			/* The public ones take the first of them. */
			incise_model_firing(model, x, w[1]);
			assert_memory_equal(w[0], w[1],
					    model->info.n_rules * sizeof(**w));
			if (k >= 15)
				continue;
			for (int r = 0; r < model->info.n_rules; r++) {
				double yr = model->rule[r].p[0];

				for (int i = 0; i < model->info.n_inputs; i++)
					yr += model->rule[r].p[i + 1] * x[i];
				y += w[0][r] * yr;
				size = fmax(size, fabs(yr));
			}
			assert_true(fabs(incise_model_eval(model, x, NULL) - y) <=
				    1e-14 * size);
		}
	}
	assert_true(apart < 1e-14);
	assert_true(fired > 10000 && fired < 39000);
	free(model);
}

/* Rules in any order are a grid; a list with a rule missing, repeated or altered is none. */
TEST(test_grids_are_told_from_lists)
{
	enum { NONE, SWAP, TWICE, LEAVE_OUT, WEIGHT, MIN, FEWER };
	static const bool want[] = {true, true, false, false, false, false, false};

	for (int change = NONE; change <= FEWER; change++) {
		struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);
		struct incise_rule rule = model->rule[3];

		switch (change) {
		case SWAP:
			model->rule[3] = model->rule[17];
			model->rule[17] = rule;
			break;
		case TWICE:
			model->rule[17] = rule;
			break;
		case LEAVE_OUT:
			model->rule[19].mf[1] = -1;
			break;
		case WEIGHT:
			model->rule[19].weight = 0.5;
			break;
		case MIN:
			model->info.and_method = INCISE_AND_MIN;
			break;
		case FEWER:
			model->info.n_rules--;
			break;
		}
		incise_model_classify(model);
		assert_int_equal(model->is_grid, want[change]);
		incise_model_free(model);
	}
}

/* Far out every firing strength is zero: the nearest rule answers. */
TEST(test_nearest_rule_takes_over)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);
	const double far[] = {1000, 5000};
	const double *p = incise_model_rule(model, 19)->p;
	unsigned int flags;

	incise_model_set_clamp(model, false);
	assert_true(fabs(incise_model_eval(model, far, &flags) -
			 (p[0] + p[1] * 1000 + p[2] * 5000)) < 1e-9);
	assert_int_equal(flags, INCISE_MODEL_EXTRAPOLATED);
	/* Clamped it is the edge of the support. */
	incise_model_set_clamp(model, true);
	assert_true(incise_model_eval(model, far, &flags) ==
		    incise_model_eval(model, (double[]){20, 50}, NULL));
	assert_int_equal(flags, INCISE_MODEL_EXTRAPOLATED);
	incise_model_free(model);
}

/*
 * Triangles, zero outside their feet: two of one input at 0…2 and 8…14, constants 1 and 2,
 * with a second input that has a wide Gaussian (3) and a narrow triangle at 4…6 (4).
 */
static struct incise_model *with_gaps(void)
{
	static const struct incise_variable in[] = {{"a", -20, 40}, {"b", 0, 10}};
	static const struct incise_variable out = {"y", 0, 1};
	static const int mfs[] = {2, 2};
	static const struct incise_mf functions[2][2] = {
		{{INCISE_MF_TRI, "near", {0, 1, 2}}, {INCISE_MF_TRI, "far", {8, 11, 14}}},
		{{INCISE_MF_GAUSS, "wide", {2, 5}}, {INCISE_MF_TRI, "narrow", {4, 5, 6}}},
	};
	struct incise_model *model =
		incise_model_new_grid(2, in, mfs, INCISE_MF_TRI, &out, NULL);

	memcpy(model->mf[0], functions[0], sizeof(functions[0]));
	memcpy(model->mf[1], functions[1], sizeof(functions[1]));
	return model;
}

TEST(test_nearest_rule_of_triangles)
{
	/* Rules: near wide, near narrow, far wide, far narrow. */
	static const struct {
		double x[2], w[4];
		unsigned int flags;
	} cases[] = {
		/* Inside: near is 1/2, narrow 1/2 and wide exp(-1/32). */
		{{0.5, 4.5}, {0.65969, 0.34031, 0, 0}, 0},
		/* Between: 1 of 2 wide from the one, 5 of 6 from the other. */
		{{3, 1}, {1, 0, 0, 0}, INCISE_MODEL_EXTRAPOLATED},
		/* Nearer in mm is not nearer in widths: 2.4/2 against 3.6/6. */
		{{4.4, 1}, {0, 0, 1, 0}, INCISE_MODEL_EXTRAPOLATED},
		/* Halfway, 1.5/2 and 4.5/6: they share. */
		{{3.5, 1}, {0.5, 0, 0.5, 0}, INCISE_MODEL_EXTRAPOLATED},
		/* The other input's degrees go on mattering: 1 and 1. */
		{{3, 5}, {0.5, 0.5, 0, 0}, INCISE_MODEL_EXTRAPOLATED},
		{{3, 4.5}, {0.65969, 0.34031, 0, 0}, INCISE_MODEL_EXTRAPOLATED},
		/* On both feet: zero already. */
		{{2, 1}, {1, 0, 0, 0}, INCISE_MODEL_EXTRAPOLATED},
		{{8, 1}, {0, 0, 1, 0}, INCISE_MODEL_EXTRAPOLATED},
		/* Within the foot by an ulp of 2: whatever the degree, it fires. */
		{{1.9999999999999998, 1}, {1, 0, 0, 0}, 0},
		{{40, 1}, {0, 0, 1, 0}, INCISE_MODEL_EXTRAPOLATED},
		{{-20, 1}, {0, 0, 1, 0}, INCISE_MODEL_EXTRAPOLATED},
	};

	for (int way = 0; way < 2; way++) {
		struct incise_model *model = with_gaps();

		/* A list with a rule that never fires goes the general way. */
		if (way) {
			model->rule[4] = model->rule[0];
			model->rule[4].weight = 0;
			model->info.n_rules = 5;
			incise_model_classify(model);
		}
		assert_int_equal(model->is_grid, !way);
		for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
			unsigned int flags;
			double w[5] = {0};

			incise_model_eval(model, cases[i].x, &flags);
			incise_model_firing(model, cases[i].x, w);
			assert_true(w[4] == 0);
			if (i == 10) /* 20/2 = 10 against 28/6: the far one is nearer */
				assert_true(w[2] == 1);
			for (int r = 0; r < 4; r++)
				/* as many digits as stand in the table */
				if (fabs(w[r] - cases[i].w[r]) > 5e-6)
					fail_msg("case %zu, rule %d: %g", i, r, w[r]);
			assert_int_equal(flags, cases[i].flags);
		}
		incise_model_free(model);
	}
}

/* Whatever fires at all goes before what is only near. */
TEST(test_firing_goes_before_near)
{
	struct incise_model *model = with_gaps();
	const struct incise_mf far = {INCISE_MF_GAUSS, "far", {1, 0}};
	double w[4];
	unsigned int flags;

	model->mf[0][1] = far;
	incise_model_set_clamp(model, false);
	incise_model_classify(model);
	/* exp(-37²/2) = 1e-297.3, and the triangle ended 35 to the left. */
	incise_model_firing(model, (double[]){37, 5}, w);
	assert_true(w[0] == 0 && w[1] == 0 && fabs(w[2] + w[3] - 1) < 1e-15);
	incise_model_eval(model, (double[]){37, 5}, &flags);
	assert_int_equal(flags, 0);
	/* exp(-800) is 0 in double, within the range as outside. */
	incise_model_eval(model, (double[]){40, 5}, &flags);
	assert_int_equal(flags, INCISE_MODEL_EXTRAPOLATED);
	for (double x = 41; x < 1e300; x *= 7) {
		incise_model_firing(model, (double[]){x, 5}, w);
		assert_true(w[0] == 0 && w[1] == 0 && fabs(w[2] + w[3] - 1) < 1e-15);
	}
	incise_model_free(model);
}

/* With min, the input that is furthest off decides which rule is nearest. */
TEST(test_nearest_rule_by_min)
{
	struct incise_model *model = with_gaps();
	double w[4];

	model->mf[1][0] = (struct incise_mf){INCISE_MF_TRI, "low", {-2, -1, 0}};
	/* Gaps: near 1, far 0.67; low 1.5, narrow 0.5. */
	incise_model_classify(model);
	incise_model_firing(model, (double[]){4, 3}, w);
	assert_true(w[3] == 1);
	model->info.n_rules = 3;
	/* Without far narrow: by sums 2.5, 1.5, 2.2, by the largest 1.5, 1, 1.5. */
	for (int min = 0; min < 2; min++) {
		model->info.and_method = min ? INCISE_AND_MIN : INCISE_AND_PROD;
		incise_model_classify(model);
		incise_model_firing(model, (double[]){4, 3}, w);
		assert_true(w[1] == 1);
	}
	/*
	 * a d is at (0.5, 1.5) and b c at (1.25, 1): 2 < 2.25, but 1.5 > 1.25. a c is nearer
	 * than both, and has no weight.
	 */
	model->rule[0].weight = 0;
	model->mf[0][0] = (struct incise_mf){INCISE_MF_TRI, "a", {0, 1, 2}};
	model->mf[0][1] = (struct incise_mf){INCISE_MF_TRI, "b", {5.5, 6, 7.5}};
	model->mf[1][0] = (struct incise_mf){INCISE_MF_TRI, "c", {-2, -1, 0}};
	model->mf[1][1] = (struct incise_mf){INCISE_MF_TRI, "d", {5, 6, 7}};
	for (int min = 0; min < 2; min++) {
		model->info.and_method = min ? INCISE_AND_MIN : INCISE_AND_PROD;
		incise_model_classify(model);
		incise_model_firing(model, (double[]){3, 2}, w);
		assert_true(w[min ? 2 : 1] == 1);
	}
	incise_model_free(model);
}

/* An input, hostile or plain. */
static double any_input(uint64_t *seed)
{
	static const double hostile[] = {0,	   -0.0,     1e300,	-1e300,
					 NAN,	   INFINITY, -INFINITY, DBL_MAX,
					 -DBL_MAX, DBL_MIN,  5e-324,	1e-310};
	int k = any_below(seed, 24);

	return k < 12	? hostile[k]
	       : k < 16 ? paper_random(seed) * any_width(seed, 300)
			: 10 * paper_random(seed);
}

/*
 * 10^5 models of all kinds with widths from 1e-12 to 1e12: whatever comes in, the output is
 * a number and the weights add up to 1; and they are right wherever long double can say.
 */
TEST(test_nothing_yields_nan)
{
	struct incise_model *model = calloc(1, sizeof(*model));
	int compared = 0, compared_far = 0, nowhere = 0;
	uint64_t seed = 5;

	for (int n = 0; n < 100000; n++) {
		long double want[INCISE_MODEL_RULES_MAX], largest, total = 0;
		double x[INCISE_MODEL_INPUTS_MAX], w[INCISE_MODEL_RULES_MAX], sum = 0;
		unsigned int flags, outside = 0;
		bool steep = false;

		any_model(model, &seed, 1 + any_below(&seed, 8), 1 + any_below(&seed, 12),
			  12);
		for (int i = 0; i < model->info.n_inputs; i++) {
			x[i] = any_input(&seed);
			if (!(fabs(x[i]) <= 10))
				outside = INCISE_MODEL_EXTRAPOLATED;
			for (int k = 0; k < model->info.n_mfs[i]; k++)
				steep |= model->mf[i][k].type == INCISE_MF_GBELL &&
					 model->mf[i][k].p[1] > 100;
		}
		assert_true(isfinite(incise_model_eval(model, x, &flags)));
		incise_model_firing(model, x, w);
		for (int r = 0; r < model->info.n_rules; r++) {
			assert_true(w[r] >= 0 && w[r] <= 1);
			sum += w[r];
		}
		/* a rounding per rule */
		assert_true(fabs(sum - 1) < 12 * DBL_EPSILON);
		assert_int_equal(flags & outside, outside);
		/* Such bells make anything of the rounding of (x-c)/a. */
		if (steep)
			continue;
		for (int i = 0; i < model->info.n_inputs; i++)
			x[i] = isnan(x[i]) ? 0 : fmax(-DBL_MAX, fmin(DBL_MAX, x[i]));
		largest = any_strengths(model, x, want);
		nowhere += largest == 0;
		if (!outside && largest > 1e-323L)
			assert_int_equal(flags, 0);
		if (largest < 1e-324L && !outside)
			assert_int_equal(flags, INCISE_MODEL_EXTRAPOLATED);
		if (largest < 1e-4800L)
			continue;
		compared++;
		compared_far += largest < 1e-330L;
		for (int r = 0; r < model->info.n_rules; r++)
			total += want[r];
		for (int r = 0; r < model->info.n_rules; r++)
			/*
			 * Strengths are logs down to -11000, off by some ulp (bells: by
			 * their slope), and so are weights: 11000 · 100 · 2e-16.
			 */
			if (!(fabsl(w[r] - want[r] / total) < 2.5e-10L))
				fail_msg("model %d, rule %d: %.17g, not %.17Lg", n, r,
					 w[r], want[r] / total);
	}
	assert_true(compared > 10000 && compared_far > 20 && nowhere > 10000);
	free(model);
}

TEST(test_grid_shape)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);

	assert_int_equal(incise_model_info(model)->n_rules, 20);
	/* MATLAB's order: the last input's functions follow each other fastest. */
	assert_int_equal(incise_model_rule(model, 1)->mf[0], 0);
	assert_int_equal(incise_model_rule(model, 1)->mf[1], 1);
	assert_int_equal(incise_model_rule(model, 19)->mf[0], 4);
	incise_model_free(model);
	/* Neighbours cross at 0.5, and each is 1 at its centre. */
	for (int type = 0; type < INCISE_MF_SIG; type++) {
		model = paper_model(type, 1, 1);
		for (int k = 0; k < 5; k++) {
			const struct incise_mf *mf = incise_model_mf(model, 0, k);

			assert_int_equal(mf->type, type);
			for (int side = -1; side <= 1; side++)
				assert_true(fabs(incise_mf_eval(mf, 5 * k + 2.5 * side) -
						 (side ? 0.5 : 1)) < 8e-15);
		}
		incise_model_free(model);
	}
	/* As MATLAB's genfis1 has them for a spacing of 5. */
	model = paper_model(INCISE_MF_TRAP, 1, 1);
	assert_true(fabs(incise_model_mf(model, 0, 1)->p[0] - 1.5) < 1e-15 * 8);
	assert_true(fabs(incise_model_mf(model, 0, 1)->p[2] - 6.5) < 1e-15 * 8);
	incise_model_free(model);
}

/* Names say where a function lies, and none is negative over a depth. */
TEST(test_names)
{
	static const struct incise_variable out = {"force_N", 0, 4};
	static const struct {
		struct incise_variable in;
		int n;
		const char *first, *second, *last;
	} cases[] = {
		{{"depth_mm", 0, 20}, 1, "medium", NULL, "medium"},
		{{"depth_mm", 0, 20}, 2, "shallow", "deep", "deep"},
		{{"depth_mm", 0, 20}, 3, "shallow", "medium", "deep"},
		{{"depth_mm", 0, 20}, 5, "very_shallow", "shallow", "very_deep"},
		{{"velocity_mm_s", 0, 50}, 4, "very_slow", "slow", "very_fast"},
		{{"velocity_mm_s", -50, 50}, 4, "very_low", "low", "very_high"},
		{{"speed", 0, 1}, 6, "extremely_slow", "very_slow", "extremely_fast"},
		{{"angle_deg", 0, 90}, 7, "extremely_low", "very_low", "extremely_high"},
		{{"depth_mm", 0, 20}, 32, "level_1", "level_2", "level_32"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		int n = cases[i].n;
		struct incise_model *model = incise_model_new_grid(
			1, &cases[i].in, &n, INCISE_MF_GAUSS, &out, NULL);

		assert_non_null(model);
		assert_string_equal(incise_model_mf(model, 0, 0)->name, cases[i].first);
		if (n > 1)
			assert_string_equal(incise_model_mf(model, 0, 1)->name,
					    cases[i].second);
		assert_string_equal(incise_model_mf(model, 0, n - 1)->name,
				    cases[i].last);
		for (int k = 0; k < n; k++)
			for (int j = 0; j < k; j++)
				assert_string_not_equal(
					incise_model_mf(model, 0, j)->name,
					incise_model_mf(model, 0, k)->name);
		incise_model_free(model);
	}
}

TEST(test_refusals)
{
	static const struct {
		int n_inputs, mfs;
		double min, max;
		int code;
	} cases[] = {
		{0, 2, 0, 1, EINVAL},	       {9, 2, 0, 1, EINVAL},
		{2, 0, 0, 1, EINVAL},	       {2, 33, 0, 1, EINVAL},
		{2, 2, 1, 1, EINVAL},	       {2, 2, 2, 1, EINVAL},
		{2, 2, NAN, 1, EINVAL},	       {2, 2, 0, INFINITY, EINVAL},
		{8, 4, 0, 1, E2BIG},	       {2, 17, 0, 1, E2BIG},
		{1, 2, -1e308, 1e308, EINVAL},
	};
	static const struct incise_variable out = {"y", 0, 1};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_variable in[9] = {0};
		struct incise_error err = {0};
		int mfs[9];

		for (int k = 0; k < 9; k++) {
			in[k] = (struct incise_variable){"x", cases[i].min, cases[i].max};
			mfs[k] = cases[i].mfs;
		}
		assert_null(incise_model_new_grid(cases[i].n_inputs, in, mfs,
						  INCISE_MF_GAUSS, &out, &err));
		assert_int_equal(err.code, cases[i].code);
	}
	/* Ranges whose functions over- or underflow. */
	for (int i = 0; i < 2; i++) {
		const struct incise_variable in = {"x", 0, i ? 5e-324 : 1.7e308};
		struct incise_error err = {0};

		assert_null(incise_model_new_grid(1, &in, (int[]){4}, INCISE_MF_GAUSS,
						  &out, &err));
		assert_int_equal(err.code, EINVAL);
	}
	/* A sigmoid has no centre to put it at. */
	for (int type = INCISE_MF_SIG; type < 100; type += 50) {
		const struct incise_variable in = {"x", 0, 1};
		struct incise_error err = {0};

		assert_null(incise_model_new_grid(1, &in, (int[]){2}, type, &out, &err));
		assert_int_equal(err.code, EINVAL);
	}
}

TEST(test_setters_refuse_what_is_no_number)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);
	struct incise_model *copy = incise_model_copy(model);
	struct incise_model *traps = paper_model(INCISE_MF_TRAP, 1, 1);

	assert_int_equal(incise_model_set_mf(traps, 0, 0, (double[4]){0, 1, 3, 2}),
			 -EINVAL);
	assert_int_equal(incise_model_set_mf(traps, 0, 0, (double[4]){0, 1, 2, 3}), 0);
	assert_true(incise_model_mf(traps, 0, 0)->p[3] == 3);
	incise_model_free(traps);
	assert_int_equal(incise_model_set_mf(model, 0, 0, (double[4]){-1, 0}), -EINVAL);
	assert_int_equal(incise_model_set_mf(model, 0, 0, (double[4]){1, NAN}), -EINVAL);
	assert_int_equal(incise_model_set_consequent(model, 0,
						     (double[]){0, 0, INFINITY}),
			 -EINVAL);
	assert_memory_equal(incise_model_mf(model, 0, 0)->p,
			    incise_model_mf(copy, 0, 0)->p, 16);
	assert_memory_equal(incise_model_rule(model, 0)->p, incise_model_rule(copy, 0)->p,
			    24);
	incise_model_free(model);
	incise_model_free(copy);
}

/* Of random points, some of them outside or not finite: the count, and the first that is bad. */
TEST(test_inputs_check)
{
	const struct incise_variable inputs[] = {{"depth_mm", 0, 20},
						 {"velocity_mm_s", -5, 50}};
	const double bad[] = {NAN, INFINITY, -INFINITY};
	uint64_t seed = cases_seed(41);

	for (int c = 0; c < cases_of(2000, 100); c++) {
		size_t n = 1 + c % 7, outside = 0, found;
		double x[14];
		char text[60];

		for (size_t k = 0; k < n; k++) {
			x[2 * k] = -10 + 40 * paper_random(&seed);
			x[2 * k + 1] = -20 + 90 * paper_random(&seed);
			outside += x[2 * k] < 0 || x[2 * k] > 20 || x[2 * k + 1] < -5 ||
				   x[2 * k + 1] > 50;
		}
		assert_int_equal(incise_inputs_check(inputs, 2, x, n, &found, &err), 0);
		assert_int_equal(found, outside);
		for (size_t i = 0; i < 2 * n; i++) {
			double kept = x[i];

			x[i] = bad[(size_t)c % 3];
			snprintf(text, sizeof(text), "point %zu of %zu: ", i / 2 + 1, n);
			assert_error(incise_inputs_check(inputs, 2, x, n, &found, &err),
				     EINVAL, &err, inputs[i % 2].name, "not finite",
				     n > 1 ? text : NULL);
			x[i] = kept;
		}
	}
}
