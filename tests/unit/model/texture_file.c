// SPDX-License-Identifier: GPL-2.0-or-later
/* The file of a texture: the same to the bit, or refused with its line. */
#include "../unit.h"
#include <incise/texture.h>
#include "../../../lib/model/texture.h"
#include "../cases.h"
#include "../message.h"
#include "paper_model.h"

static char path[] = "/tmp/incise-tex-XXXXXX";

static int make_path(void **state)
{
	int fd = mkstemp(path);

	return fd < 0 ? -1 : close(fd);
}

static int remove_path(void **state)
{
	return unlink(path);
}

static char *read_all(size_t *size)
{
	FILE *file = fopen(path, "r");
	char *text = calloc(1, 1 << 20);

	*size = fread(text, 1, (1 << 20) - 1, file);
	fclose(file);
	return text;
}

static void write_all(const char *text, size_t size)
{
	FILE *file = fopen(path, "w");

	assert_int_equal(fwrite(text, 1, size, file), size);
	fclose(file);
}

static void draw_look(struct incise_texture_look *look, uint64_t *seed)
{
	look->rate = fabs(paper_random(seed));
	look->rms = fabs(paper_random(seed)) / 3;
	for (int i = 0; i < INCISE_TEXTURE_DECILES; i++)
		look->drop[i] = fabs(paper_random(seed));
	for (int i = 0; i < INCISE_TEXTURE_OCTAVES; i++)
		look->octave[i] = 60 * paper_random(seed);
}

/* Any texture within its ranges; all of its bytes are set. */
static struct incise_texture *draw(uint64_t *seed)
{
	struct incise_texture *t = calloc(1, sizeof(*t));
	int points = 0;

	strcpy(t->info.unit, incise_random_draw(seed, 2) ? "mm" : "deg");
	t->checksum = incise_random_step(seed);
	t->info.seed = incise_random_step(seed) >> 12;
	t->info.most = 0.9 * fabs(paper_random(seed));
	t->info.variation = fabs(paper_random(seed));
	t->info.up_to_cycles = 1 / 3.0;
	t->info.n_cuts = 1 + (int)incise_random_draw(seed, 100);
	t->info.n_events = (int)incise_random_draw(seed, 1000);
	t->info.length = 1e3 / 7;
	t->info.error[0] = 10 * fabs(paper_random(seed));
	t->info.error[1] = 3 * fabs(paper_random(seed));
	draw_look(&t->info.recorded, seed);
	draw_look(&t->info.rendered, seed);
	t->step = ldexp(1, (int)incise_random_draw(seed, 13) - 8);
	t->n_curves = 1 + (int)incise_random_draw(seed, 20);
	for (int i = 0; i < t->n_curves; i++)
		points += t->n[i] = 2 + (int)incise_random_draw(seed, 50);
	for (int i = 0; i < points; i++)
		t->point[i] =
			trunc(INCISE_TEXTURE_ONE * t->info.most * paper_random(seed));
	return t;
}

TEST(test_round_trip)
{
	uint64_t seed = cases_seed(51);

	for (int i = 0; i < cases_of(400, 20); i++) {
		struct incise_texture *a = draw(&seed), *b;
		size_t size, again;
		char *text, *other;

		assert_int_equal(incise_texture_save(a, path, &err), 0);
		text = read_all(&size);
		b = incise_texture_load(path, NULL, &err);
		assert_non_null(b);
		assert_memory_equal(incise_texture_info(a), incise_texture_info(b),
				    sizeof(a->info));
		assert_true(a->step == b->step && a->n_curves == b->n_curves);
		assert_memory_equal(a->n, b->n, (size_t)a->n_curves * sizeof(*a->n));
		assert_int_equal(incise_texture_save(b, path, &err), 0);
		other = read_all(&again);
		assert_int_equal(size, again);
		assert_memory_equal(text, other, size);
		free(text);
		free(other);
		incise_texture_free(a);
		incise_texture_free(b);
	}
}

/* It belongs to one model, and to any where none is given. */
TEST(test_of_another_model)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);
	uint64_t seed = 7;
	struct incise_texture *t = draw(&seed);

	assert_int_equal(incise_texture_save(t, path, &err), 0);
	incise_texture_free(t);
	assert_error(incise_texture_load(path, model, &err), ESTALE, &err, path, "stale");
	t = incise_texture_load(path, NULL, &err);
	assert_non_null(t);
	incise_texture_free(t);
	incise_model_free(model);
}

/* A file of two curves, with 3 and 2 points. */
static const char good[] =
	"# a comment\nincise-tex 1\nmodel 0123456789abcdef\nway mm\nseed 1\ncuts 4\n"
	"events 30\nmost 0.5\nvariation 0.1\ncycles 2\nlength 100\nerror 9 3\n"
	"recorded-rate 1\nrecorded-rms 0.1\nrecorded-drops 1 2 3 4 5 6 7 8 9\n"
	"recorded-octaves -1 -2 -3 -4\nrendered-rate 1\nrendered-rms 0.1\n"
	"rendered-drops 1 2 3 4 5 6 7 8 9\nrendered-octaves -1 -2 -3 -4\n\nstep 0.125\n"
	"curves 2\ncurve 3\n0 4096 -8192\ncurve 2\n2048 0\n";

static const struct {
	const char *from, *to, *line; /* of the error */
} changes[] = {
	{"incise-tex 1", "incise-tex 2", ":2"},
	{"incise-tex 1", "incise-sd 3", ":2"},
	{"model 0", "model x", ":3"},
	{"model 0", "model 00", ":3"},
	{"way mm", "way", ":4"},
	{"way mm", "way m\033m", ":4"},
	{"way mm", "way abcdefghijklmnop", ":4"},
	{"seed 1", "seed -1", ":5"},
	{"seed 1", "seed 1.5", ":5"},
	{"seed 1", "seed 99999999999999999999", ":5"},
	{"cuts 4", "cuts 0", ":6"},
	{"cuts 4", "cuts 4294967300", ":6"},
	{"events 30", "events -1", ":7"},
	{"events 30\n", "", ":7"},
	{"most 0.5", "most 0.95", ":8"},
	{"most 0.5", "most -0.1", ":8"},
	{"most 0.5", "most 0.5 0.5", ":8"},
	{"variation 0.1", "variation 1.5", ":9"},
	{"variation 0.1", "variation nan", ":9"},
	{"cycles 2", "cycles 1e999", ":10"},
	{"cycles 2", "cycles 0", ":10"},
	{"recorded-rate 1", "recorded-rate 0", ":13"},
	{"length 100", "length -1", ":11"},
	{"error 9 3", "error 9", ":12"},
	{"recorded-drops 1", "recorded-drops", ":15"},
	{"rendered-octaves -1", "rendered-octaves -1e4", ":20"},
	{"step 0.125", "step 0", ":22"},
	{"step 0.125", "step 17", ":22"},
	{"step 0.125", "step x", ":22"},
	{"curves 2", "curves 0", ":23"},
	{"curves 2", "curves 4097", ":23"},
	{"curves 2", "curves 3", ":27"},
	{"curves 2", "curves 1", ":26"},
	{"curve 3", "curve 1", ":24"},
	{"curve 3", "curve 2", ":25"},
	{"curve 3", "curve 4", ":25"},
	{"curve 3", "curve 2049", ":24"},
	{"4096", "8193", ":25"},
	{"4096", "40.5", ":25"},
	{"2048 0\n", "", ":26"},
	{"2048 0\n", "2048 0\n0\n", ":28"},
};

TEST(test_damage_is_refused)
{
	struct incise_texture *t;

	write_all(good, strlen(good));
	t = incise_texture_load(path, NULL, &err);
	assert_non_null(t);
	assert_int_equal(t->n_curves, 2);
	assert_true(t->point[4] == 0 && t->point[2] == -8192);
	incise_texture_free(t);
	for (size_t i = 0; i < sizeof(changes) / sizeof(*changes); i++) {
		const char *at = strstr(good, changes[i].from);
		char text[2048];

		assert_non_null(at);
		snprintf(text, sizeof(text), "%.*s%s%s", (int)(at - good), good,
			 changes[i].to, at + strlen(changes[i].from));
		write_all(text, strlen(text));
		assert_error(incise_texture_load(path, NULL, &err), EINVAL, &err, path,
			     changes[i].line);
	}
	/* Cut anywhere but in the last point and its line's end. */
	for (size_t n = 0; n + 3 < strlen(good); n++) {
		write_all(good, n);
		err = (struct incise_error){0};
		assert_null(incise_texture_load(path, NULL, &err));
		assert_int_equal(err.code, EINVAL);
	}
}

GROUP(make_path, remove_path);
