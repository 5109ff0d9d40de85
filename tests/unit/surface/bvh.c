// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The tree of boxes: each box in one leaf, within all boxes above it, not too deep.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include "solid.h"

struct count {
	const struct bvh *bvh;
	const float (*box)[2][3];
	const uint32_t *order;
	uint32_t seen;
	int deepest;
};

static void walk(struct count *count, uint32_t child, const float lo[3],
		 const float hi[3], int depth)
{
	if (depth > count->deepest)
		count->deepest = depth;
	if (!(child & BVH_LEAF)) {
		const struct bvh_node *node = count->bvh->node + child;

		assert_true(child < count->bvh->n_nodes);
		for (int side = 0; side < 2; side++) {
			for (int i = 0; i < 3 && node->lo[side][i] <= node->hi[side][i];
			     i++)
				assert_true(node->lo[side][i] >= lo[i] &&
					    node->hi[side][i] <= hi[i]);
			walk(count, node->child[side], node->lo[side], node->hi[side],
			     depth + 1);
		}
		return;
	}
	/* leaves lie one behind the other */
	if (BVH_COUNT(child))
		assert_int_equal(BVH_FIRST(child), count->seen);
	for (uint32_t k = 0; k < BVH_COUNT(child); k++) {
		const float(*box)[3] = count->box[count->order[BVH_FIRST(child) + k]];

		for (int i = 0; i < 3; i++)
			assert_true(box[0][i] >= lo[i] && box[1][i] <= hi[i]);
	}
	count->seen += BVH_COUNT(child);
}

static void test_every_box_once(void **state)
{
	static const uint32_t sizes[] = {1, 2, 3, 4, 5, 7, 8, 9, 100, 5000};
	static const float all[2][3] = {{-INFINITY, -INFINITY, -INFINITY},
					{INFINITY, INFINITY, INFINITY}};
	uint64_t random = 88172645463325252u;

	/* boxes anywhere, all the same, and in a row as a file may have them */
	for (int kind = 0; kind < 3; kind++) {
		for (size_t k = 0; k < sizeof(sizes) / sizeof(*sizes); k++) {
			uint32_t n = sizes[k], *order = malloc(n * sizeof(*order));
			float(*box)[2][3] = malloc(n * sizeof(*box));
			bool *seen = calloc(n, sizeof(*seen));
			struct count count = {.order = order};
			struct bvh bvh;

			for (uint32_t b = 0; b < n; b++) {
				for (int i = 0; i < 3; i++) {
					double x = kind == 0   ? solid_random(&random)
						   : kind == 1 ? 0.5
							       : (double)(i ? 0 : b);

					box[b][0][i] = (float)x;
					box[b][1][i] = (float)(x + 0.1);
				}
			}
			assert_int_equal(
				bvh_build(&bvh, (const float(*)[2][3])box, n, order), 0);
			count.bvh = &bvh;
			count.box = (const float(*)[2][3])box;
			walk(&count, 0, all[0], all[1], 0);
			assert_int_equal(count.seen, n);
			/* a query keeps one child per level */
			assert_true(count.deepest < BVH_DEPTH_MAX);
			assert_true(count.deepest <= 1 + ceil(log2(n / 2.0 + 1)));
			for (uint32_t b = 0; b < n; b++) {
				assert_false(seen[order[b]]);
				seen[order[b]] = true;
			}
			bvh_free(&bvh);
			free(order);
			free(box);
			free(seen);
		}
	}
}

static void test_outwards(void **state)
{
	static const double values[] = {0, 1e-300, 1 / 3.0, -1 / 3.0, 1e5, -1e5, 1e-7};

	for (size_t k = 0; k < sizeof(values) / sizeof(*values); k++) {
		double x = values[k], lo = bvh_outwards(x, 0), hi = bvh_outwards(x, 1);

		/* wider than a query's rounding, and not by much */
		assert_true(lo < x - 5e-7 && hi > x + 5e-7);
		assert_true(hi - lo < 1e-5 + fabs(x) * 1e-6);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_every_box_once),
		cmocka_unit_test(test_outwards),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
