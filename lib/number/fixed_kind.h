/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * The integers as a kind of number for the .proto.h of lib/tissue: types by their scale, and names.
 * no_kind.h takes them back, so that one source can have both kinds.
 */
#define T(name) incise_fixed_##name

#define num int32_t   /* Q16.16: mm, N, N/mm, mm/s, shares of 1 */
#define dir int32_t   /* Q2.30: part of a unit vector or quaternion, shares of 1 */
#define num12 int32_t /* Q12, and so on */
#define num20 int32_t
#define num24 int32_t
#define num28 int32_t
#define wide int64_t   /* of the scale that stands beside it */
#define stored int32_t /* num, as an array keeps it */
#define span int32_t   /* ns of a filter */
#define period int32_t /* ns of a ramp */
#define CUTS INCISE_FIXED_CUTS_MAX
#define OWNED /* a part of a state that is in it, and not elsewhere */
#define T_PART(state, part) (&(state)->part)
#define T_JOINED(state, of) (of)
#define T_OWN_SURFACE                    \
	struct incise_fixed_shape shape; \
	struct incise_fixed_grid_frame grid;
