// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The exported C file: strict C99 without a warning, and the library's results to the
 * bit. It is compiled as a user would, and loaded.
 */
#include "../unit.h"
#include <dlfcn.h>
#include <limits.h>
#include <incise/fixed.h>
#include "../../../lib/base/random.h"
#include "../../../lib/model/model.h"
#include "paper_model.h"
#include "../cases.h"

#define N 100000

#define COMPILE "${CC:-cc} -std=c99 -pedantic -Wall -Wextra -Werror -O2 "

static char folder[] = "/tmp/incise-c-source.XXXXXX";

static int enter_folder(void **state)
{
	return mkdtemp(folder) && !chdir(folder) ? 0 : -1;
}

static int leave_folder(void **state)
{
	return chdir("/") || rmdir(folder);
}

static struct incise_fixed *compiled(int n_inputs, int arithmetic, double size,
				     const char *name)
{
	const struct incise_variable in[] = {{"depth_mm", -3, 20},
					     {"velocity_mm_s", 0, 50},
					     {"acceleration_mm_s2", -400, 300},
					     {"tilt_deg", 0, 60}};
	const struct incise_variable out = {"force_N", 0, 4};
	const int mfs[] = {5, 4, 2, 2};
	struct incise_fixed_options options = {.arithmetic = arithmetic};
	struct incise_model *model =
		incise_model_new_grid(n_inputs, in, mfs, INCISE_MF_GAUSS, &out, NULL);
	uint64_t seed = 11;
	struct incise_fixed *fx;

	for (int r = 0; r < incise_model_info(model)->n_rules; r++) {
		double p[] = {size * paper_random(&seed), size * paper_random(&seed) / 9,
			      size * paper_random(&seed) / 9,
			      size * paper_random(&seed) / 400,
			      size * paper_random(&seed) / 60};

		incise_model_set_consequent(model, r, p);
	}
	snprintf(model->info.name, sizeof(model->info.name), "%s", name);
	fx = incise_fixed_compile(model, &options, NULL);
	assert_non_null(fx);
	incise_model_free(model);
	return fx;
}

/* Half within the support, half anywhere. */
static int32_t random_input(const struct incise_fixed_input *in, uint64_t *seed)
{
	uint32_t bits;

	incise_random_step(seed);
	bits = *seed >> 32;
	if (*seed >> 31 & 1)
		return (int32_t)bits;
	return in->min + (int32_t)(bits % ((uint32_t)in->max - (uint32_t)in->min + 1));
}

static void compare(const struct incise_fixed *fx, int32_t (*eval)(const int32_t *))
{
	static const int32_t ends[] = {INT32_MIN, INT32_MAX, 0, -1, 1};
	uint64_t seed = 1;

	for (int k = 0; k < cases_of(N, 5000); k++) {
		int32_t x[INCISE_FIXED_INPUTS_MAX] = {0};

		for (int i = 0; i < fx->n_inputs; i++)
			x[i] = k < 25 ? ends[i & 1 ? k / 5 : k % 5]
				      : random_input(&fx->input[i], &seed);
		assert_int_equal(eval(x), incise_fixed_eval(fx, x));
	}
}

/* Every arithmetic, one input to four, small numbers and large, an awkward name. */
TEST(test_same_to_the_bit)
{
	static const double sizes[] = {1e-6, 3, 50};

	for (int k = 0; k < 3 * 2 * 3 + 2; k++) {
		bool many = k >= 3 * 2 * 3;
		struct incise_fixed *fx = compiled(
			1 + k % 2 + 2 * many, many ? INCISE_FIXED_DIRECT : k / 2 % 3,
			many ? 3 : sizes[k / 6], "liver /* of \"mine\" */ \?\?/ \\\n µ");
		int32_t (*eval)(const int32_t *);
		char path[64];
		void *so;

		assert_int_equal(incise_fixed_write_c(fx, "m.c", "my_liver2", NULL), 0);
		/* A name of its own each time: dlopen knows files that it has seen. */
		snprintf(path, sizeof(path), "./m%d.so", k);
		setenv("SO", path, 1);
		assert_int_equal(system(COMPILE "-shared -fPIC -o $SO m.c"), 0);
		so = dlopen(path, RTLD_NOW | RTLD_LOCAL);
		assert_non_null(so);
		*(void **)&eval = dlsym(so, "my_liver2_eval");
		assert_non_null(eval);
		compare(fx, eval);
		dlclose(so);
		unlink(path);
		unlink("m.c");
		incise_fixed_free(fx);
	}
}

/* Nothing is needed of a C library but stdint.h. */
TEST(test_self_contained)
{
	for (int arithmetic = 0; arithmetic < 3; arithmetic++) {
		struct incise_fixed *fx = compiled(2, arithmetic, 3, "liver");

		assert_int_equal(incise_fixed_write_c(fx, "m.c", "liver", NULL), 0);
		assert_int_equal(system("test \"$(grep -c '#include' m.c)\" = 1 && "
					"grep -q '#include <stdint.h>' m.c && "
					"grep -q ' liver: .* 20 rules' m.c"),
				 0);
		assert_int_equal(system(COMPILE "-ffreestanding -c -o m.o m.c && "
						"test -z \"$(${NM:-nm} -u m.o)\""),
				 0);
		assert_int_equal(
			system("test \"$(${NM:-nm} -g --defined-only m.o | wc -l)\" = 1"),
			0);
		unlink("m.c");
		unlink("m.o");
		incise_fixed_free(fx);
	}
}

TEST(test_refused)
{
	static const char *const bad[] = {
		"",
		"2liver",
		"my-liver",
		"a b",
		"l\xc3\xa9",
		"a;",
		"aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"};
	struct incise_fixed *fx = compiled(1, INCISE_FIXED_DIRECT, 3, "liver");

	for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++) {
		err = (struct incise_error){0};
		assert_int_equal(incise_fixed_write_c(fx, "m.c", bad[i], &err), -EINVAL);
		assert_int_equal(err.code, EINVAL);
		assert_int_not_equal(access("m.c", F_OK), 0);
	}
	assert_error(incise_fixed_write_c(fx, "none/m.c", "liver", &err), ENOENT, &err,
		     "none/m.c");
	assert_int_equal(incise_fixed_write_c(fx, "/dev/full", "liver", &err), -ENOSPC);
	incise_fixed_free(fx);
}

GROUP(enter_folder, leave_folder);
