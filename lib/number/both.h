/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * The operations that are written alike for both kinds of numbers; fixed.h and double.h have the others. A NaN
 * is neither below nor above anything.
 */
#ifndef INCISE_NUMBER_BOTH_H
#define INCISE_NUMBER_BOTH_H

static inline num n_neg(num a)
{
	return -a;
}

static inline num n_half(num a)
{
	return a / 2;
}

static inline bool n_below(num a, num b)
{
	return a < b;
}

static inline num n_min(num a, num b)
{
	return a < b ? a : b;
}

static inline num n_max(num a, num b)
{
	return a > b ? a : b;
}

static inline num n_within(num v, num least, num most)
{
	return v > most ? most : v < least ? least : v;
}

static inline bool d_below(dir a, dir b)
{
	return a < b;
}

static inline wide w_of(num a)
{
	return a;
}

static inline num n_of(wide a)
{
	return (num)a;
}

static inline wide w_min(wide a, wide b)
{
	return a < b ? a : b;
}

static inline wide w_half(wide a)
{
	return a / 2;
}

#endif
