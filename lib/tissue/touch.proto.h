/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * The proxy of a tool on a surface, for a kind of numbers; see tick.proto.h.
 */

/* The point of a surface that belongs to a place. */
struct T(touch) {
	num point[3];
	dir normal[3]; /* out of the tissue */
	num depth;     /* > 0 inside */
};

/* The proxy of a tool; see ../surface/surface.h. Begins with {0}. */
struct T(proxy) {
	int32_t placed; /* has a tool's place */
	int32_t touching;
	int32_t began; /* with the last move */
	num tool[3];
	struct T(touch) touch;
	struct T(touch) first; /* where the contact began; depth 0 or more */
};
