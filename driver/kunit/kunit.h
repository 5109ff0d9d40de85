/* SPDX-License-Identifier: GPL-2.0-only */
/*
 * KUnit, or as much of it as these tests use: Debian's kernels are built without. The same
 * tests run then when the module is loaded, and report in the same form (KTAP) to the
 * kernel's log.
 */
#ifndef INCISE_DRIVER_KUNIT_H
#define INCISE_DRIVER_KUNIT_H

#include <linux/kconfig.h>

#if IS_ENABLED(CONFIG_KUNIT)
#include <kunit/test.h>
#else
#include <linux/err.h>
#include <linux/module.h>
#include <linux/slab.h>

struct kunit {
	unsigned int failed;
	bool skipped;
	void *memory[8]; /* freed behind each case */
	unsigned int n_memory;
};

struct kunit_case {
	void (*run_case)(struct kunit *test);
	const char *name;
};

struct kunit_suite {
	const char *name;
	struct kunit_case *test_cases;
};

/* A case without a function is the last. */
#define KUNIT_CASE(function)                            \
	{                                               \
		.run_case = function, .name = #function \
	}

static inline void *kunit_kzalloc(struct kunit *test, size_t size, gfp_t gfp)
{
	void *memory = NULL;

	if (test->n_memory < ARRAY_SIZE(test->memory))
		memory = kzalloc(size, gfp);
	if (memory)
		test->memory[test->n_memory++] = memory;
	return memory;
}

static inline void kunit_judge(struct kunit *test, bool good, const char *what, int line)
{
	if (good)
		return;
	test->failed++;
	pr_info("    # line %d: %s\n", line, what);
}

#define KUNIT_EXPECT_EQ(test, a, b) \
	kunit_judge(test, (a) == (b), "expected " #a " == " #b, __LINE__)
#define KUNIT_EXPECT_NE(test, a, b) \
	kunit_judge(test, (a) != (b), "expected " #a " != " #b, __LINE__)
#define KUNIT_FAIL(test, text) kunit_judge(test, false, text, __LINE__)
#define kunit_mark_skipped(test, why)                \
	do {                                         \
		(test)->skipped = true;              \
		pr_info("    # skipped: %s\n", why); \
	} while (0)

static inline int kunit_run(const struct kunit_suite *suite)
{
	unsigned int failed = 0, n;

	pr_info("KTAP version 1\n");
	pr_info("1..1\n");
	for (n = 0; suite->test_cases[n].run_case; n++) {
		struct kunit test = {};

		suite->test_cases[n].run_case(&test);
		while (test.n_memory)
			kfree(test.memory[--test.n_memory]);
		pr_info("    %sok %u %s%s\n", test.failed ? "not " : "", n + 1,
			suite->test_cases[n].name, test.skipped ? " # SKIP" : "");
		failed += !!test.failed;
	}
	pr_info("%sok 1 %s\n", failed ? "not " : "", suite->name);
	return 0;
}
#endif

#endif
