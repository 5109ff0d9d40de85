/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Operations of the three kinds of numbers on the same operands: operations.c draws them, kinds.cc
 * applies them.
 */
#ifndef INCISE_TEST_OPERANDS_H
#define INCISE_TEST_OPERANDS_H

/* By how far an operand of the integers is off, at most, beside its rounding: of a number, of a direction. */
#define NUMBER_OFF (1 / 8192.0)
#define DIRECTION_OFF (1 / 4194304.0)

/*
 * Each operation: its name, and what it gives; of x, y, z numbers, a, b vectors, u, v directions, q a turn. The last
 * two divide by a length, whose parts each count as far off as the smallest of them.
 */
#define OPERATIONS(OP)                                                          \
	OP(add, number(to, n_add(x, y)))                                        \
	OP(subtract, number(to, n_sub(x, y)))                                   \
	OP(size, number(to, n_abs(x)))                                          \
	OP(half, number(to, n_half(x)))                                         \
	OP(times, number(to, n_times(x, y)))                                    \
	OP(over, number(to, n_over(x, z)))                                      \
	OP(smaller, number(to, n_min(x, y)))                                    \
	OP(larger, number(to, n_max(x, y)))                                     \
	OP(within, number(to, n_within(x, n_neg(z), z)))                        \
	OP(share, number(to, n_share_of(d_dot(u, v))))                          \
	OP(dot, direction(to, d_dot(u, v)))                                     \
	OP(cross, d_cross(s, u, v); directions(to, s))                          \
	OP(turn, d_turn(s, q, u); directions(to, s))                            \
	OP(difference, v_sub(r, a, b); vector(to, r))                           \
	OP(push, v_add(r, a, x, u); vector(to, r))                              \
	OP(pull, v_pull(r, a, x, b); vector(to, r))                             \
	OP(along, number(to, v_along(a, u)))                                    \
	OP(across, v_across(r, a, u); vector(to, r))                            \
	OP(length, number(to, v_length(a)))                                     \
	OP(reach, v_reach(r, a, q, b); vector(to, r))                           \
	OP(tilted, number(to, n_times(v_along(a, u), n_share_of(d_dot(u, v))))) \
	OP(towards, (void)v_direction(s, a); directions(to, s))                 \
	OP(quotient, number(to, n_over(v_along(a, u), n_max(z, v_length(b)))))

enum operation {
#define OP(name, ...) OPERATION_##name,
	OPERATIONS(OP)
#undef OP
		OPERATION_COUNT
};

/* Numbers, z > 0; vectors; directions; a quaternion. And how far those of the integers are off. */
struct operands {
	double x, y, z, a[3], b[3], u[3], v[3], q[4];
	double off_x, off_y, off_z, off_a[3], off_b[3], off_u[3], off_v[3], off_q[4];
};

/* A number is part[0]. */
struct result {
	double part[3];
};

#ifdef __cplusplus
extern "C" {
#endif
void operate_in_double(enum operation op, const struct operands *of, struct result *to);
void operate_in_integers(enum operation op, const struct operands *of, struct result *to);
/* How far the two may be apart. */
double operation_bound(enum operation op, const struct operands *of);
#ifdef __cplusplus
}
#endif

#endif
