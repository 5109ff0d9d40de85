// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The operations of operands.h in each kind of numbers; a kind is a namespace of its own.
 */
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
extern "C" {
#include <incise/clock.h>
#include <incise/export.h>
#include "../../../lib/base/vector.h"
#include "../../../lib/fixed/vector.h"
}
#include "operands.h"

#pragma GCC diagnostic ignored "-Wunused-function"

namespace in_double
{
#include "../../../lib/number/double.h"
static num in_number(double from, double)
{
	return from;
}

static dir in_direction(double from, double)
{
	return from;
}

static void out_number(double *to, num of)
{
	*to = of;
}

static void out_direction(double *to, dir of)
{
	*to = of;
}

#include "operate.h"
#include "../../../lib/number/no_kind.h"
} // namespace in_double
#include "no_constants.h"
#undef INCISE_NUMBER_BOTH_H

namespace in_integers
{
#include "../../../lib/number/fixed.h"
static num in_number(double from, double off)
{
	return (num)lrint(ldexp(from + off, 16));
}

static dir in_direction(double from, double off)
{
	return (dir)lrint(ldexp(from + off, 30));
}

static void out_number(double *to, num of)
{
	*to = ldexp(of, -16);
}

static void out_direction(double *to, dir of)
{
	*to = ldexp(of, -30);
}

#include "operate.h"
#include "../../../lib/number/no_kind.h"
} // namespace in_integers
#include "no_constants.h"

namespace in_bounded
{
#include "../../../lib/number/bounded.h"
static num in_number(double from, double)
{
	return num::of(put({from, from, NUMBER_OFF + lsb(17), 0, 16, false}));
}

static dir in_direction(double from, double)
{
	return dir::of(put({from, from, DIRECTION_OFF + lsb(31), 0, 30, false}));
}

/* How far it is off; of a ball the whole of it is in each part. */
static void out_number(double *to, num of)
{
	*to = fmax(*to, off(at(of.id)));
}

static void out_direction(double *to, dir of)
{
	*to = fmax(*to, off(at(of.id)));
}

#include "operate.h"

static double bound(enum operation op, const struct operands *of)
{
	double most = 0;
	struct fork fork;

	if (!begin_paths())
		return 0;
	fork.begin();
	do {
		struct result now = {};

		operate(op, of, &now);
		if (!paths->dead)
			most = fmax(most, now.part[0]);
	} while (fork.next());
	return end_paths(most);
}
} // namespace in_bounded

void operate_in_double(enum operation op, const struct operands *of, struct result *to)
{
	in_double::operate(op, of, to);
}

void operate_in_integers(enum operation op, const struct operands *of, struct result *to)
{
	in_integers::operate(op, of, to);
}

double operation_bound(enum operation op, const struct operands *of)
{
	return in_bounded::bound(op, of);
}
