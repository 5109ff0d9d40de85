/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * kinds.cc includes this once in the namespace of each kind, which has in_number() and in_direction(), for
 * operands with their errors, in_part(), and out(), which takes a part of the result.
 */
static void in_vector(num to[3], const double from[3], const double off[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = in_number(from[i], off[i]);
}

static void in_directions(dir *to, const double *from, const double *off, int n)
{
	for (int i = 0; i < n; i++)
		to[i] = in_direction(from[i], off[i]);
}

static void number(struct result *to, num of)
{
	out_number(&to->part[0], of);
}

static void direction(struct result *to, dir of)
{
	out_direction(&to->part[0], of);
}

static void vector(struct result *to, const num of[3])
{
	for (int i = 0; i < 3; i++)
		out_number(&to->part[i], of[i]);
}

static void directions(struct result *to, const dir of[3])
{
	for (int i = 0; i < 3; i++)
		out_direction(&to->part[i], of[i]);
}

static void operate(enum operation op, const struct operands *of, struct result *to)
{
	num x = in_number(of->x, of->off_x), y = in_number(of->y, of->off_y);
	num z = in_number(of->z, of->off_z), a[3], b[3], r[3];
	dir u[3], v[3], s[3], q[4];

	in_vector(a, of->a, of->off_a);
	in_vector(b, of->b, of->off_b);
	in_directions(u, of->u, of->off_u, 3);
	in_directions(v, of->v, of->off_v, 3);
	in_directions(q, of->q, of->off_q, 4);
	switch (op) {
#define OP(name, ...)          \
	case OPERATION_##name: \
		__VA_ARGS__;   \
		break;
		OPERATIONS(OP)
#undef OP
	default:
		break;
	}
}
