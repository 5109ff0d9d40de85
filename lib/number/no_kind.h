/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * Take back the names of a kind of number; see fixed_kind.h.
 */
#undef T
#undef num
#undef dir
#undef num12
#undef num20
#undef num24
#undef num28
#undef wide
#undef stored
#undef span
#undef period
#undef CUTS
#undef OWNED
#undef T_PART
#undef T_JOINED
#undef T_OWN_SURFACE
