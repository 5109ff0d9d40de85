/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A tree of boxes around triangles, in mm. Each node holds the boxes of its two children,
 * so that one cache line decides where to go on. Boxes are in float, rounded outwards
 * and then a little wider, so that no rounding in a query can miss what lies on a side.
 */
#ifndef INCISE_BVH_H
#define INCISE_BVH_H

#include <stdint.h>

/* A child is a node's index, or a leaf: a run of up to 7 triangles. */
#define BVH_LEAF 0x80000000u
#define BVH_FIRST(child) ((child)&0x0fffffffu)
#define BVH_COUNT(child) (((child) >> 28) & 7u)

/* Halving 2^28 triangles down to leaves of two is 27 levels deep. */
#define BVH_DEPTH_MAX 32

struct bvh_node {
	float lo[2][3], hi[2][3];
	uint32_t child[2];
	uint32_t unused[2]; /* to 64 bytes */
};

struct bvh {
	struct bvh_node *node;
	uint32_t n_nodes;
};

/* From a double to a float that is surely below it (or above it, for @up). */
float bvh_outwards(double x, int up);

/*
 * Build a tree over n ≥ 1 boxes; order[i] is the box that became the i-th of the leaves.
 * Takes n log n steps. Returns 0 or -ENOMEM.
 */
int bvh_build(struct bvh *bvh, const float (*box)[2][3], uint32_t n, uint32_t *order);
void bvh_free(struct bvh *bvh);

#endif
