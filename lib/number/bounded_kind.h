/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Bounded numbers as a kind of number for the .proto.h of lib/tissue; see bounded.h, and fixed_kind.h.
 */
#define T(name) incise_bounded_##name

#define num bounded<16>
#define dir bounded<30>
#define num12 bounded<12>
#define num20 bounded<20>
#define num24 bounded<24>
#define num28 bounded<28>
#define wide bounded_wide
#define stored num
#define span double
#define period double
#define CUTS 1
#define OWNED
#define T_PART(state, part) (&(state)->part)
/* A number along all paths to it; what else the state becomes on them, its errors hold. */
#define T_JOINED(state, of) joined(state, [&] { return of; })
#define T_OWN_SURFACE
