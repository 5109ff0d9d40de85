// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Learning of a texture: saw-teeth of known rate and drop are found again in what is rendered; cuts without
 * events, or whose model has them already, give none.
 */
#include "../cases.h"
#include "../message.h"
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/learn/texture.h"

#define CUTS 6
#define ROWS 1500

struct made {
	struct incise_texture_row row[CUTS][ROWS];
	struct incise_texture_cut cuts[CUTS];
	uint64_t key, at;
	double events, length;
};

static double draw(struct made *made)
{
	return incise_random_uniform(made->key, made->at++);
}

/*
 * Teeth of 0.5 … 1.5 times @tooth and a height of ± @high, on a smooth model, with noise and a factor for each
 * cut.
 */
static struct made *make_cuts(uint64_t key, double step, double tooth, double high,
			      double noise)
{
	struct made *made = calloc(1, sizeof(*made));

	assert_non_null(made);
	made->key = key;
	made->length = CUTS * step * (ROWS - 1);
	for (int c = 0; c < CUTS; c++) {
		double factor = 0.8 + 0.4 * draw(made), rise = draw(made);
		double from = -draw(made) * tooth, length = tooth;

		made->cuts[c] = (struct incise_texture_cut){made->row[c], ROWS};
		for (int i = 0; i < ROWS; i++) {
			double way = step * i;

			while (way >= from + length) {
				from += length;
				length = tooth * (0.5 + draw(made));
				made->events++;
			}
			made->row[c][i].way = way;
			made->row[c][i].model = 2 + rise * i / ROWS;
			made->row[c][i].force =
				factor * made->row[c][i].model *
					(1 + high * (2 * (way - from) / length - 1)) +
				noise * incise_random_normal(~key, made->at++);
		}
	}
	return made;
}

static struct incise_texture *learn(const struct made *made, uint64_t seed)
{
	return incise_texture_learn(made->cuts, CUTS, seed, NULL, &err);
}

static void assert_pieces(const struct incise_texture *texture)
{
	const double *point = texture->point;

	assert_in_range(texture->n_curves, 1, INCISE_TEXTURE_CURVES);
	assert_true(texture->info.most <= 0.9);
	for (int i = 0; i < texture->n_curves; point += texture->n[i++]) {
		assert_in_range(texture->n[i], 2, INCISE_TEXTURE_PIECE);
		/* A piece begins behind a rise through 0, and ends before the next one. */
		assert_true(point[0] >= 0 && point[texture->n[i] - 1] <= 0);
		for (int k = 0; k < texture->n[i]; k++)
			assert_true(fabs(point[k]) <=
					    texture->info.most * INCISE_TEXTURE_ONE &&
				    point[k] == rint(point[k]));
	}
	assert_true(point - texture->point <= INCISE_TEXTURE_POINTS);
}

TEST(rate_and_drops_of_teeth_come_back)
{
	uint64_t key = cases_seed(11);
	int n = cases_of(40, 8);

	for (int k = 0; k < n; k++) {
		double step = 0.02 + 0.05 * incise_random_uniform(key, (uint64_t)k);
		double tooth =
			step * (15 + 45 * incise_random_uniform(~key, (uint64_t)k));
		double high = 0.08 + 0.3 * incise_random_uniform(key + 1, (uint64_t)k);
		struct made *made =
			make_cuts(key + (uint64_t)k, step, tooth, high, high / 50);
		struct incise_texture *texture = learn(made, (uint64_t)k);
		const struct incise_texture_info *info = &texture->info;
		double drop = 2 * high / (1 + high), sd;

		succeeds(texture);
		assert_pieces(texture);
		assert_int_equal(info->n_cuts, CUTS);
		/* The teeth at the ends of a cut may be cut off. */
		assert_float_equal(info->recorded.rate * made->length, made->events,
				   2 * CUTS + 0.01 * made->events);
		/*
		 * Lengths of teeth have the relative sd 0.29. A tape of 8192 points of half a step or more has
		 * the teeth of at least 4096 steps; five sd, and the ends as above.
		 */
		sd = 0.29 / sqrt(4096 * step / tooth);
		assert_float_equal(info->rendered.rate / info->recorded.rate, 1,
				   5 * sd + 2 * CUTS / made->events);
		/* A cell is a mean over a step: an edge loses a step of rise at either end, and gets noise. */
		for (int i = 0; i < 2; i++) {
			double median = (i ? &info->rendered : &info->recorded)->drop[4];

			assert_float_equal(median, drop, drop * (4 * step / tooth + 0.1));
		}
		/* Without texture there is the noise alone, 30 dB below. */
		assert_true(info->error[1] < 3 && info->error[0] > 10);
		assert_float_equal(info->rendered.rms / info->recorded.rms, 1, 0.2);
		incise_texture_free(texture);
		free(made);
	}
}

TEST(cuts_without_events_have_no_texture)
{
	struct made *made = make_cuts(3, 0.05, 1, 0, 0.02);

	assert_error(learn(made, 1), ENODATA, &err, "0 events", "6 cuts", "20");
	free(made);
}

TEST(few_events_are_refused)
{
	/* Each cut has 75 mm. */
	struct made *made = make_cuts(5, 0.05, 30, 0.3, 0.002);

	assert_error(learn(made, 1), ENODATA, &err, "events", "20", "record more cuts");
	free(made);
	made = make_cuts(5, 0.05, 1, 0.3, 0.002);
	assert_error(incise_texture_learn(made->cuts, 1, 1, NULL, &err), ENODATA, &err,
		     "1 cuts", "2 cuts");
	free(made);
}

TEST(a_model_that_has_the_teeth_needs_no_texture)
{
	struct made *made = make_cuts(7, 0.05, 1, 0.2, 0);

	for (int c = 0; c < CUTS; c++)
		for (int i = 0; i < ROWS; i++) {
			made->row[c][i].model = made->row[c][i].force;
			made->row[c][i].force +=
				0.01 * incise_random_normal(9, (uint64_t)(c * ROWS + i));
		}
	assert_error(learn(made, 1), EDOM, &err, "model alone");
	free(made);
}

TEST(a_seed_gives_the_same_texture)
{
	struct made *made = make_cuts(13, 0.05, 1, 0.2, 0.01);
	struct incise_texture *a = learn(made, 1), *b = learn(made, 1);

	succeeds(a && b);
	assert_int_equal(a->n_curves, b->n_curves);
	assert_memory_equal(a->n, b->n, (size_t)a->n_curves * sizeof(*a->n));
	for (int i = 0, k = 0; i < a->n_curves; i++)
		for (int j = 0; j < a->n[i]; j++, k++)
			assert_true(a->point[k] == b->point[k]);
	incise_texture_free(a);
	incise_texture_free(b);
	free(made);
}

static int end_it(void *user, const struct incise_train_step *step)
{
	(void)step;
	return ++*(int *)user;
}

TEST(learning_can_be_ended)
{
	struct made *made = make_cuts(17, 0.05, 1, 0.2, 0.01);
	int asked = 0;
	struct incise_watch watch = {.progress = end_it, .user = &asked};

	assert_error(incise_texture_learn(made->cuts, CUTS, 1, &watch, &err), ECANCELED,
		     &err, "stopped");
	assert_int_equal(asked, 1);
	free(made);
}

/* Rows come from files of strangers. */
TEST(any_rows_are_learned_from_or_refused)
{
	static const double steps[] = {1e-300, 1, 1e300, 0x1p-1074, 0.01};
	uint64_t key = cases_seed(19);
	int n = cases_of(400, 20), learned = 0;

	for (int k = 0; k < n; k++) {
		struct made *made = make_cuts(key + (uint64_t)k, 0.05, 1, 0.3, 0.01);
		struct incise_texture *texture;

		for (int c = 0; c < CUTS; c++) {
			double way = 0;

			made->cuts[c].n = incise_random_bits(key, made->at++) % 300;
			for (size_t i = 0; i < made->cuts[c].n; i++) {
				bool wild = draw(made) < 0.02;
				double more =
					steps[incise_random_bits(key, made->at++) % 5];

				way = fmax(way + (wild ? more : 0.05),
					   nextafter(way, INFINITY));
				made->row[c][i].way = way = fmin(way, 1e307);
				if (wild)
					made->row[c][i].force = (draw(made) - 0.3) * more;
				if (draw(made) < 0.02)
					made->row[c][i].model = (draw(made) - 0.5) * more;
			}
		}
		texture = learn(made, (uint64_t)k);
		learned += texture != NULL;
		if (texture)
			assert_pieces(texture);
		else
			assert_true(err.code == ENODATA || err.code == EDOM);
		incise_texture_free(texture);
		free(made);
	}
	print_message("%d of %d learned\n", learned, n);
}
