/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Take back the constants of a kind of number, beside what no_kind.h does.
 */
#undef N
#undef N_OF
#undef D_OF
#undef D_ONE
#undef HALF_PI
#undef LEAST
#undef FAR_MOST
#undef CREEP
#undef DT_MOST
#undef W_ONE
#undef W_MM
#undef W_MM_S
#undef W_MM_S2
#undef W_MISS_MM
#undef W_SHARE
