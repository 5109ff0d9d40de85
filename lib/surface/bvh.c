// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Building the tree of boxes: halve the triangles at the median of their middles along
 * the widest axis, down to leaves of two to four. Halving bounds the depth whatever the
 * mesh looks like, and with it the stack of a query.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "bvh.h"

#define LEAF_MAX 4

struct item {
	float middle[3];
	uint32_t box;
};

struct builder {
	const float (*box)[2][3];
	struct item *item;
	struct bvh *bvh;
	uint32_t random; /* for pivots: no order of a file makes the partition slow */
};

float bvh_outwards(double x, int up)
{
	/* A float is good to 2^-24 of it; the millionth of a mm is for numbers near 0. */
	double away = fabs(x) * 0x1p-22 + 1e-6;

	return (float)(up ? x + away : x - away);
}

static void widen(float box[2][3], const float by[2][3])
{
	for (int i = 0; i < 3; i++) {
		box[0][i] = fminf(box[0][i], by[0][i]);
		box[1][i] = fmaxf(box[1][i], by[1][i]);
	}
}

static void nothing(float box[2][3])
{
	for (int i = 0; i < 3; i++) {
		box[0][i] = INFINITY;
		box[1][i] = -INFINITY;
	}
}

static int widest(const struct item *item, uint32_t n)
{
	float box[2][3];
	int axis = 0;

	nothing(box);
	for (uint32_t k = 0; k < n; k++) {
		float point[2][3];

		memcpy(point[0], item[k].middle, sizeof(point[0]));
		memcpy(point[1], item[k].middle, sizeof(point[1]));
		widen(box, (const float(*)[3])point);
	}
	for (int i = 1; i < 3; i++)
		if (box[1][i] - box[0][i] > box[1][axis] - box[0][axis])
			axis = i;
	return axis;
}

/* Hoare's selection: the k-th along an axis comes to its place, smaller ones before. */
static void halve(struct builder *b, struct item *item, int64_t n, int64_t k, int axis)
{
	int64_t lo = 0, hi = n - 1;

	while (lo < hi) {
		int64_t i = lo, j = hi;
		float pivot;

		b->random = b->random * 1664525u + 1013904223u;
		pivot = item[lo + (int64_t)(b->random % (uint64_t)(hi - lo + 1))]
				.middle[axis];
		while (i <= j) {
			while (item[i].middle[axis] < pivot)
				i++;
			while (item[j].middle[axis] > pivot)
				j--;
			if (i <= j) {
				struct item swap = item[i];

				item[i++] = item[j];
				item[j--] = swap;
			}
		}
		if (k <= j)
			hi = j;
		else if (k >= i)
			lo = i;
		else
			return;
	}
}

static uint32_t build(struct builder *b, uint32_t first, uint32_t n, float box[2][3])
{
	struct item *item = b->item + first;
	uint32_t index, half = n / 2;
	uint32_t begin[2] = {first, first + half}, count[2] = {half, n - half};

	nothing(box);
	if (n <= LEAF_MAX) {
		for (uint32_t k = 0; k < n; k++)
			widen(box, b->box[item[k].box]);
		return BVH_LEAF | n << 28 | first;
	}
	halve(b, item, n, half, widest(item, n));
	index = b->bvh->n_nodes++;
	for (int side = 0; side < 2; side++) {
		struct bvh_node *node = b->bvh->node + index;
		float half_box[2][3];

		node->child[side] = build(b, begin[side], count[side], half_box);
		memcpy(node->lo[side], half_box[0], sizeof(half_box[0]));
		memcpy(node->hi[side], half_box[1], sizeof(half_box[1]));
		widen(box, (const float(*)[3])half_box);
	}
	return index;
}

int bvh_build(struct bvh *bvh, const float (*box)[2][3], uint32_t n, uint32_t *order)
{
	struct builder b = {.box = box, .bvh = bvh, .random = 1};
	/* A leaf has two triangles or more, but for a single one. */
	size_t room = (size_t)n / 2 + 1;
	float all[2][3];
	uint32_t root;

	bvh->n_nodes = 0;
	bvh->node = aligned_alloc(sizeof(*bvh->node), room * sizeof(*bvh->node));
	b.item = malloc(n * sizeof(*b.item));
	if (!bvh->node || !b.item) {
		free(b.item);
		bvh_free(bvh);
		return -ENOMEM;
	}
	memset(bvh->node, 0, room * sizeof(*bvh->node));
	for (uint32_t k = 0; k < n; k++) {
		for (int i = 0; i < 3; i++)
			b.item[k].middle[i] = box[k][0][i] / 2 + box[k][1][i] / 2;
		b.item[k].box = k;
	}
	root = build(&b, 0, n, all);
	if (root & BVH_LEAF) {
		/* A query begins with a node: one with this leaf and an empty one. */
		struct bvh_node *node = bvh->node;

		bvh->n_nodes = 1;
		nothing(all);
		memcpy(node->lo[1], all[0], sizeof(all[0]));
		memcpy(node->hi[1], all[1], sizeof(all[1]));
		build(&b, 0, n, all);
		memcpy(node->lo[0], all[0], sizeof(all[0]));
		memcpy(node->hi[0], all[1], sizeof(all[1]));
		node->child[0] = root;
		node->child[1] = BVH_LEAF;
	}
	for (uint32_t k = 0; k < n; k++)
		order[k] = b.item[k].box;
	free(b.item);
	return 0;
}

void bvh_free(struct bvh *bvh)
{
	free(bvh->node);
	bvh->node = NULL;
}
