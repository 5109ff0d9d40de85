/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Doubles as a kind of number for the .proto.h of lib/tissue; see fixed_kind.h.
 */
#define T(name) incise_double_##name

#define num double
#define dir double
#define num12 double
#define num20 double
#define num24 double
#define num28 double
#define wide double
#define stored float
#define span double
#define period double
#define CUTS
#define OWNED *
#define T_PART(state, part) ((state)->part)
#define T_JOINED(state, of) (of)
#define T_OWN_SURFACE
