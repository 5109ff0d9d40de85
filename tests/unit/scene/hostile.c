// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Scene files from outside: the shipped ones, broken in thousands of ways, are either
 * refused with a line that says so or make a plan whose ticks are finite.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/model.h>
#include <incise/plan.h>
#include <incise/scene.h>
#include "../../../lib/scene/scene.h"

#define MUTANTS 2000 /* of each scene */
#define MODELS 6     /* of them, plans with a model */
#define TEXT_MAX 4000

/* Starting points; no shipped scene has heights or a mesh. */
static const struct {
	const char *name;
	const char *shipped; /* file, or NULL: @text */
	const char *text;
} seeds[] = {
	{"liver", "scenes/liver.scene", NULL},
	{"neck", "scenes/neck.scene", NULL},
	{"wall", "scenes/wall.scene", NULL},
	{"mesh", NULL,
	 "model = \"liver.fis\"; arithmetic = \"double\";\n"
	 "surface = { kind = \"mesh\"; file = \"s.obj\"; at_mm = [1.0, 2.0, 3.0]; };\n"
	 "tool = { side = [0.0, 1.0, 0.0]; axis = [0.0, 0.0, 1.0]; handle_mm = 99.0; };\n"
	 "device = { mass_kg = 0.1; damping_N_s_mm = 0.01; delay_ticks = 3;\n"
	 "  coulomb_N = 0.1; encoder_mm = 0.01; };\n"
	 "limits = { start_N = 0.2; ramp_ms = 100.0; fade_ms = 10.0; };\n"},
	{"heights", NULL,
	 "surface = { kind = \"heights\"; file = \"s.asc\"; at_mm = [0.0, 0.0, 0.0]; };\n"
	 "tissue = { gain = 0.5; reaction_N_mm = 0.2; leave_mm = 0.3; };\n"
	 "effects = { average_ticks = 64; guard = false; };\n"},
	{"sphere", NULL,
	 "surface = { kind = \"sphere\"; centre_mm = [0.0, 0.0, -9.0]; radius_mm = 9.0; "
	 "};\n"
	 "tissue = { spread_N_mm = 0.1; insertion_N_mm = 0.1; aligned = 0.5; };\n"},
};
#define SEEDS (sizeof(seeds) / sizeof(*seeds))

static const char *const bits[] = {"1e999",
				   "-1e999",
				   "nan",
				   "-1",
				   "0",
				   "0.0",
				   "1e-320",
				   "\"\"",
				   "[]",
				   "{}",
				   "()",
				   "true",
				   "2147483648",
				   "9223372036854775808L",
				   "0x7fffffff",
				   "0.5",
				   "3.0",
				   "20.0",
				   "1e300",
				   "\"\\x00\"",
				   "\"/\"",
				   "\"%s%n\"",
				   "((((((((",
				   "[1.0, 2.0]",
				   "[1e5, -1e5, 1e5]",
				   "{ a = { b = ( 1, [ 2 ] ); }; }",
				   "@include \"x.scene\"\n",
				   "\"fixed\"",
				   "\"double\"",
				   "\"plane\"",
				   "\"mesh\"",
				   "\"s.asc\"",
				   "\"liver.fis\"",
				   "/*",
				   "#",
				   "\n",
				   "\xff\xfe"};
#define BITS (sizeof(bits) / sizeof(*bits))

/*
 * libconfig 1.5 loses the string in hand at a syntax error, some 70 bytes: it is not ours
 * to free. A configuration that we forgot to destroy would show by its other parts.
 */
const char *__lsan_default_suppressions(void)
{
	return "leak:libconfig_yylex\nleak:strbuf_append\n";
}

static char dir[] = "/tmp/incise-hostile-XXXXXX";
static char path[64];
static uint64_t rng;

static uint32_t below(uint32_t n)
{
	rng ^= rng << 13;
	rng ^= rng >> 7;
	rng ^= rng << 17;
	return (uint32_t)((rng >> 32) * n >> 32);
}

struct text {
	size_t n;
	char c[TEXT_MAX];
};

static void put(const char *name, const void *data, size_t n)
{
	char file[64];
	FILE *out;

	snprintf(file, sizeof(file), "%s/%s", dir, name);
	out = fopen(file, "w");
	if (!out || fwrite(data, 1, n, out) != n || fclose(out))
		abort();
}

static void take(struct text *text, const char *file)
{
	FILE *in = fopen(file, "r");

	if (!in)
		fail_msg("%s: run in the project's folder", file);
	text->n = fread(text->c, 1, sizeof(text->c), in);
	fclose(in);
}

/*
 * In the place of the shipped one, whose compiling takes 60 ms: the smallest there is.
 */
static int write_model(void)
{
	static const struct incise_variable in[] = {{"depth_mm", 0, 20},
						    {"velocity_mm_s", 0, 50}};
	static const struct incise_variable out = {"force_N", 0, 4};
	static const int mfs[] = {2, 2};
	struct incise_model *model =
		incise_model_new_grid(2, in, mfs, INCISE_MF_GAUSS, &out, NULL);
	char file[64];
	int rc;

	for (int r = 0; r < 4; r++)
		incise_model_set_consequent(model, r, (double[]){0.1, 0.001, 0});
	snprintf(file, sizeof(file), "%s/liver.fis", dir);
	rc = incise_model_save(model, file, NULL);
	incise_model_free(model);
	return rc;
}

static int set_up(void **state)
{
	static const char obj[] = "v -50 -50 0\nv 50 -50 0\nv 50 50 1\nv -50 50 0\n"
				  "f 1 2 3 4\n";
	static const char asc[] = "ncols 2\nnrows 2\nxllcenter -9\nyllcenter -9\n"
				  "cellsize 18\n0 1\n0 0\n";

	if (!mkdtemp(dir))
		return -1;
	snprintf(path, sizeof(path), "%s/x.scene", dir);
	if (write_model())
		return -1;
	put("s.obj", obj, sizeof(obj) - 1);
	put("s.asc", asc, sizeof(asc) - 1);
	return 0;
}

static int tear_down(void **state)
{
	static const char *const names[] = {"liver.fis", "s.obj", "s.asc", "x.scene"};
	char file[64];

	for (int i = 0; i < 4; i++) {
		snprintf(file, sizeof(file), "%s/%s", dir, names[i]);
		unlink(file);
	}
	return rmdir(dir);
}

/* Put @n characters in the place of those from @from to @to. */
static void replace(struct text *text, size_t from, size_t to, const char *c, size_t n)
{
	if (text->n - (to - from) + n > sizeof(text->c))
		return;
	memmove(text->c + from + n, text->c + to, text->n - to);
	memcpy(text->c + from, c, n);
	text->n += n - (to - from);
}

static bool is_number(char c)
{
	return (c >= '0' && c <= '9') || c == '.' || c == '-';
}

/* The value at or after a random place becomes another. */
static void replace_number(struct text *text)
{
	const char *bit = bits[below(BITS)];
	size_t from = below((uint32_t)text->n), to;

	while (from < text->n && !is_number(text->c[from]))
		from++;
	for (to = from; to < text->n && is_number(text->c[to]);)
		to++;
	replace(text, from, to, bit, strlen(bit));
}

static void mutate(struct text *text, const struct text *other)
{
	size_t from = below((uint32_t)text->n), to = from + below(40), n;
	char copy[400];

	to = to < text->n ? to : text->n;
	switch (below(7)) {
	case 0:
		text->c[from] ^= (char)(1 << below(8));
		break;
	case 1:
		replace(text, from, to, "", 0);
		break;
	case 2:
		n = to - from;
		memcpy(copy, text->c + from, n);
		from = below((uint32_t)text->n);
		replace(text, from, from, copy, n);
		break;
	case 3:
		/* From somewhere in another one. */
		from = below((uint32_t)other->n);
		n = below(sizeof(copy));
		n = n < other->n - from ? n : other->n - from;
		memcpy(copy, other->c + from, n);
		from = below((uint32_t)text->n);
		replace(text, from, from, copy, n);
		break;
	case 4:
		n = below(BITS);
		replace(text, from, from, bits[n], strlen(bits[n]));
		break;
	default:
		/* The likeliest: it leaves the syntax whole more often. */
		replace_number(text);
	}
}

static bool finite3(const double v[3])
{
	return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]);
}

/* Down through where most surfaces are. */
static void run(struct incise_plan *plan)
{
	for (int i = 1; i <= 50; i++) {
		struct incise_tracker_sample s = {
			.t_ns = i * 1000000,
			.position_mm = {0, 0, 25 - i},
			.quaternion = {1},
			.status = ' ',
		};
		struct incise_tick t;

		assert_int_equal(incise_plan_feed(plan, &s, 1), 1);
		assert_int_equal(incise_plan_tick(plan, s.t_ns, &t), 0);
		assert_true(finite3(t.position_mm) && finite3(t.tool_mm) &&
			    finite3(t.proxy_mm) && finite3(t.normal) &&
			    finite3(t.command_N) && isfinite(t.depth_mm) &&
			    isfinite(t.velocity_mm_s));
		assert_false(t.flags & INCISE_TICK_NOT_FINITE);
	}
}

static void check_line(const struct incise_error *err)
{
	assert_true(err->code > 0);
	assert_true(strlen(err->text) > strlen(path));
	assert_null(strchr(err->text, '\n'));
	if (!strstr(err->text, path))
		fail_msg("does not name the file: %s", err->text);
}

static void try(const struct text *text, int *loaded, int *planned, int *with_model)
{
	struct incise_error err = {0};
	struct incise_scene *scene;
	struct incise_plan *plan;

	put("x.scene", text->c, text->n);
	errno = 0;
	scene = incise_scene_load(path, NULL, &err);
	if (!scene) {
		assert_int_equal(errno, err.code);
		check_line(&err);
		return;
	}
	++*loaded;
	/* Compiling a model and surveying it takes some 20 ms, whatever the scene is. */
	if (scene->model && ++*with_model > MODELS) {
		incise_scene_free(scene);
		return;
	}
	plan = incise_plan_new(scene, NULL, &err);
	if (plan) {
		++*planned;
		run(plan);
	} else {
		check_line(&err);
	}
	incise_plan_free(plan);
	incise_scene_free(scene);
}

static void test_mutants(void **state)
{
	static struct text original[SEEDS];

	for (size_t k = 0; k < SEEDS; k++) {
		if (seeds[k].shipped) {
			take(&original[k], seeds[k].shipped);
		} else {
			original[k].n = strlen(seeds[k].text);
			memcpy(original[k].c, seeds[k].text, original[k].n);
		}
	}
	for (size_t k = 0; k < SEEDS; k++) {
		int loaded = 0, planned = 0, whole = 0, models = 0;

		rng = 0x9e3779b97f4a7c15 + k;
		/* What is broken was whole before. */
		try(&original[k], &whole, &whole, &models);
		assert_int_equal(whole, 2);
		for (int i = 0; i < MUTANTS; i++) {
			struct text text = original[k];
			int times = below(3) ? 1 : 2 + (int)below(3);

			while (times-- && text.n > 1)
				mutate(&text, &original[below(SEEDS)]);
			try(&text, &loaded, &planned, &models);
		}
		print_message("%s: %d mutants, %d loaded, %d made a plan\n",
			      seeds[k].name, MUTANTS, loaded, planned);
		/* Both ways are walked, many times. */
		assert_in_range(loaded, MUTANTS / 50, MUTANTS * 49 / 50);
		assert_true(planned >= MODELS - 1);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_mutants),
	};

	return cmocka_run_group_tests(tests, set_up, tear_down);
}
